"""The brain model: three independent spring-damper oscillators on a moving base, solved exactly.

For each axis, phi = angle of the brain relative to the skull obeys (Laksari et al. 2020, Table 2)

    phi'' + 2 L phi' + wn^2 phi = -alpha(t),    phi(0) = phi'(0) = 0,    wn^2 = (2 pi fd)^2 + L^2,

with alpha the skull's angular acceleration, L the decay rate and fd the damped frequency. This is the
response-spectrum problem of earthquake engineering; for alpha linear between samples it has an exact recursion
(Nigam & Jennings 1969).

With s = -L + i wd, the response is phi = Im z, z' = s z - alpha / wd: one complex first-order recursion, better
conditioned than the real second-order one. Between two samples z is multiplied by exp(s dt); multiplying through by
exp(-s t) turns the recursion into a running sum, which is one pass over the record for all axes and impacts at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import factorial, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from headimpact.kinematics import accumulate, summed_over_axes
from headimpact.published import BRAIN_MODEL

FloatArray = NDArray[np.float64]

# The running sum holds exp(+L t): a record is cut where that factor reaches exp(16), long before digits are lost.
LARGEST_EXPONENT = 16.0
TAYLOR_TERMS = 20
# Samples of one axis that are solved at once, those of 1000 short impacts: NumPy's cost per call is spread over all of
# them, and what is held stays below ten megabytes.
BLOCK_SAMPLES = 102_400


@dataclass(frozen=True, slots=True)
class Oscillators:
    """Three damped oscillators: decay rates L [1/s] and damped angular frequencies wd [rad/s]."""

    decay_rate: tuple[float, float, float]
    damped_frequency: tuple[float, float, float]

    @property
    def natural_frequency_squared(self) -> FloatArray:
        """wn^2 [rad^2/s^2]."""
        return np.square(self.damped_frequency) + np.square(self.decay_rate)


BRAIN = Oscillators(
    decay_rate=tuple(BRAIN_MODEL["decay_rate_per_s"]),
    damped_frequency=tuple(2 * pi * f for f in BRAIN_MODEL["damped_frequency_hz"]),
)
INERTIA_KG_M2: FloatArray = np.array(BRAIN_MODEL["inertia_kg_m2"])


def brain_angle_history(
    angular_acceleration: FloatArray, sample_rate_hz: float, oscillators: Oscillators = BRAIN
) -> FloatArray:
    """Angle of the brain relative to the skull at every sample [rad].

    Exact for angular acceleration that is linear between samples, at rest at the first sample.

    Parameters
    ----------
    angular_acceleration
        Angular acceleration of the skull [rad/s^2], n x 3, or n x 3 x m of m impacts.
    sample_rate_hz
        Samples per second [Hz].
    oscillators
        The three oscillators; Table 2's unless given.

    Returns
    -------
    ndarray
        Brain angles [rad], of the shape of the input.
    """
    alpha = np.atleast_3d(angular_acceleration)
    return brain_angles(alpha, sample_rate_hz, oscillators).reshape(angular_acceleration.shape)


def peak_brain_angles(
    angular_acceleration: FloatArray, sample_rate_hz: float, oscillators: Oscillators = BRAIN
) -> tuple[FloatArray, FloatArray]:
    """Largest absolute brain angle of each axis and of the resultant, read at the samples [rad].

    Parameters
    ----------
    angular_acceleration
        Angular acceleration of the skull [rad/s^2], n x 3, or n x 3 x m of m impacts.
    sample_rate_hz
        Samples per second [Hz].
    oscillators
        The three oscillators; Table 2's unless given.

    Returns
    -------
    tuple of ndarray
        Peaks per axis (3 or 3 x m) and of the resultant (scalar or m).
    """
    alpha = np.atleast_3d(angular_acceleration)
    components, resultants = np.empty((3, alpha.shape[2])), np.empty(alpha.shape[2])
    size = max(1, BLOCK_SAMPLES // alpha.shape[0])
    for first in range(0, alpha.shape[2], size):
        block = slice(first, first + size)
        angle = brain_angles(np.ascontiguousarray(alpha[..., block]), sample_rate_hz, oscillators)
        components[:, block], resultants[block] = peaks_of(angle)
    one = angular_acceleration.ndim == 2
    return (components[:, 0], resultants[0]) if one else (components, resultants)


def peaks_of(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Largest absolute angle of each axis (3 x m) and of the resultant (m), of brain angles n x 3 x m [rad]."""
    squares = np.square(angle)
    components: FloatArray = np.sqrt(np.maximum.reduce(squares, axis=0))  # the root of a square is exact
    return components, np.sqrt(np.maximum.reduce(summed_over_axes(squares), axis=0))


