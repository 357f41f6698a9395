"""What is wrong with a file, an impact or a channel of it, as the problem that its sender is answered."""

from __future__ import annotations

from headimpact.quality import words
from headimpact.recording import UNITS_OF, SignalName
from headimpact_service.errors import PayloadError, Problem


def unit_unknown(named: str, signal: SignalName) -> Problem:
    """The 422 for a laboratory's channel in a unit that is none of its signal's."""
    known = ", ".join(UNITS_OF[signal])
    detail = f"The unit of {named} is none that is known for it: write the {words(signal)} in one of {known}."
    return file_fault(detail, "unit-missing")


def file_fault(detail: str, code: str, *, parameter: str | None = None, pointer: str | None = None) -> Problem:
    """The 422 for a file, or one impact of it; `parameter` and `pointer` say where its sender can mend it."""
    fault = PayloadError(detail, code, pointer=pointer, parameter=parameter)
    return Problem("unreadable-file", detail, errors=[fault])
