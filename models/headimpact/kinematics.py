"""The motion of the head's centre of gravity, and the operations that lead to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from headimpact.recording import SIGNALS, STANDARD_GRAVITY, SignalName

FloatArray = NDArray[np.float64]

# Rows shorter than this are added up by one call for the whole record, longer ones by one call for each sample.
SHORT_ROW = 64


@dataclass(frozen=True)
class Motion:
    """Motion of the heads of m impacts that have their length, rate and signals in common: what criteria are read from.

    Laid out samples x signals x axes x impacts. Of many impacts the rows are contiguous; of one impact each component
    is (:func:`empty_stack`), so that maxima and sums over time are. Every operation is the same for one impact as for
    a block, and so are the numbers, to the last bit.

    Parameters
    ----------
    sample_rate_hz
        Samples per second [Hz].
    signals
        Which signals there are, in the order of :data:`~headimpact.recording.SIGNALS`.
    stack
        Their samples, n x signals x 3 x m [g, rad/s, rad/s^2]; axes x, y, z.
    start_time_ms
        Time of the first sample [ms], from the trigger where it is known, else from the record's start.
    """

    sample_rate_hz: float
    signals: tuple[SignalName, ...]
    stack: FloatArray
    start_time_ms: float = 0.0

    @property
    def samples(self) -> int:
        """Number of samples in time, n."""
        return int(self.stack.shape[0])

    @property
    def impacts(self) -> int:
        """Number of impacts, m."""
        return int(self.stack.shape[3])

    @property
    def rows(self) -> Rows:
        """Which of the stack's rows holds what."""
        return _rows(self.signals)

    def of(self, signal: SignalName) -> FloatArray:
        """The samples of one signal, n x 3 x m."""
        if signal not in self.signals:
            raise ValueError(f"this motion holds no {signal}")
        values: FloatArray = self.stack[:, self.signals.index(signal)]
        return values

    @cached_property
    def extremes(self) -> tuple[FloatArray, FloatArray]:
        """Smallest and largest value of each component, signals x 3 x m."""
        return np.minimum.reduce(self.stack, axis=0), np.maximum.reduce(self.stack, axis=0)

    @cached_property
    def magnitudes(self) -> FloatArray:
        """Largest absolute value of each component, signals x 3 x m."""
        lowest, highest = self.extremes
        # the outer absolute value only takes the sign off a zero
        found: FloatArray = np.abs(np.maximum(-lowest, highest))
        return found

    @cached_property
    def squared(self) -> FloatArray:
        """Squared norm over the axes at every sample, n x signals x m."""
        return squared_norm(self.stack)

    @cached_property
    def resultants(self) -> FloatArray:
        """Norm over the axes at every sample, n x signals x m."""
        return np.sqrt(self.squared)

    @cached_property
    def peaks(self) -> FloatArray:
        """Largest norm over the record, signals x m."""
        found: FloatArray = np.sqrt(np.maximum.reduce(self.squared, axis=0))
        return found

    def time_ms(self, sample: int) -> float:
        """Time of a sample [ms], from the trigger where it is known."""
        return self.start_time_ms + sample / self.sample_rate_hz * 1000.0

    def impact(self, number: int) -> HeadKinematics:
        """One of the impacts, by its place in the block."""
        arrays = {name: self.stack[:, row, :, number] for row, name in enumerate(self.signals)}
        return HeadKinematics(
            self.sample_rate_hz,
            arrays.get("linear_acceleration"),
            arrays.get("angular_velocity"),
            arrays.get("angular_acceleration"),
            self.start_time_ms,
        )


class Rows(NamedTuple):
    """Where each signal stands in a motion's stack, -1 for one that is not there, and where the accelerations do."""

    linear_acceleration: int
    angular_velocity: int
    angular_acceleration: int
    accelerations: slice


@lru_cache(maxsize=8)
def _rows(signals: tuple[SignalName, ...]) -> Rows:
    a, w, alpha = (signals.index(name) if name in signals else -1 for name in SIGNALS)
    accelerations = [row for row in (a, alpha) if row >= 0] or [0]
    first, last = accelerations[0], accelerations[-1]
    return Rows(a, w, alpha, slice(first, last + 1, last - first or 1))


