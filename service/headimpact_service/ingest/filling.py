"""Where a missing sample is refused, whether filling gaps would have helped, as its sender is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from headimpact.gaps import short_runs
from headimpact.published import QUALITY_LIMITS
from headimpact.record_rules import broken_rules
from headimpact.recording import Recording
from headimpact_service.ingest.table import FloatArray

MOST: int = QUALITY_LIMITS["gaps"]["maximum_samples"]
FILLED = f"fill_gaps fills gaps of at most {MOST} samples"
_OF_GAPS = frozenset({"time-jitter"})
"""Faults of what is sent whole that a lost sample may be behind; null among samples is refused before."""


def how_filled(values: FloatArray, index: int) -> str:
    """What helps against a missing sample of a column, as the end of a sentence; nothing against a word."""
    unknown = ~np.isfinite(values)
    if np.isinf(values[index]):
        return ""
    if short_runs(unknown)[index]:
        return f": {FILLED}"
    if unknown.all():
        return ": it holds nothing at all; three axes are needed, so write zeros where the motion has none by its plane"
    at_edge = unknown[: index + 1].all() or unknown[index:].all()
    return ": leave out the samples at the record's edge that lack it" if at_edge else ""


def would_be_whole(recording: Recording, code: str) -> bool:
    """Whether a fault of a recording would not be one if its gaps were filled."""
    if recording.fill_gaps or code not in _OF_GAPS:
        return False
    return all(fault.code != code for fault in broken_rules(replace(recording, fill_gaps=True)))
