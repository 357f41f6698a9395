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

from headimpact.kinematics import accumulate, largest, largest_magnitude, squared_norm
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
        Angular acceleration of the skull [rad/s^2], n x 3 or n x 3 x m.
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
    angle[0] = 0.0
    steps = alpha.shape[0] - 1
    segment = _segment_length(oscillators, sample_rate_hz)
    state: tuple[FloatArray, FloatArray] | None = None
    for start in range(0, steps, segment):
        stop = min(start + segment, steps)
        tables = _tables(oscillators, sample_rate_hz, stop - start)
        advance = _advance if alpha.ndim == 2 else _advance_block
        re, im = advance(alpha[start : stop + 1], angle[start : stop + 1], state, tables)
        if stop < steps:
            state = _state_at_end(re, im, alpha[stop], tables, angle[stop])
    return angle


def peak_brain_angles(
    angular_acceleration: FloatArray, sample_rate_hz: float, oscillators: Oscillators = BRAIN
) -> tuple[FloatArray, FloatArray]:
    """Largest absolute brain angle of each axis and of the resultant, read at the samples [rad].

    Parameters
    ----------
    angular_acceleration
        Angular acceleration of the skull [rad/s^2], n x 3 or n x 3 x m.
    sample_rate_hz
        Samples per second [Hz].
    oscillators
        The three oscillators; Table 2's unless given.

    Returns
    -------
    tuple of ndarray
        Peaks per axis (3 or 3 x m) and of the resultant (scalar or m).
    """
    angle = brain_angle_history(angular_acceleration, sample_rate_hz, oscillators)
    return largest_magnitude(angle), np.sqrt(largest(squared_norm(angle)))


def _segment_length(oscillators: Oscillators, sample_rate_hz: float) -> int:
    return max(1, int(LARGEST_EXPONENT / max(oscillators.decay_rate) * sample_rate_hz))


def _advance(
    alpha: FloatArray, angle: FloatArray, state: tuple[FloatArray, FloatArray] | None, tables: _Tables
) -> tuple[FloatArray, FloatArray]:
    """Fill `angle` over one segment of one impact, from `state`, (Re z, Im z) at its first sample, None at rest.

    With weights g_j and u_k = sum over j < k of g_j alpha_j, the state is z_k = exp(s t_k) u_k + c1 alpha_k, and the
    angle its imaginary part. Returns u at the last sample.
    """
    re = tables.weight_re * alpha[:-1]
    im = tables.weight_im * alpha[:-1]
    if state is not None:
        re[0] += state[0]
        im[0] += state[1]
    accumulate(re)
    accumulate(im)
    last = re[-1].copy(), im[-1].copy()
    re *= tables.back_im
    im *= tables.back_re
    now = np.multiply(alpha[1:], tables.c1_im, out=angle[1:])
    now += re
    now += im
    return last


def _advance_block(
    alpha: FloatArray, angle: FloatArray, state: tuple[FloatArray, FloatArray] | None, tables: _Tables
) -> tuple[FloatArray, FloatArray]:
    """The same for a block of impacts, n x 3 x m: the same operations, but sample by sample and with Re and Im as one.

    So the rows at work stay in the processor's cache.
    """
    u = np.zeros((2, *alpha.shape[1:])) if state is None else np.stack(state)
    share = np.empty_like(u)
    share_re, share_im = share
    weights = np.stack((tables.weight_re, tables.weight_im), axis=1)[..., None]
    back = np.stack((tables.back_im, tables.back_re), axis=1)[..., None]
    c1_im = tables.c1_im[:, None]
    for weight, turn, past, following, now in zip(weights, back, alpha[:-1], alpha[1:], angle[1:], strict=True):
        np.multiply(weight, past, out=share)
        u += share
        np.multiply(u, turn, out=share)
        np.multiply(following, c1_im, out=now)
        now += share_re
        now += share_im
    return u[0], u[1]


def _state_at_end(
    re: FloatArray, im: FloatArray, alpha: FloatArray, tables: _Tables, angle: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(Re z, Im z) at a segment's last sample, where the next one starts."""
    back_re, back_im, c1_re = tables.back_re[-1], tables.back_im[-1], tables.c1_re
    if re.ndim == 2:
        back_re, back_im, c1_re = back_re[:, None], back_im[:, None], c1_re[:, None]
    return re * back_re - im * back_im + c1_re * alpha, angle


class _Tables(NamedTuple):
    """What one segment needs, steps x 3.

    The weights g_j = exp(-s t_j) (c1 + c0 exp(-s dt)), the first without its share of c1, since there the state is
    given; exp(s t_k) of the steps k = 1, 2, ...; and c1.
    """

    weight_re: FloatArray
    weight_im: FloatArray
    back_re: FloatArray
    back_im: FloatArray
    c1_re: FloatArray
    c1_im: FloatArray


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
    weights[0] = c0 * np.exp(-s * dt)
    back = np.exp(s * (t + dt))
    tables = (weights.real, weights.imag, back.real, back.imag, c1.real, c1.imag)
    # laid out by component, as single impacts are
    fixed = [np.asfortranarray(table, dtype=np.float64) for table in tables]
    for table in fixed:
        table.flags.writeable = False
    return _Tables(*fixed)
