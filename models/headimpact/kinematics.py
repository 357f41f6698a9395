"""The motion of the head's centre of gravity, and the operations that lead to it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from headimpact.published import UNITS

FloatArray = NDArray[np.float64]

STANDARD_GRAVITY = float(UNITS["standard_gravity_m_s2"])


@dataclass(frozen=True)
class HeadKinematics:
    """Motion of the head's centre of gravity in anatomical axes.

    Arrays have time first and axes (x, y, z) second: n x 3 for one impact, n x 3 x m for a block of m impacts of equal
    length and rate. (Impacts are last: what differs by axis then meets whole rows of equal work.) One impact is best
    laid out component by component (Fortran order): maxima and sums over time are then contiguous. x is
    anterior-posterior (rotation about it: coronal), y left-right (sagittal), z inferior-superior (axial).

    Parameters
    ----------
    sample_rate_hz
        Samples per second [Hz].
    linear_acceleration_g
        Acceleration [g], or None where none was recorded.
    angular_velocity
        Angular velocity [rad/s], or None where no rotation was recorded.
    angular_acceleration
        Angular acceleration [rad/s^2], or None likewise.
    start_time_ms
        Time of the first sample [ms], from the trigger where it is known, else from the record's start.
    """

    sample_rate_hz: float
    linear_acceleration_g: FloatArray | None
    angular_velocity: FloatArray | None
    angular_acceleration: FloatArray | None
    start_time_ms: float = 0.0

    @cached_property
    def samples(self) -> int:
        """Number of samples in time."""
        for array in (self.linear_acceleration_g, self.angular_velocity, self.angular_acceleration):
            if array is not None:
                return int(array.shape[0])
        return 0

    @cached_property
    def linear_acceleration_squared(self) -> FloatArray:
        """Squared norm of the linear acceleration [g^2]."""
        return squared_norm(_present(self.linear_acceleration_g, "linear_acceleration"))

    @cached_property
    def angular_acceleration_squared(self) -> FloatArray:
        """Squared norm of the angular acceleration [rad^2/s^4]."""
        return squared_norm(_present(self.angular_acceleration, "angular_acceleration"))

    @cached_property
    def linear_acceleration_resultant_g(self) -> FloatArray:
        """Norm of the linear acceleration [g]."""
        return np.sqrt(self.linear_acceleration_squared)

    @cached_property
    def angular_acceleration_resultant(self) -> FloatArray:
        """Norm of the angular acceleration [rad/s^2]."""
        return np.sqrt(self.angular_acceleration_squared)

    @cached_property
    def peak_linear_acceleration_components_g(self) -> FloatArray:
        """Largest absolute value of each component [g]."""
        return largest_magnitude(_present(self.linear_acceleration_g, "linear_acceleration"))

    @cached_property
    def angular_velocity_extremes(self) -> tuple[FloatArray, FloatArray]:
        """Smallest and largest value of each component [rad/s]."""
        w = _present(self.angular_velocity, "angular_velocity")
        return np.minimum.reduce(w, axis=0), largest(w)

    @cached_property
    def peak_angular_velocity_components(self) -> FloatArray:
        """Largest absolute value of each component [rad/s]."""
        lowest, highest = self.angular_velocity_extremes
        return np.abs(np.maximum(-lowest, highest))

    @cached_property
    def peak_angular_acceleration_components(self) -> FloatArray:
        """Largest absolute value of each component [rad/s^2]."""
        return largest_magnitude(_present(self.angular_acceleration, "angular_acceleration"))

    @cached_property
    def peak_linear_acceleration_g(self) -> FloatArray:
        """Largest norm of the linear acceleration [g]."""
        return np.sqrt(largest(self.linear_acceleration_squared))

    @cached_property
    def peak_angular_velocity(self) -> FloatArray:
        """Largest norm of the angular velocity [rad/s]."""
        return np.sqrt(largest(squared_norm(_present(self.angular_velocity, "angular_velocity"))))

    @cached_property
    def peak_angular_acceleration(self) -> FloatArray:
        """Largest norm of the angular acceleration [rad/s^2]."""
        return np.sqrt(largest(self.angular_acceleration_squared))

    def time_ms(self, sample: int) -> float:
        """Time of a sample [ms], from the trigger where it is known."""
        return self.start_time_ms + sample / self.sample_rate_hz * 1000.0


def _present(array: FloatArray | None, signal: str) -> FloatArray:
    if array is None:
        raise ValueError(f"these kinematics hold no {signal}")
    return array


def largest(x: FloatArray) -> FloatArray:
    """Maximum over time."""
    return np.maximum.reduce(x, axis=0)  # type: ignore[no-any-return] # NumPy's stubs give Any here


def squared_norm(x: FloatArray) -> FloatArray:
    """Squared Euclidean norm over the axes (x, y, z), the second dimension.

    Written component by component: the same operations in the same order for one impact and for a block of many, so
    that both give the same bits.
    """
    total = x[:, 0] * x[:, 0]
    total += x[:, 1] * x[:, 1]
    total += x[:, 2] * x[:, 2]
    return total


def largest_magnitude(x: FloatArray) -> FloatArray:
    """Maximum of the absolute value over time."""
    # the outer abs only takes the sign off a zero
    magnitude: FloatArray = np.abs(np.maximum(-np.minimum.reduce(x, axis=0), largest(x)))
    return magnitude


def by_axis(constants: FloatArray, x: FloatArray) -> FloatArray:
    """Three constants, one per axis, shaped to multiply values by axis: of one impact (3) or of a block (3 x m)."""
    return constants if x.ndim < 3 else constants[:, None]


def accumulate(x: FloatArray) -> FloatArray:
    """Cumulative sum over the first axis, in place.

    Whole rows are added where there is more than one impact: ``numpy.cumsum(axis=0)`` walks such an array column by
    column, thirteen times slower, to the same result.
    """
    if x[0].size < 16:
        return np.add.accumulate(x, axis=0, out=x)
    for k in range(1, x.shape[0]):
        np.add(x[k - 1], x[k], out=x[k])
    return x


def running_integral(x: FloatArray, sample_rate_hz: float) -> FloatArray:
    """Integral from the first sample to each sample, by trapezoids; zero at the first sample."""
    steps = np.empty_like(x)
    steps[0] = 0.0
    np.add(x[1:], x[:-1], out=steps[1:])
    steps *= 0.5 / sample_rate_hz
    return accumulate(steps)


def differentiate(x: FloatArray, sample_rate_hz: float) -> FloatArray:
    """Time derivative: five-point stencil inside, central and two-point differences at the two samples of each end.

    Parameters
    ----------
    x
        Samples, time on the first axis, at least 3 of them.
    sample_rate_hz
        Samples per second [Hz].
    """
    derivative = np.empty_like(x)
    derivative[0] = (x[1] - x[0]) * sample_rate_hz
    derivative[-1] = (x[-1] - x[-2]) * sample_rate_hz
    derivative[1] = (x[2] - x[0]) * (sample_rate_hz / 2)
    derivative[-2] = (x[-1] - x[-3]) * (sample_rate_hz / 2)
    if x.shape[0] >= 5:
        inner = derivative[2:-2]
        np.subtract(x[3:-1], x[1:-3], out=inner)
        inner *= 8.0
        inner -= x[4:]
        inner += x[:-4]
        inner *= sample_rate_hz / 12
    return derivative


def transfer_to_head_cg(
    linear_acceleration_g: FloatArray,
    angular_velocity: FloatArray,
    angular_acceleration: FloatArray,
    offset_m: FloatArray,
) -> FloatArray:
    """Acceleration of the head's centre of gravity [g] from that of a point fixed to the head.

    a_cg = a - alpha x r - w x (w x r), with r the point's position relative to the centre of gravity [m].
    """
    w = angular_velocity
    tangential = np.cross(angular_acceleration, offset_m)
    centripetal = np.cross(w, np.cross(w, offset_m))
    return linear_acceleration_g - (tangential + centripetal) / STANDARD_GRAVITY
