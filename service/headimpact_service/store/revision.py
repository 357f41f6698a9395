"""Optimistic locking: a change names the revision that it was made against."""

from __future__ import annotations

from headimpact_service.errors import Problem

ANY = -1
"""What `If-Match: *` names: whichever revision there is, but one."""


def require_revision(present: int, if_match: int | None, *, exists: bool = True) -> None:
    """A `precondition-failed` problem if a change was made against another revision; None matches each, and nothing."""
    if if_match == ANY and exists:
        return
    if if_match == ANY:
        raise Problem("precondition-failed", "There is nothing yet that If-Match: * could name.")
    if if_match is not None and if_match != present:
        raise Problem("precondition-failed", "The resource has changed since the revision that If-Match names.")
