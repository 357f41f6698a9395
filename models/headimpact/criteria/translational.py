"""Criteria of the linear acceleration of the head's centre of gravity: Laksari et al. 2020, supplementary section."""

from __future__ import annotations

import numpy as np

from headimpact.criteria.windows import FloatArray, IntArray, window_maxima
from headimpact.kinematics import HeadKinematics, accumulate
from headimpact.published import CRITERIA_CONSTANTS

HIC15_LIMIT_S = float(CRITERIA_CONSTANTS["windows"]["hic15_s"])
HIC36_LIMIT_S = float(CRITERIA_CONSTANTS["windows"]["hic36_s"])


def peak_linear_acceleration(kinematics: HeadKinematics) -> FloatArray:
    """Largest absolute linear acceleration along each axis [g]."""
    return kinematics.peak_linear_acceleration_components_g


def hic15_and_hic36(kinematics: HeadKinematics) -> list[tuple[FloatArray, IntArray, IntArray]]:
    """Head injury criterion (49 CFR 571.208) under limits of 15 and 36 ms, in one pass [g^2.5 s].

    Returns, for each limit, the value and its window as sample numbers (start, stop).
    """
    return window_maxima(
        kinematics.linear_acceleration_resultant_g, kinematics.sample_rate_hz, (HIC15_LIMIT_S, HIC36_LIMIT_S)
    )


def severity_index(kinematics: HeadKinematics) -> FloatArray:
    """Gadd severity index: integral of ||a||^2.5 by trapezoids [g^2.5 s]."""
    a2 = kinematics.linear_acceleration_squared
    power = a2 * np.sqrt(kinematics.linear_acceleration_resultant_g)
    # added in the order of time, so that one impact and a block of many give the same bits
    ends = 0.5 * (power[0] + power[-1])
    total: FloatArray = accumulate(power)[-1] - ends
    return total / kinematics.sample_rate_hz