def empty_stack(samples: int, signals: int, impacts: int) -> FloatArray:
    """Room for a motion's samples in the layout that :class:`Motion` names; not yet filled."""
    if impacts == 1:
        return np.empty((signals, 3, samples)).transpose(2, 0, 1)[..., None]
    return np.empty((samples, signals, 3, impacts))


@dataclass(frozen=True)
class HeadKinematics:
    """Motion of the head's centre of gravity in one impact, in anatomical axes.

    Arrays have time first and axes (x, y, z) second, n x 3. x is anterior-posterior (rotation about it: coronal), y
    left-right (sagittal), z inferior-superior (axial).

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
    def motion(self) -> Motion:
        """The same as a block of one impact."""
        sent = zip(SIGNALS, (self.linear_acceleration_g, self.angular_velocity, self.angular_acceleration), strict=True)
        present = {name: array for name, array in sent if array is not None}
        samples = next((array.shape[0] for array in present.values()), 0)
        stack = empty_stack(samples, len(present), 1)
        for row, array in enumerate(present.values()):
            stack[:, row, :, 0] = array
        return Motion(self.sample_rate_hz, tuple(present), stack, self.start_time_ms)

    @property
    def samples(self) -> int:
        """Number of samples in time."""
        return self.motion.samples

    def time_ms(self, sample: int) -> float:
        """Time of a sample [ms], from the trigger where it is known."""
        return self.motion.time_ms(sample)


def squared_norm(x: FloatArray) -> FloatArray:
    """Squared Euclidean norm over the axes (x, y, z), the second-last dimension.

    Written component by component: the same operations in the same order for one impact and for a block of many.
    """
    return summed_over_axes(x * x)


def summed_over_axes(x: FloatArray) -> FloatArray:
    """x + y + z, of the second-last dimension, always in this order."""
    total: FloatArray = x[..., 0, :] + x[..., 1, :]
    total += x[..., 2, :]
    return total


def accumulate(x: FloatArray) -> FloatArray:
    """Cumulative sum over the first axis, in place.

    Whole rows are added where there are many impacts: ``numpy.add.accumulate`` walks such an array column by column,
    thirteen times slower, to the same result.
    """
    if x[0].size < SHORT_ROW:
        return np.add.accumulate(x, axis=0, out=x)
    for before, now in pairwise(x):
        np.add(before, now, out=now)
    return x


def running_integral(x: FloatArray, sample_rate_hz: float) -> FloatArray:
    """Integral over time, the first axis, from the first sample to each sample, by trapezoids."""
    steps = np.empty_like(x)
    steps[0] = 0.0
    np.add(x[1:], x[:-1], out=steps[1:])
    steps *= 0.5 / sample_rate_hz
    return accumulate(steps)


def differentiate(x: FloatArray, sample_rate_hz: float, out: FloatArray | None = None) -> FloatArray:
    """Time derivative: five-point stencil inside, central and two-point differences at the two samples of each end.

    Parameters
    ----------
    x
        Samples, time on the first axis, at least 3 of them.
    sample_rate_hz
        Samples per second [Hz].
    out
        Where to write it; a new array unless given.
    """
    derivative = np.empty_like(x) if out is None else out
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

    Parameters
    ----------
    linear_acceleration_g, angular_velocity, angular_acceleration
        n x 3 x m.
    offset_m
        r [m].
    """
    w, r = angular_velocity, offset_m.tolist()
    tangential = _cross(_components(angular_acceleration), r)
    centripetal = _cross(_components(w), _cross(_components(w), r))
    moved = np.stack([t + c for t, c in zip(tangential, centripetal, strict=True)], axis=1)
    return linear_acceleration_g - moved / STANDARD_GRAVITY


def _components(x: FloatArray) -> list[FloatArray]:
    return [x[:, axis] for axis in range(3)]


def _cross(a: Sequence[FloatArray], b: Sequence[FloatArray | float]) -> list[FloatArray]:
    """Vector product, by components."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def rotated(x: FloatArray, rotation: FloatArray) -> FloatArray:
    """Samples n x 3 x m turned by a rotation matrix, sum by sum: the bits of a matrix product depend on its size."""
    a, b, c = _components(x)
    return np.stack([r[0] * a + r[1] * b + r[2] * c for r in rotation.tolist()], axis=1)
