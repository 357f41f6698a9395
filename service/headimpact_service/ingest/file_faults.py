"""What is wrong with a file, an impact or a channel of it, as the problem that its sender is answered."""

from __future__ import annotations

from headimpact_service.errors import PayloadError, Problem


def file_fault(detail: str, code: str, *, parameter: str | None = None, pointer: str | None = None) -> Problem:
    """The 422 for a file, or one impact of it; `parameter` and `pointer` say where its sender can mend it."""
    fault = PayloadError(detail, code, pointer=pointer, parameter=parameter)
    return Problem("unreadable-file", detail, errors=[fault])
