"""Time stamps as numbers: how exact they can be, and the rate that they say."""

from __future__ import annotations

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from headimpact.published import QUALITY_LIMITS

FloatArray = NDArray[np.float64]

ROUND_RATE = 1e-9
"""Relative: a rate this near to a whole number of hertz is that number, which its decimal stamps could not say."""

_DECIMALS_S = (1e-3, 1e-4, 1e-5, 1e-6)
"""What stamps are written to [s], where that is coarse beside a step."""


def rounding_s(time_s: FloatArray) -> float:
    """How far a step between stamps may be off [s] because of the digits that a number holds.

    Stamps of a clock that counts from 1970 are exact to a quarter of a microsecond: a step of 1 ms to 0.05 %.
    """
    return float(2.0 * np.spacing(max(abs(float(time_s[0])), abs(float(time_s[-1])))))


def is_like(steps: FloatArray, median: float, time_s: FloatArray) -> NDArray[np.bool_]:
    """Which steps are within the greatest jitter of the median one, the rounding of their stamps aside."""
    rounding = rounding_s(time_s)
    bound = QUALITY_LIMITS["record"]["maximum_jitter"] * median + (rounding if isfinite(rounding) else 0.0)
    return np.asarray(np.abs(steps - median) <= bound)


def rate_said(time_s: FloatArray) -> float:
    """Samples per second from the first stamp to the last [Hz]: a whole number where it may be one.

    A stated rate is what filters are designed from: 0.0003125 s steps mean 3200 Hz, not the 3200.0000000000005 Hz that
    the last stamp divided by its index gives.
    """
    span = float(time_s[-1] - time_s[0])
    rate = float((time_s.size - 1) / span)
    if not rate < 1e15:
        return rate
    whole = float(round(rate))
    return whole if abs(rate - whole) <= max(ROUND_RATE, rounding_s(time_s) / span) * rate else rate


def may_be_rounded(time_s: FloatArray) -> bool:
    """Whether stamps may be those of equal steps, written in so few digits that their steps differ.

    All are multiples of one decimal, by which neither a step is off their mean nor a stamp off the line through the
    first and the last.
    """
    decimal = next((of for of in _DECIMALS_S if _are_multiples(time_s, of)), None)
    if decimal is None or not time_s[0] < time_s[-1]:
        return False
    even = np.linspace(time_s[0], time_s[-1], time_s.size)
    strays = np.concatenate((time_s - even, np.diff(time_s - even)))
    return bool((np.abs(strays) < decimal).all())


def _are_multiples(time_s: FloatArray, decimal_s: float) -> bool:
    with np.errstate(invalid="ignore"):  # stamps may run to infinity
        parts = time_s / decimal_s
        return bool((np.abs(parts - np.rint(parts)) <= 1e-6 + 4.0 * np.spacing(np.abs(parts))).all())
