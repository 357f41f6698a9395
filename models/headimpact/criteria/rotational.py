"""Criteria of the head's rotation: Laksari et al. 2020, supplementary section "Injury criteria".

Every function takes the motion of m impacts and returns m values, or 3 x m of them, one per axis.
"""

from __future__ import annotations

import numpy as np

from headimpact.brain import brain_angles
from headimpact.kinematics import FloatArray, Motion
from headimpact.published import CRITERIA_CONSTANTS

CRITICAL_ANGULAR_VELOCITY: FloatArray = np.array(CRITERIA_CONSTANTS["bric"]["critical_angular_velocity_rad_s"])
RIC_LIMIT_S = float(CRITERIA_CONSTANTS["windows"]["ric_s"])
"""Longest window of the rotational injury criterion (Kimpara & Iwamoto 2012), HIC's form with ||alpha|| [s]."""


def peak_angular_acceleration(motion: Motion) -> FloatArray:
    """Largest absolute angular acceleration about each axis [rad/s^2]."""
    found: FloatArray = motion.magnitudes[motion.rows.angular_acceleration]
    return found


def peak_angular_velocity(motion: Motion) -> FloatArray:
    """Largest absolute angular velocity about each axis [rad/s]."""
    found: FloatArray = motion.magnitudes[motion.rows.angular_velocity]
    return found


def delta_angular_velocity(motion: Motion) -> FloatArray:
    """Largest minus smallest angular velocity about each axis [rad/s]."""
    lowest, highest = motion.extremes
    row = motion.rows.angular_velocity
    found: FloatArray = highest[row] - lowest[row]
    return found


def bric(motion: Motion, critical: FloatArray = CRITICAL_ANGULAR_VELOCITY) -> FloatArray:
    """Brain injury criterion (Takhounts et al. 2013): norm of the peaks over their critical values [-].

    Parameters
    ----------
    motion
        The head's motion; needs angular velocity.
    critical
        Critical angular velocities, x, y, z [rad/s]; the paper's unless given.
    """
    ratio = peak_angular_velocity(motion) / critical[:, None]
    ratio *= ratio
    found: FloatArray = np.sqrt(ratio[0] + ratio[1] + ratio[2])
    return found


def brain_angle(motion: Motion) -> FloatArray:
    """Brain angle at every sample [rad], n x 3 x m; BAM is its largest absolute value about each axis."""
    return brain_angles(motion.of("angular_acceleration"), motion.sample_rate_hz)
