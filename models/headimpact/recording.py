"""A recording as a device sent it: signals in their own units, rates and frames.

Nothing here is converted, filtered or rotated: that is :mod:`headimpact.preparation`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from headimpact.cut_offs import PAPER, LowPass
from headimpact.errors import TraceError
from headimpact.published import QUALITY_LIMITS, UNITS

FloatArray = NDArray[np.float64]
SignalName = Literal["linear_acceleration", "angular_velocity", "angular_acceleration"]
AxesName = Literal["anatomical", "sae_j211"]
PlaneName = Literal["sagittal", "coronal", "axial"]

AXES = ("x", "y", "z")
SIGNALS: tuple[SignalName, ...] = ("linear_acceleration", "angular_velocity", "angular_acceleration")

STANDARD_GRAVITY = float(UNITS["standard_gravity_m_s2"])
TO_CRITERIA_UNIT: dict[str, float] = {
    "g": 1.0,
    "m/s^2": 1.0 / STANDARD_GRAVITY,
    "rad/s": 1.0,
    "deg/s": radians(1.0),
    "rad/s^2": 1.0,
    "deg/s^2": radians(1.0),
}
"""What a unit of a signal is in the criteria's: g, rad/s and rad/s^2."""
UNITS_OF: dict[str, tuple[str, str]] = {
    "linear_acceleration": ("g", "m/s^2"),
    "angular_velocity": ("rad/s", "deg/s"),
    "angular_acceleration": ("rad/s^2", "deg/s^2"),
}
"""The units that each signal may be in, the criteria's first."""

ROTATION_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True)
class Signal:
    """One three-axis signal.

    Parameters
    ----------
    values
        Samples, n x 3, columns x, y, z, in `unit`.
    unit
        ``"g"`` or ``"m/s^2"``; ``"rad/s"`` or ``"deg/s"``; ``"rad/s^2"`` or ``"deg/s^2"``.
    sample_rate_hz
        Samples per second [Hz], where the signal is sampled uniformly.
    time_s
        One stamp per sample [s], where it is not known to be. Exactly one of the two is given.
    declared_range
        The sensor's full scale in `unit`, if its maker states one.
    """

    values: FloatArray
    unit: str
    sample_rate_hz: float | None = None
    time_s: FloatArray | None = None
    declared_range: float | None = None


@dataclass(frozen=True, slots=True)
class Mounting:
    """How a device sits on the head.

    Parameters
    ----------
    accelerometer_rotation, gyroscope_rotation
        Rotation matrices (3 x 3) that take sensor axes to anatomical head axes.
    offset_m
        The accelerometer's position relative to the head's centre of gravity, in anatomical head axes [m].
    accelerometer_delay_s, gyroscope_delay_s
        How much later than the motion each sensor's samples are stamped [s].

    Raises
    ------
    TraceError
        ``improper-rotation``, where a matrix is not orthonormal with determinant +1 within 1e-3;
        ``improper-offset``, where the offset is no number, or one of more than 1 m.
    """

    accelerometer_rotation: FloatArray
    gyroscope_rotation: FloatArray
    offset_m: FloatArray
    accelerometer_delay_s: float = 0.0
    gyroscope_delay_s: float = 0.0

    def __post_init__(self) -> None:
        for sensor, rotation in (
            ("accelerometer", self.accelerometer_rotation),
            ("gyroscope", self.gyroscope_rotation),
        ):
            require_proper_rotation(rotation, sensor)
        bound = QUALITY_LIMITS["mounting"]["maximum_offset_m"]
        if not (np.abs(self.offset_m) <= bound).all():
            raise TraceError("improper-offset", f"The accelerometer's offset must be three lengths within {bound:g} m.")


@dataclass(frozen=True, slots=True)
class Recording:
    """One head impact as recorded: what is needed to compute the motion of the head's centre of gravity.

    Parameters
    ----------
    linear_acceleration, angular_velocity, angular_acceleration
        The signals; at least one is given.
    axes
        The frame the signals are in: ``"anatomical"`` (x forward, y left, z up) or ``"sae_j211"`` (x forward, y right,
        z down). With a mounting, the convention of the sensor's own axes: they are mapped first, then rotated.
    mounting
        None where the signals already are those of the head's centre of gravity, in head axes.
    constrained_plane
        The plane the motion was constrained to: the motion outside it is zero (the paper's planar data).
    low_pass
        The zero-phase low-pass filters to apply.
    pre_trigger_ms
        Time from the record's first sample to the trigger [ms]; None where the trigger is not known.
    fill_gaps
        Whether gaps of at most 2 samples are filled; otherwise a missing sample is refused.
    """

    linear_acceleration: Signal | None = None
    angular_velocity: Signal | None = None
    angular_acceleration: Signal | None = None
    axes: AxesName = "anatomical"
    mounting: Mounting | None = None
    constrained_plane: PlaneName | None = None
    low_pass: LowPass = PAPER
    pre_trigger_ms: float | None = None
    fill_gaps: bool = False

    def signals(self) -> list[tuple[SignalName, Signal]]:
        """The signals that are there, each with its name."""
        present = (
            ("linear_acceleration", self.linear_acceleration),
            ("angular_velocity", self.angular_velocity),
            ("angular_acceleration", self.angular_acceleration),
        )
        return [(name, signal) for name, signal in present if signal is not None]  # type: ignore[misc] # literals widen


def require_proper_rotation(rotation: FloatArray, sensor: str) -> None:
    """Refuse a matrix that is not a rotation: a mirrored axis map would swap left and right in silence."""
    matrix = np.asarray(rotation, dtype=np.float64)
    orthonormal = bool(np.all(np.abs(matrix @ matrix.T - np.eye(3)) <= ROTATION_TOLERANCE))
    if not orthonormal:
        raise TraceError(
            "improper-rotation", f"The {sensor}'s rotation must be orthonormal within {ROTATION_TOLERANCE:g}."
        )
    if abs(float(np.linalg.det(matrix)) - 1.0) > ROTATION_TOLERANCE:
        raise TraceError(
            "improper-rotation",
            f"The {sensor}'s rotation must have determinant +1 within {ROTATION_TOLERANCE:g}: "
            "a determinant of -1 mirrors an axis, which no mounting does.",
        )
