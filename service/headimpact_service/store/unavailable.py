"""The answer when the database cannot take the work now."""

from __future__ import annotations

from sqlalchemy.exc import DatabaseError, DBAPIError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from headimpact_service.errors import Problem

RETRY_AFTER_S = 2


def unavailable(detail: str) -> Problem:
    """A 503 that says when to come back."""
    return Problem("unavailable", detail, headers={"Retry-After": str(RETRY_AFTER_S)})


def is_out_of_reach(error: BaseException) -> bool:
    """Whether an error is the database's own: locked, full, gone, damaged; not a mistake in what it was asked.

    The driver names a damaged file by the class that all of its errors have in common.
    """
    lost = isinstance(error, DBAPIError) and error.connection_invalidated
    return lost or isinstance(error, OperationalError | PoolTimeout) or type(error) is DatabaseError


def reason_of(error: BaseException) -> str:
    """Why it cannot, in one line, as the database's driver or the system says it."""
    said = error.orig if isinstance(error, DBAPIError) and error.orig is not None else error
    text = said.strerror if isinstance(said, OSError) and said.strerror else str(said)
    return f"{type(said).__name__}: {text.partition(chr(10))[0]}"
