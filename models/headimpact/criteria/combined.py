"""Criteria of linear and rotational motion together: Laksari et al. 2020, supplementary section."""

from __future__ import annotations

import numpy as np

from headimpact.brain import INERTIA_KG_M2
from headimpact.criteria.windows import FloatArray
from headimpact.kinematics import STANDARD_GRAVITY, HeadKinematics, by_axis, largest, running_integral
from headimpact.published import CRITERIA_CONSTANTS

HEAD_MASS_KG = float(CRITERIA_CONSTANTS["hip"]["head_mass_kg"])
CRITICAL_LINEAR_ACCELERATION_G = float(CRITERIA_CONSTANTS["gambit"]["critical_linear_acceleration_g"])
CRITICAL_ANGULAR_ACCELERATION = float(CRITERIA_CONSTANTS["gambit"]["critical_angular_acceleration_rad_s2"])
VTCP = CRITERIA_CONSTANTS["vtcp"]


def head_impact_power(kinematics: HeadKinematics) -> tuple[FloatArray, FloatArray]:
    """Head impact power (Newman et al. 2000) and its largest value along each axis, HIP and HIP3D [W].

    m a_i V_i + I_i alpha_i W_i, with V and W the integrals of acceleration from the record's first sample.
    """
    a_g, alpha = kinematics.linear_acceleration_g, kinematics.angular_acceleration
    assert a_g is not None
    assert alpha is not None
    power = running_integral(a_g, kinematics.sample_rate_hz)
    power *= a_g
    power *= HEAD_MASS_KG * STANDARD_GRAVITY**2
    rotational = running_integral(alpha, kinematics.sample_rate_hz)
    rotational *= alpha
    rotational *= by_axis(INERTIA_KG_M2, rotational)
    power += rotational
    total = power[:, 0] + power[:, 1]
    total += power[:, 2]
    return largest(total), largest(power)


def gambit(kinematics: HeadKinematics) -> FloatArray:
    """Generalised acceleration model for brain injury threshold (Newman 1986), n = m = s = 2 [-]."""
    terms = kinematics.angular_acceleration_squared / CRITICAL_ANGULAR_ACCELERATION**2
    terms += kinematics.linear_acceleration_squared / CRITICAL_LINEAR_ACCELERATION_G**2
    return np.sqrt(largest(terms))


def vtcp(kinematics: HeadKinematics) -> FloatArray:
    """Virginia Tech combined probability (Rowson & Duma 2013) of the peak resultants [-]."""
    a, alpha = kinematics.peak_linear_acceleration_g, kinematics.peak_angular_acceleration
    linear_predictor = (
        VTCP["intercept"]
        + VTCP["linear_acceleration_per_g"] * a
        + VTCP["angular_acceleration_per_rad_s2"] * alpha
        + VTCP["product"] * a * alpha
    )
    # the product term can carry the exponent past floating point's range, where the probability is 0
    with np.errstate(over="ignore"):
        probability: FloatArray = 1.0 / (1.0 + np.exp(-linear_predictor))
    return probability
