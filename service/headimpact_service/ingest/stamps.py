"""Time stamps: the rate they stand for, where they are uniform but for rounding."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

UNIFORM_JITTER = 1e-6
"""Of the step: stamps that stray less from a straight line are rounded, not jittered."""

ROUND_RATE = 1e-9
"""Relative: a rate this near to a whole number of hertz is that number, which its decimal stamps could not say."""


def nominal_rate(stamps_s: FloatArray) -> float | None:
    """The rate [Hz] of stamps [s] that are uniform to rounding; None where they are jittered or run backwards.

    Stamps that are uniform say a rate, and a stated rate is what filters are designed from: 0.0003125 s steps mean
    3200 Hz, not the 3200.0000000000005 Hz that the last stamp divided by its index gives.
    """
    count = stamps_s.shape[0]
    if count < 2:
        return None
    span = float(stamps_s[-1] - stamps_s[0])
    if not 0.0 < span < np.inf:
        return None
    step = span / (count - 1)
    strays = np.abs(stamps_s - (stamps_s[0] + step * np.arange(count)))
    if not float(strays.max()) <= UNIFORM_JITTER * step:
        return None
    return _rounded((count - 1) / span)


def _rounded(rate: float) -> float:
    if not rate < 1e15:
        return rate
    whole = float(round(rate))
    return whole if abs(rate - whole) <= ROUND_RATE * rate else rate


def before_zero_ms(spans: Iterable[tuple[float, float]]) -> float | None:
    """How long before zero the record begins [ms], where its signals' stamps span zero: that is the trigger then."""
    starts, ends = zip(*spans, strict=True)
    return round(-min(starts), 9) if min(starts) < 0.0 <= max(ends) else None
