"""Criteria of the head's rotation: Laksari et al. 2020, supplementary section "Injury criteria".

Every function takes kinematics of one impact (n x 3) or of a block (n x 3 x m) and returns one value (or m), or one per
axis (3 or 3 x m).
"""

from __future__ import annotations

import numpy as np

from headimpact.brain import brain_angle_history
from headimpact.criteria.windows import FloatArray, IntArray, window_maxima
from headimpact.kinematics import HeadKinematics
from headimpact.published import CRITERIA_CONSTANTS

CRITICAL_ANGULAR_VELOCITY: FloatArray = np.array(CRITERIA_CONSTANTS["bric"]["critical_angular_velocity_rad_s"])
RIC_LIMIT_S = float(CRITERIA_CONSTANTS["windows"]["ric_s"])


def peak_angular_acceleration(kinematics: HeadKinematics) -> FloatArray:
    """Largest absolute angular acceleration about each axis [rad/s^2]."""
    return kinematics.peak_angular_acceleration_components


def delta_angular_velocity(kinematics: HeadKinematics) -> FloatArray:
    """Largest minus smallest angular velocity about each axis [rad/s]."""
    lowest, highest = kinematics.angular_velocity_extremes
    return highest - lowest


def bric(kinematics: HeadKinematics, critical: FloatArray = CRITICAL_ANGULAR_VELOCITY) -> FloatArray:
    """Brain injury criterion (Takhounts et al. 2013): norm of the peaks over their critical values [-].

    Parameters
    ----------
    kinematics
        The head's motion; needs angular velocity.
    critical
        Critical angular velocities, x, y, z [rad/s]; the paper's unless given.
    """
    peak = kinematics.peak_angular_velocity_components
    ratio = peak / (critical if peak.ndim == 1 else critical[:, None])
    ratio *= ratio
    total: FloatArray = ratio[0] + ratio[1] + ratio[2]
    return np.sqrt(total)


def ric(kinematics: HeadKinematics) -> tuple[FloatArray, IntArray, IntArray]:
    """Rotational injury criterion (Kimpara & Iwamoto 2012): HIC's form with ||alpha||, 36 ms [(rad/s^2)^2.5 s].

    Returns the value and its window as sample numbers (start, stop).
    """
    (found,) = window_maxima(kinematics.angular_acceleration_resultant, kinematics.sample_rate_hz, (RIC_LIMIT_S,))
    return found


def brain_angle(kinematics: HeadKinematics) -> FloatArray:
    """Brain angle at every sample [rad]; BAM is its largest absolute value about each axis."""
    alpha = kinematics.angular_acceleration
    assert alpha is not None
    return brain_angle_history(alpha, kinematics.sample_rate_hz)
