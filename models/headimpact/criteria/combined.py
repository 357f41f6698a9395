"""Criteria of linear and rotational motion together: Laksari et al. 2020, supplementary section.

Every function takes the motion of m impacts and returns m values, or 3 x m of them, one per axis.
"""

from __future__ import annotations

import numpy as np

from headimpact.brain import INERTIA_KG_M2
from headimpact.kinematics import FloatArray, Motion, running_integral
from headimpact.published import CRITERIA_CONSTANTS
from headimpact.recording import STANDARD_GRAVITY

HEAD_MASS_KG = float(CRITERIA_CONSTANTS["hip"]["head_mass_kg"])
CRITICAL_LINEAR_ACCELERATION_G = float(CRITERIA_CONSTANTS["gambit"]["critical_linear_acceleration_g"])
CRITICAL_ANGULAR_ACCELERATION = float(CRITERIA_CONSTANTS["gambit"]["critical_angular_acceleration_rad_s2"])
VTCP = CRITERIA_CONSTANTS["vtcp"]

# The masses and moments of inertia of head impact power, for acceleration in g and rad/s^2: 2 x 3 x 1.
_INERTIAS: FloatArray = np.stack((np.full(3, HEAD_MASS_KG * STANDARD_GRAVITY**2), INERTIA_KG_M2))[..., None]


def head_impact_power(motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Head impact power (Newman et al. 2000) and its largest value along each axis, HIP and HIP3D [W].

    m a_i V_i + I_i alpha_i W_i, with V and W the integrals of acceleration from the record's first sample.
    """
    both = motion.stack[:, motion.rows.accelerations]
    parts = running_integral(both, motion.sample_rate_hz)
    parts *= both
    parts *= _INERTIAS
    power = parts[:, 0] + parts[:, 1]
    total = power[:, 0] + power[:, 1]
    total += power[:, 2]
    return np.maximum.reduce(total, axis=0), np.maximum.reduce(power, axis=0)


def gambit(motion: Motion) -> FloatArray:
    """Generalised acceleration model for brain injury threshold (Newman 1986), n = m = s = 2 [-]."""
    terms = motion.squared[:, motion.rows.angular_acceleration] / CRITICAL_ANGULAR_ACCELERATION**2
    terms += motion.squared[:, motion.rows.linear_acceleration] / CRITICAL_LINEAR_ACCELERATION_G**2
    found: FloatArray = np.sqrt(np.maximum.reduce(terms, axis=0))
    return found


def vtcp(motion: Motion) -> FloatArray:
    """Virginia Tech combined probability (Rowson & Duma 2013) of the peak resultants [-]."""
    # Here, since who only needs the criteria's names, as readers of files do, does without SciPy's 25 MB.
    from scipy.special import expit

    a = motion.peaks[motion.rows.linear_acceleration]
    alpha = motion.peaks[motion.rows.angular_acceleration]
    linear_predictor = (
        VTCP["intercept"]
        + VTCP["linear_acceleration_per_g"] * a
        + VTCP["angular_acceleration_per_rad_s2"] * alpha
        + VTCP["product"] * a * alpha
    )
    probability: FloatArray = expit(linear_predictor)
    return probability
