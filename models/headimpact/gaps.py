"""Short gaps in a recording, filled where that was asked for.

A gap is a run of values that are no number, or of samples that are not there at all, which the time stamps show. It is
filled by straight lines between its neighbours. What is longer, or has no neighbour on one side, stays as it is and is
refused like any other missing sample.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from headimpact.published import QUALITY_LIMITS
from headimpact.recording import FloatArray, Signal
from headimpact.stamps import is_like

BoolArray = NDArray[np.bool_]


def fill_gaps(signal: Signal) -> tuple[Signal, int]:
    """The signal without its gaps of at most 2 samples, and how many samples were filled."""
    filled, absent = _absent_samples(signal)
    values, missing = _missing_values(filled.values)
    return (replace(filled, values=values), absent + missing) if missing else (filled, absent)


def _missing_values(values: FloatArray) -> tuple[FloatArray, int]:
    """Values that are no number, by component; a sample of which several components are filled counts once."""
    unknown = ~np.isfinite(values)
    if not unknown.any():
        return values, 0
    filled, index = values.copy(), np.arange(values.shape[0])
    for axis in range(values.shape[1]):
        short = short_runs(unknown[:, axis])
        known = ~unknown[:, axis]
        if short.any():
            filled[short, axis] = np.interp(index[short], index[known], values[known, axis])
    return filled, int(np.count_nonzero((unknown & np.isfinite(filled)).any(axis=1)))


def short_runs(unknown: BoolArray) -> BoolArray:
    """Which of the unknown lie in a run that can be filled: it is short and has a known neighbour on either side."""
    short = np.zeros_like(unknown)
    edges = np.flatnonzero(np.diff(unknown.astype(np.int8), prepend=0, append=0))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        inside = start > 0 and stop < unknown.size
        if inside and stop - start <= QUALITY_LIMITS["gaps"]["maximum_samples"]:
            short[start:stop] = True
    return short


def _absent_samples(signal: Signal) -> tuple[Signal, int]:
    """Samples that are not there: steps between stamps of two or three times the median one."""
    if signal.time_s is None or signal.time_s.size < 3 or signal.time_s.shape != signal.values.shape[:1]:
        return signal, 0
    steps = np.diff(signal.time_s)
    median = float(np.median(steps))
    if not 0.0 < median < np.inf:
        return signal, 0
    parts = np.rint(steps / median)
    regular = is_like(steps / np.maximum(parts, 1.0), median, signal.time_s)
    gaps = (parts >= 2) & (parts <= QUALITY_LIMITS["gaps"]["maximum_samples"] + 1) & regular
    if not gaps.any():
        return signal, 0
    position = np.concatenate(([0.0], np.cumsum(np.where(gaps, parts, 1.0))))
    every = np.arange(position[-1] + 1)
    columns = [np.interp(every, position, column) for column in (signal.time_s, *signal.values.T)]
    filled = replace(signal, time_s=columns[0], values=np.stack(columns[1:], axis=1))
    return filled, int(every.size - position.size)
