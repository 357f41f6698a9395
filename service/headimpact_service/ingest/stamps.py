"""Time stamps: the rate they stand for, where they are uniform but for rounding."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from headimpact.published import QUALITY_LIMITS
from headimpact.stamps import rate_said, rounding_s
from headimpact_service.ingest.filling import MOST

FloatArray = NDArray[np.float64]

ROUNDED_TO_MS = (1.0, 0.1, 0.01)
"""What stamps are written to."""
NEAR, DRIFT = 0.6, 0.005
"""How far a stamp may be from where a stated rate has its sample: in samples, and by what went by since the first."""
SURE = 4.0
"""Standard errors of a rate that stamps say."""
SAME_RATE: float = QUALITY_LIMITS["record"]["same_rate"]
"""Relative: rates that stamps say and that differ less are one rate."""
UNIFORM_JITTER: float = QUALITY_LIMITS["record"]["uniform_jitter"]
"""Of the step: stamps that stray less from a straight line are rounded, not jittered."""


def nominal_rate(stamps_s: FloatArray) -> float | None:
    """The rate [Hz] of stamps [s] that are uniform to rounding; None where they are jittered or run backwards."""
    count = stamps_s.shape[0]
    if count < 2:
        return None
    span = float(stamps_s[-1] - stamps_s[0])
    if not 0.0 < span < np.inf:
        return None
    step = span / (count - 1)
    strays = np.abs(stamps_s - (stamps_s[0] + step * np.arange(count)))
    if not float(strays.max()) <= UNIFORM_JITTER * step + rounding_s(stamps_s):
        return None
    return rate_said(stamps_s)


def may_be_stated(rates: Iterable[float | None]) -> bool:
    """Whether rates that the stamps of one record say may stand for them: not if they are one rate, written as several.

    A stated rate is taken as it is, so that of two the higher one would have all signals brought to its samples.
    """
    said = sorted(rate for rate in rates if rate is not None)
    return all(lower == higher or lower < higher * (1.0 - SAME_RATE) for lower, higher in pairwise(said))


def before_zero_ms(spans: Iterable[tuple[float, float]]) -> float | None:
    """How long before zero the record begins [ms], where its signals' stamps span zero: that is the trigger then."""
    starts, ends = zip(*spans, strict=True)
    return round(-min(starts), 9) if min(starts) < 0.0 <= max(ends) else None


def follows(stamps_ms: FloatArray, rate_hz: float, *, drift: float = DRIFT) -> bool:
    """Whether stamps [ms] go on at a rate, one by one and as a whole, as far as they are rounded and clocks drift."""
    if not stamps_ms.size:
        return True
    step = 1000.0 / rate_hz
    elapsed = np.arange(stamps_ms.size) * step
    near = NEAR * step + _rounding(stamps_ms, step)
    stray = np.abs(stamps_ms - stamps_ms[0] - elapsed)
    uneven = np.abs(np.diff(stamps_ms) - step)  # by a sample that is left out, wherever it is
    is_near = bool((stray <= near + drift * elapsed).all() and (uneven <= near + drift * step).all())
    return is_near and _steps_by(stamps_ms, step, drift)


def with_gaps(stamps_ms: FloatArray, rate_hz: float) -> FloatArray | None:
    """The times [ms] that samples of a rate have whose stamps are rounded and leave some out; None if they are not."""
    if stamps_ms.size < 2 or not np.isfinite(stamps_ms).all():
        return None
    step = 1000.0 / rate_hz
    places = np.rint((stamps_ms - stamps_ms[0]) / step)
    steps = np.diff(places)
    if not ((steps >= 1.0) & (steps <= 1.0 + MOST)).all():
        return None
    filled = np.interp(np.arange(places[-1] + 1.0), places, stamps_ms)
    return stamps_ms[0] + places * step if follows(filled, rate_hz) else None


def _rounding(stamps_ms: FloatArray, step_ms: float) -> float:
    """How far rounding may take a stamp from its place beside another: steps of whole digits are not rounded."""
    grid = rounded_to(stamps_ms)
    return 0.0 if grid and _are_multiples(np.array([step_ms]), grid) else grid


def _steps_by(stamps_ms: FloatArray, step_ms: float, drift: float) -> bool:
    """Whether the line through stamps is as steep as a step; rounding and jitter leave it less sure."""
    count = stamps_ms.size
    if count < 3:
        return True
    places = np.arange(count) - 0.5 * (count - 1)
    spread = float((places**2).sum())
    slope = float((places * stamps_ms).sum() / spread)
    strays = stamps_ms - stamps_ms.mean() - slope * places
    error = float(np.sqrt((strays**2).sum() / (count - 2) / spread))
    return abs(slope - step_ms) <= drift * step_ms + SURE * error


def agree(first_ms: FloatArray, second_ms: FloatArray) -> bool:
    """Whether two columns of stamps [ms] say the same times, as far as they are rounded; none there says nothing."""
    there = np.isfinite(first_ms) & np.isfinite(second_ms)
    one, two = first_ms[there], second_ms[there]
    if one.size < 2:
        return True
    step = min(abs(float(np.median(np.diff(stamps)))) for stamps in (one, two))
    return bool((np.abs(one - two) <= NEAR * step + max(rounded_to(one), rounded_to(two))).all())


def go_on_alike(first_ms: FloatArray, second_ms: FloatArray) -> bool:
    """Whether two columns of stamps [ms] have the same steps, whatever they count from."""
    there = np.isfinite(first_ms) & np.isfinite(second_ms)
    one, two = first_ms[there], second_ms[there]
    return agree(one - one[:1], two - two[:1])


def rounded_to(stamps_ms: FloatArray) -> float:
    """What all stamps are multiples of, of what they may be written to; zero for anything finer."""
    return next((grid for grid in ROUNDED_TO_MS if _are_multiples(stamps_ms, grid)), 0.0)


def _are_multiples(values: FloatArray, grid: float) -> bool:
    parts = values / grid
    return bool((np.abs(parts - np.rint(parts)) < 1e-6).all())