def brain_angles(alpha: FloatArray, sample_rate_hz: float, oscillators: Oscillators = BRAIN) -> FloatArray:
    """The same as :func:`brain_angle_history`, of m impacts: n x 3 x m."""
    angle = np.empty_like(alpha)
    angle[0] = 0.0
    steps = alpha.shape[0] - 1
    segment = _segment_length(oscillators, sample_rate_hz)
    state: FloatArray | None = None
    for start in range(0, steps, segment):
        stop = min(start + segment, steps)
        tables = _tables(oscillators, sample_rate_hz, stop - start, by_rows=alpha.shape[2] > 1)
        last = _advance(alpha[start : stop + 1], angle[start : stop + 1], state, tables)
        if stop < steps:
            state = _state_at_end(last, alpha[stop], tables, angle[stop])
    return angle


def _segment_length(oscillators: Oscillators, sample_rate_hz: float) -> int:
    return max(1, int(LARGEST_EXPONENT / max(oscillators.decay_rate) * sample_rate_hz))


def _advance(alpha: FloatArray, angle: FloatArray, state: FloatArray | None, tables: _Tables) -> FloatArray:
    """Fill `angle` over one segment, from `state`, (Re z, Im z) at its first sample, None at rest.

    With weights g_j and u_k = sum over j < k of g_j alpha_j, the state is z_k = exp(s t_k) u_k + c1 alpha_k, and the
    angle its imaginary part. Returns (Re u, Im u) at the last sample, 2 x 3 x m.
    """
    u = tables.weight * alpha[:-1, None]
    if state is not None:
        u[0] += state
    accumulate(u)
    last: FloatArray = u[-1].copy()
    u *= tables.turn
    now = np.multiply(alpha[1:], tables.c1_im, out=angle[1:])
    now += u[:, 0]
    now += u[:, 1]
    return last


def _state_at_end(u: FloatArray, alpha: FloatArray, tables: _Tables, angle: FloatArray) -> FloatArray:
    """(Re z, Im z) at a segment's last sample, where the next one starts, 2 x 3 x m."""
    back_im, back_re = tables.turn[-1]
    return np.stack((u[0] * back_re - u[1] * back_im + tables.c1_re * alpha, angle))


class _Tables(NamedTuple):
    """What one segment needs, steps x 2 x 3 x 1: the last axis is for the impacts.

    `weight`, the real and imaginary parts of g_j = exp(-s t_j) (c1 + c0 exp(-s dt)), the first without its share of c1,
    since there the state is given; `turn`, the imaginary and real parts of exp(s t_k) for the steps k = 1, 2, ...; c1's
    parts, 3 x 1.
    """

    weight: FloatArray
    turn: FloatArray
    c1_re: FloatArray
    c1_im: FloatArray


@lru_cache(maxsize=64)
def _tables(oscillators: Oscillators, sample_rate_hz: float, steps: int, *, by_rows: bool) -> _Tables:
    """First-order-hold weights, laid out as the impacts that they meet are: many by rows, one by components.

    z_k = exp(s dt) z_(k-1) + c0 alpha_(k-1) + c1 alpha_k with, for X = s dt,
    c1 = -(dt/wd) phi2(X), c0 = -(dt/wd) (phi1(X) - phi2(X)), phi1 = (exp(X) - 1)/X, phi2 = (exp(X) - 1 - X)/X^2,
    both taken from their series: the closed forms lose digits where X is small.
    """
    dt = 1.0 / sample_rate_hz
    wd = np.array(oscillators.damped_frequency)
    s = -np.array(oscillators.decay_rate) + 1j * wd
    phi1 = sum((s * dt) ** j / factorial(j + 1) for j in range(TAYLOR_TERMS))
    phi2 = sum((s * dt) ** j / factorial(j + 2) for j in range(TAYLOR_TERMS))
    c1 = -(dt / wd) * phi2
    c0 = -(dt / wd) * (phi1 - phi2)
    t = np.arange(steps)[:, None] * dt
    weight = np.exp(-s * t) * (c1 + c0 * np.exp(-s * dt))
    weight[0] = c0 * np.exp(-s * dt)
    turn = np.exp(s * (t + dt))
    lay_out = np.ascontiguousarray if by_rows else np.asfortranarray
    fixed = (
        lay_out(np.stack((weight.real, weight.imag), axis=1)[..., None]),
        lay_out(np.stack((turn.imag, turn.real), axis=1)[..., None]),
        np.ascontiguousarray(c1.real)[:, None],
        np.ascontiguousarray(c1.imag)[:, None],
    )
    for table in fixed:
        table.flags.writeable = False
    return _Tables(*fixed)
