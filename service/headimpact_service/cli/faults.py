"""What went wrong, in one line."""

from __future__ import annotations

from pydantic import ValidationError

from headimpact.errors import HeadimpactError, ModelDocumentError
from headimpact_service.errors import Problem
from headimpact_service.store.access import DatabaseUrlError
from headimpact_service.store.migrate import MigrationError

USAGE = 2
FAILED = 1


def explain(error: Exception) -> tuple[str, int]:
    """The line and the exit code: 2 where what was given cannot be used, 1 for everything else."""
    if isinstance(error, Problem):
        return problem_line(error), USAGE
    if isinstance(error, ValidationError):
        return _setting_line(error), USAGE
    if isinstance(error, ModelDocumentError):
        return f"{error.pointer or 'model'}: {error}", USAGE
    if isinstance(error, DatabaseUrlError | MigrationError | HeadimpactError | ValueError):
        return str(error), USAGE
    if isinstance(error, OSError):
        return f"{error.strerror or error}{f': {error.filename}' if error.filename else ''}", USAGE
    return f"{type(error).__name__}: {error}", FAILED


def problem_line(problem: Problem) -> str:
    """A problem with the places of its errors."""
    news = [error for error in problem.errors if error.detail not in problem.detail]
    places = "; ".join(f"{error.pointer or error.parameter or 'body'}: {error.detail}" for error in news)
    return f"{problem.detail} {places}".strip()


def _setting_line(error: ValidationError) -> str:
    """A setting that breaks its rule, by the name of its environment variable."""
    faults = error.errors(include_url=False, include_input=False)
    return "; ".join(f"HEADIMPACT_{'_'.join(map(str, fault['loc'])).upper()}: {fault['msg']}" for fault in faults)
