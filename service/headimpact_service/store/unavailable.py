"""The answer when the database cannot take the work now."""

from __future__ import annotations

from headimpact_service.errors import Problem

RETRY_AFTER_S = 2


def unavailable(detail: str) -> Problem:
    """A 503 that says when to come back."""
    return Problem("unavailable", detail, headers={"Retry-After": str(RETRY_AFTER_S)})
