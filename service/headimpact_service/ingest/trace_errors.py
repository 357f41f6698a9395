"""What the science refuses, as the problem that a caller is answered."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from headimpact.errors import TraceError
from headimpact.record_rules import broken_rules
from headimpact.recording import Recording
from headimpact_service.errors import MAX_ERRORS, PayloadError, Problem
from headimpact_service.ingest.filling import FILLED, would_be_whole

# Codes whose index counts stamps rather than samples of a channel.
_TIME_CODES = frozenset({"time-not-increasing", "time-jitter"})


def trace_problem(error: TraceError, recording: Recording) -> Problem:
    """The 422 for a recording that breaks a rule, pointing at the signal, channel and sample as JSON names them.

    `error` is the fault that stopped its preparation; the others that can be told follow it.
    """
    faults = {(fault.code, _pointer(fault)): str(fault) for fault in (error, *_first(broken_rules(recording)))}
    errors = [PayloadError(detail=detail, code=code, pointer=place) for (code, place), detail in faults.items()]
    detail = str(error)
    if would_be_whole(recording, error.code):
        detail = f"{detail.removesuffix('.')}; {FILLED}."
    slug = "improper-rotation" if error.code == "improper-rotation" else "invalid-trace"
    return Problem(slug, detail, errors=errors[:MAX_ERRORS])


def _first(faults: Iterator[TraceError]) -> Iterator[TraceError]:
    """As many as an answer holds."""
    return islice(faults, MAX_ERRORS)


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
