"""The risk that a model gives to idealised rotational pulses: Figure 8 of Laksari et al. 2020, for any model.

A half-sine pulse of angular acceleration, equal about the three axes, over its amplitude and duration. A criterion of
degree d grows with the d-th power of the amplitude, so one pulse of each duration is enough.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import expit

from headimpact.criteria import evaluate
from headimpact.errors import UnknownCriterion
from headimpact.kinematics import FloatArray, HeadKinematics, running_integral
from headimpact.risk import RiskModel

DEGREES: Mapping[str, float] = {
    "peak_angular_acceleration": 1.0,
    "delta_angular_velocity": 1.0,
    "bric": 1.0,
    "ric": 2.5,
    "bam": 1.0,
}
"""The criteria of rotation alone, and the power of the amplitude that they grow with."""
DURATIONS_S: tuple[float, ...] = tuple(np.geomspace(0.001, 1.0, 46).tolist())
AMPLITUDES_RAD_S2: tuple[float, ...] = tuple(np.geomspace(100.0, 50_000.0, 46).tolist())

# After the pulse the brain swings on: its angle may peak then.
FREE_VIBRATION_S = 0.06


@dataclass(frozen=True)
class RiskMap:
    """Probabilities over half-sine pulses.

    Parameters
    ----------
    model
        The model's version.
    incidence
        Concussions per impact that probabilities are served at.
    durations_s, amplitudes_rad_s2
        Of the pulses.
    probabilities
        By criterion, amplitudes x durations.
    """

    model: str
    incidence: float
    durations_s: tuple[float, ...]
    amplitudes_rad_s2: tuple[float, ...]
    probabilities: Mapping[str, FloatArray]


def draw_risk_map(
    model: RiskModel,
    criteria: Sequence[str] | None = None,
    *,
    durations_s: Sequence[float] = DURATIONS_S,
    amplitudes_rad_s2: Sequence[float] = AMPLITUDES_RAD_S2,
    incidence: float | None = None,
) -> RiskMap:
    """The risk map of a model.

    Parameters
    ----------
    model
        Any model.
    criteria
        Some of :data:`DEGREES`; those that the model has curves for unless given.
    durations_s
        Durations of the pulses [s].
    amplitudes_rad_s2
        Their amplitudes about each axis [rad/s^2].
    incidence
        Concussions per impact to serve probabilities at; the model's own unless given.

    Raises
    ------
    UnknownCriterion
        A criterion is none of rotation, or the model has no curve for it.
    """
    chosen = [key for key in DEGREES if key in model.curves] if criteria is None else list(criteria)
    for key in chosen:
        if key not in DEGREES or key not in model.curves:
            raise UnknownCriterion(f"A risk map has {', '.join(DEGREES)}, as far as the model has curves for them.")
    units = [_unit_pulse(duration) for duration in durations_s]
    amplitudes, shift = np.asarray(amplitudes_rad_s2), model.incidence_shift(incidence)
    probabilities = {}
    for key in chosen:
        curve = model.curves[key]
        slope = np.array([np.dot(np.atleast_1d(unit[key]), curve.b) for unit in units])
        predictor = curve.b0 + shift + np.power(amplitudes, DEGREES[key])[:, None] * slope
        probabilities[key] = np.asarray(expit(-predictor))
    return RiskMap(
        model.version,
        model.incidence if incidence is None else incidence,
        tuple(durations_s),
        tuple(amplitudes.tolist()),
        probabilities,
    )


@lru_cache(maxsize=1024)
def _unit_pulse(duration_s: float) -> Mapping[str, FloatArray]:
    """The criteria of a pulse of 1 rad/s^2 and the free vibration after it, finely sampled."""
    rate_hz = min(max(100.0 / duration_s, 4000.0), 100_000.0)
    t = np.arange(round((duration_s + FREE_VIBRATION_S) * rate_hz) + 1) / rate_hz
    wave = np.where(t <= duration_s, np.sin(np.pi * np.minimum(t / duration_s, 1.0)), 0.0)
    alpha = np.repeat(wave[:, None], 3, axis=1)
    motion = HeadKinematics(rate_hz, None, running_integral(alpha, rate_hz), alpha).motion
    return {key: found[..., 0] for key, found in evaluate(motion).values.items()}
