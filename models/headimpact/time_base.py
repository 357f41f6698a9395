"""One time base for signals of different rates and starts: the samples of the fastest within the overlap of all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from headimpact.errors import TraceError
from headimpact.published import QUALITY_LIMITS
from headimpact.recording import FloatArray, SignalName

SLACK = 1e-3
"""Of a step: equal records do not lose a sample to rounding."""


@dataclass(frozen=True, slots=True)
class Track:
    """Uniform samples of a signal: `start_s` is the first one's time on the clock that the signals share.

    `stated`: whoever sent it says its rate; otherwise its stamps do, as exactly as they are written.
    """

    samples: int
    rate_hz: float
    start_s: float
    stated: bool = True


@dataclass(frozen=True, slots=True)
class Onto:
    """How samples become those of the base: interpolated linearly from `before` to the one after by `share`."""

    before: NDArray[np.intp]
    share: FloatArray


@dataclass(frozen=True, slots=True)
class TimeBase:
    """The samples that signals are brought to, and for each signal how: a slice of its own, or between them.

    `keeps_all`: every signal is there already, sample for sample, and has no others.
    """

    rate_hz: float
    start_s: float
    samples: int
    ways: Mapping[SignalName, slice | Onto]
    keeps_all: bool


def common_time_base(tracks: Mapping[SignalName, Track]) -> TimeBase:
    """The samples of the highest-rate signal within the overlap of all.

    Raises
    ------
    TraceError
        ``no-overlap``: the signals have fewer than 3 samples in common.
    """
    base = _fastest(tracks)
    start = max(track.start_s for track in tracks.values())
    stop = min(track.start_s + (track.samples - 1) / track.rate_hz for track in tracks.values())
    first = max(0, ceil((start - base.start_s) * base.rate_hz - SLACK))
    last = min(base.samples - 1, floor((stop - base.start_s) * base.rate_hz + SLACK))
    if last - first + 1 < QUALITY_LIMITS["record"]["minimum_samples"]:
        raise TraceError("no-overlap", "The signals must overlap in time by at least 3 samples.")
    ways = {name: _way(track, base, first, last) for name, track in tracks.items()}
    samples = last - first + 1
    keeps_all = all(way == slice(0, track.samples) for way, track in zip(ways.values(), tracks.values(), strict=True))
    return TimeBase(base.rate_hz, base.start_s + first / base.rate_hz, samples, ways, keeps_all)


def _fastest(tracks: Mapping[SignalName, Track]) -> Track:
    """The signal of the highest rate; of those of one rate the first, whatever their stamps' last digits make of it.

    Stated rates are what they are: of two that differ the higher one is the faster, however little it is.
    """
    highest = max(track.rate_hz for track in tracks.values())
    least = highest * (1.0 - QUALITY_LIMITS["record"]["same_rate"])
    near = [track for track in tracks.values() if track.rate_hz >= least]
    stated = max((track.rate_hz for track in near if track.stated), default=None)
    return next(track for track in near if not track.stated or track.rate_hz == stated)


def _way(track: Track, base: Track, first: int, last: int) -> slice | Onto:
    noise = 0.0 if track.stated and base.stated else 1e-9
    if abs(track.rate_hz - base.rate_hz) <= noise * base.rate_hz and track.start_s == base.start_s:
        return slice(first, last + 1)
    time_s = base.start_s + np.arange(first, last + 1) / base.rate_hz
    position = np.clip((time_s - track.start_s) * track.rate_hz, 0.0, track.samples - 1)
    before = np.minimum(position.astype(np.intp), track.samples - 2)
    return Onto(before, position - before)


def kept_of(way: slice | Onto) -> slice:
    """Which samples of a signal lie within the time of the base's."""
    if isinstance(way, slice):
        return way
    first = int(way.before[0]) + int(way.share[0] > SLACK)
    last = int(way.before[-1]) + int(way.share[-1] >= 1.0 - SLACK)
    return slice(first, last + 1)


def brought(values: FloatArray, way: slice | Onto) -> FloatArray:
    """Samples of a signal, time first, at those of the base."""
    if isinstance(way, slice):
        return values[way]
    low, high = values[way.before], values[way.before + 1]
    share = way.share.reshape(-1, *(1,) * (values.ndim - 1))
    found: FloatArray = (high - low) * share + low
    return found
