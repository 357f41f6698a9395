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

import numpy as np
from numpy.typing import NDArray

from headimpact.kinematics import largest, running_sum, squared_norm
from headimpact.published import BRAIN_MODEL

FloatArray = NDArray[np.float64]

# The running sum holds exp(+L t): a record is cut where that factor reaches exp(16), long before digits are lost.
LARGEST_EXPONENT = 16.0
TAYLOR_TERMS = 20


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
        Angular acceleration of the skull [rad/s^2], n x 3 or n x m x 3.
    sample_rate_hz
        Samples per second [Hz].
    oscillators
        The three oscillators; Table 2's unless given.

    Returns
    -------
    ndarray
        Brain angles [rad], of the shape of the input.
    """
    n = angular_acceleration.shape[0]
    segment = _segment_length(oscillators, sample_rate_hz)
    angle = np.empty_like(angular_acceleration)
    angle[0] = 0.0
    state: tuple[FloatArray, FloatArray] | None = None
    for start in range(0, n - 1, segment):
        stop = min(start + segment, n - 1)
        state = _advance(
            angular_acceleration[start : stop + 1], angle[start : stop + 1], state, sample_rate_hz, oscillators
        )
    return angle


def peak_brain_angles(
    angular_acceleration: FloatArray, sample_rate_hz: float, oscillators: Oscillators = BRAIN
) -> tuple[FloatArray, FloatArray]:
    """Largest absolute brain angle of each axis and of the resultant, read at the samples [rad].

    Parameters
    ----------
    angular_acceleration
        Angular acceleration of the skull [rad/s^2], n x 3 or n x m x 3.
    sample_rate_hz
        Samples per second [Hz].
    oscillators
        The three oscillators; Table 2's unless given.

    Returns
    -------
    tuple of ndarray
        Peaks per axis (3 or m x 3) and of the resultant (scalar or m).
    """
    angle = brain_angle_history(angular_acceleration, sample_rate_hz, oscillators)
    return largest(np.abs(angle)), np.sqrt(largest(squared_norm(angle)))


def _segment_length(oscillators: Oscillators, sample_rate_hz: float) -> int:
    return max(1, int(LARGEST_EXPONENT / max(oscillators.decay_rate) * sample_rate_hz))


def _advance(
    alpha: FloatArray,
    angle: FloatArray,
    state: tuple[FloatArray, FloatArray] | None,
    sample_rate_hz: float,
    oscillators: Oscillators,
) -> tuple[FloatArray, FloatArray]:
    """Fill `angle` over one segment from `state`, (Re z, Im z) at its first sample, None at rest; return its last."""
    tables = _tables(oscillators, sample_rate_hz, alpha.shape[0] - 1)
    shape = (alpha.shape[0] - 1, *(1,) * (alpha.ndim - 2), 3)
    now_re, now_im, last_re, last_im, back_cos, back_sin = (table.reshape(shape) for table in tables)
    now, last = alpha[1:], alpha[:-1]
    re = now_re * now
    re += last_re * last
    im = now_im * now
    im += last_im * last
    if state is not None:
        re[0] += state[0]
        im[0] += state[1]
    re = running_sum(re)
    im = running_sum(im)
    last_step = (re[-1] * back_cos[-1] - im[-1] * back_sin[-1], re[-1] * back_sin[-1] + im[-1] * back_cos[-1])
    re *= back_sin
    im *= back_cos
    np.add(re, im, out=angle[1:])
    return last_step


@lru_cache(maxsize=64)
def _tables(oscillators: Oscillators, sample_rate_hz: float, steps: int) -> tuple[FloatArray, ...]:
    """Weights of one segment: first-order-hold weights times exp(-s t_k), then exp(s t_k) to come back.

    z_k = exp(s dt) z_(k-1) + c0 alpha_(k-1) + c1 alpha_k with, for X = s dt,
    c1 = -(dt/wd) phi2(X), c0 = -(dt/wd) (phi1(X) - phi2(X)), phi1 = (exp(X) - 1)/X, phi2 = (exp(X) - 1 - X)/X^2,
    both taken from their series: the closed forms lose digits where X is small.
    """
    dt = 1.0 / sample_rate_hz
    wd = np.array(oscillators.damped_frequency)
    s = -np.array(oscillators.decay_rate) + 1j * wd
    phi1 = sum((s * dt) ** j / factorial(j + 1) for j in range(TAYLOR_TERMS))
    phi2 = sum((s * dt) ** j / factorial(j + 2) for j in range(TAYLOR_TERMS))
    t = np.arange(1, steps + 1)[:, None] * dt
    forward = np.exp(-s * t)
    now = -(dt / wd) * phi2 * forward
    last = -(dt / wd) * (phi1 - phi2) * forward
    back = np.exp(s * t)
    tables = tuple(np.ascontiguousarray(x) for x in (now.real, now.imag, last.real, last.imag, back.real, back.imag))
    for table in tables:
        table.flags.writeable = False
    return tables
