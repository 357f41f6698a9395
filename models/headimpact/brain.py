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

from headimpact.kinematics import accumulate, largest, largest_magnitude, squared_norm
from headimpact.published import BRAIN_MODEL

FloatArray = NDArray[np.float64]

# The running sum holds exp(+L t): a record is cut where that factor reaches exp(16), long before digits are lost.
LARGEST_EXPONENT = 16.0
TAYLOR_TERMS = 20

# Impacts of a batch that are solved together.
BLOCK = 256


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
    alpha = angular_acceleration
    angle = np.empty_like(alpha)
    if alpha.ndim == 2:
        _fill(alpha, angle, np.empty_like(alpha), np.empty_like(alpha), sample_rate_hz, oscillators)
        return angle
    # a block at a time, in two buffers that stay in the processor's cache
    re = np.empty((alpha.shape[0], min(BLOCK, alpha.shape[1]), 3))
    im = np.empty_like(re)
    for first in range(0, alpha.shape[1], BLOCK):
        block = slice(first, first + BLOCK)
        width = alpha[:, block].shape[1]
        _fill(alpha[:, block], angle[:, block], re[:, :width], im[:, :width], sample_rate_hz, oscillators)
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
    return largest_magnitude(angle), np.sqrt(largest(squared_norm(angle)))


def _segment_length(oscillators: Oscillators, sample_rate_hz: float) -> int:
    return max(1, int(LARGEST_EXPONENT / max(oscillators.decay_rate) * sample_rate_hz))


def _fill(
    alpha: FloatArray,
    angle: FloatArray,
    re: FloatArray,
    im: FloatArray,
    sample_rate_hz: float,
    oscillators: Oscillators,
) -> None:
    """Fill `angle`, segment by segment; `re` and `im` are buffers of its shape."""
    steps = alpha.shape[0] - 1
    segment = _segment_length(oscillators, sample_rate_hz)
    angle[0] = 0.0
    state: tuple[FloatArray, FloatArray] | None = None
    for start in range(0, steps, segment):
        stop = min(start + segment, steps)
        tables = _tables(oscillators, sample_rate_hz, stop - start)
        span, buffers = slice(start, stop + 1), (re[start:stop], im[start:stop])
        state = _advance(alpha[span], angle[span], buffers, state, tables)


def _advance(
    alpha: FloatArray,
    angle: FloatArray,
    buffers: tuple[FloatArray, FloatArray],
    state: tuple[FloatArray, FloatArray] | None,
    tables: _Tables,
) -> tuple[FloatArray, FloatArray]:
    """Fill `angle` over one segment from `state`, (Re z, Im z) at its first sample, None at rest; return its last.

    With weights g_j and u_k = sum over j < k of g_j alpha_j, the state is z_k = exp(s t_k) u_k + c1 alpha_k.
    """
    weight_re, weight_im, back_cos, back_sin = tables.spread(alpha.ndim)
    c1_re, c1_im = tables.c1
    past, now = alpha[:-1], angle[1:]
    re = np.multiply(weight_re, past, out=buffers[0])
    im = np.multiply(weight_im, past, out=buffers[1])
    # the first sample of a segment has no share of c1: there the state is given
    re[0] -= c1_re * past[0]
    im[0] -= c1_im * past[0]
    if state is not None:
        re[0] += state[0]
        im[0] += state[1]
    accumulate(re)
    accumulate(im)
    end_re = re[-1] * back_cos[-1] - im[-1] * back_sin[-1] + c1_re * alpha[-1]
    re *= back_sin
    im *= back_cos
    np.multiply(alpha[1:], c1_im, out=now)
    now += re
    now += im
    return end_re, angle[-1]


@dataclass(frozen=True, slots=True)
class _Tables:
    """What one segment needs: weights g_j = exp(-s t_j) (c1 + c0 exp(-s dt)), real and imaginary; exp(s t_k) of its
    steps k = 1, 2, ..., likewise; c1, likewise."""

    weights_and_back: tuple[FloatArray, FloatArray, FloatArray, FloatArray]
    c1: tuple[NDArray[np.floating], NDArray[np.floating]]

    def spread(self, ndim: int) -> tuple[FloatArray, ...]:
        """The tables with axes for as many dimensions as the signal has."""
        if ndim == 2:
            return self.weights_and_back
        return tuple(table[:, None, :] for table in self.weights_and_back)


@lru_cache(maxsize=64)
def _tables(oscillators: Oscillators, sample_rate_hz: float, steps: int) -> _Tables:
    """First-order-hold weights.

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
    weights = np.exp(-s * t) * (c1 + c0 * np.exp(-s * dt))
    back = np.exp(s * (t + dt))
    # laid out by component, as single impacts are
    tables = tuple(np.asfortranarray(x) for x in (weights.real, weights.imag, back.real, back.imag))
    for table in tables:
        table.flags.writeable = False
    return _Tables((tables[0], tables[1], tables[2], tables[3]), (c1.real, c1.imag))
