"""What the science refuses, as the problem that a caller is answered."""

from __future__ import annotations

from headimpact.errors import TraceError
from headimpact_service.errors import PayloadError, Problem

# Codes whose index counts stamps rather than samples of a channel.
_TIME_CODES = frozenset({"time-not-increasing", "time-jitter"})


def trace_problem(error: TraceError) -> Problem:
    """The 422 for a recording that breaks a rule, pointing at the signal, channel and sample as JSON names them."""
    detail = str(error)
    slug = "improper-rotation" if error.code == "improper-rotation" else "invalid-trace"
    fault = PayloadError(detail=detail, code=error.code, pointer=_pointer(error))
    return Problem(slug, detail, errors=[fault])


def _pointer(error: TraceError) -> str:
    if error.code == "improper-rotation":
        return "/kinematics/mounting"
    steps: list[object] = ["", "kinematics"]
    if error.signal is not None:
        steps.append(error.signal)
        steps += _inside(error)
    return "/".join(str(step) for step in steps)


def _inside(error: TraceError) -> list[object]:
    """The steps below the signal; a sample can be named only where its array is known."""
    if error.code in _TIME_CODES:
        return ["time_ms"] if error.index is None else ["time_ms", error.index]
    if error.channel is None:
        return []
    return [error.channel] if error.index is None else [error.channel, error.index]
