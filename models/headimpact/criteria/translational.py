"""Criteria of the linear acceleration of the head's centre of gravity: Laksari et al. 2020, supplementary section.

Every function takes the motion of m impacts and returns m values, or 3 x m of them, one per axis.
"""

from __future__ import annotations

import numpy as np

from headimpact.kinematics import FloatArray, Motion, accumulate
from headimpact.published import CRITERIA_CONSTANTS

HIC15_LIMIT_S = float(CRITERIA_CONSTANTS["windows"]["hic15_s"])
HIC36_LIMIT_S = float(CRITERIA_CONSTANTS["windows"]["hic36_s"])
"""Longest windows of the head injury criterion (49 CFR 571.208) [s]."""


def peak_linear_acceleration(motion: Motion) -> FloatArray:
    """Largest absolute linear acceleration along each axis [g]."""
    found: FloatArray = motion.magnitudes[motion.rows.linear_acceleration]
    return found


def severity_index(motion: Motion) -> FloatArray:
    """Gadd severity index: integral of ||a||^2.5 by trapezoids [g^2.5 s]."""
    row = motion.rows.linear_acceleration
    power = motion.squared[:, row] * np.sqrt(motion.resultants[:, row])
    # added in the order of time, so that one impact and a block of many give the same bits
    ends = 0.5 * (power[0] + power[-1])
    total: FloatArray = accumulate(power)[-1] - ends
    return total / motion.sample_rate_hz
