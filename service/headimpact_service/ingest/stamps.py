"""Time stamps: the rate they stand for, where they are uniform but for rounding."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from headimpact.stamps import rate_said, rounding_s

FloatArray = NDArray[np.float64]

UNIFORM_JITTER = 1e-6
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


def before_zero_ms(spans: Iterable[tuple[float, float]]) -> float | None:
    """How long before zero the record begins [ms], where its signals' stamps span zero: that is the trigger then."""
    starts, ends = zip(*spans, strict=True)
    return round(-min(starts), 9) if min(starts) < 0.0 <= max(ends) else None
