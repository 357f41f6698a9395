"""Optimistic locking: a change names the revision that it was made against."""

from __future__ import annotations

from headimpact_service.errors import Problem


def require_revision(present: int, if_match: int | None) -> None:
    """A `precondition-failed` problem if a change was made against another revision; None matches each."""
    if if_match is not None and if_match != present:
        raise Problem("precondition-failed", "The resource has changed since the revision that If-Match names.")
