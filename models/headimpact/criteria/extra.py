"""Criteria beyond the paper's thirteen, requested by name. They carry no probability of the risk model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import exp, sqrt

import numpy as np

from headimpact.brain import Oscillators, peak_brain_angles
from headimpact.criteria import evaluate, rotational
from headimpact.criteria.combined import vtcp
from headimpact.kinematics import FloatArray, HeadKinematics
from headimpact.published import EXTRA_CONSTANTS
from headimpact.recording import SignalName


@dataclass(frozen=True, slots=True)
class ExtraValue:
    """A value, with the risks that the criterion's own source attaches to it."""

    value: float
    risks: Mapping[str, float] = field(default_factory=dict)


def damage(kinematics: HeadKinematics) -> ExtraValue:
    """DAMAGE (Gabler, Crandall & Panzer 2019), the largest displacement of a coupled second-order system [-].

    M d'' + C d' + K d = M alpha with C = a1 K: proportional damping, so the modes of K decouple it into three
    oscillators, solved exactly as the brain model is, with the maximum read at the samples. In the anatomical frame no
    sign of alpha changes.
    """
    alpha = kinematics.angular_acceleration
    assert alpha is not None
    modes, oscillators = _damage_modes()
    _, largest = peak_brain_angles(alpha @ modes, kinematics.sample_rate_hz, oscillators)
    constants = EXTRA_CONSTANTS["damage"]
    value = float(constants["scale"] * largest)
    base = constants["risk_slope"] * value + constants["risk_offset"]
    risks = {name: 1.0 - exp(-((base / c["b"]) ** c["a"])) for name, c in constants["risk"].items()}
    return ExtraValue(value, risks)


def _damage_modes() -> tuple[FloatArray, Oscillators]:
    c = EXTRA_CONSTANTS["damage"]
    kxx, kyy, kzz = c["kxx_n_per_m"], c["kyy_n_per_m"], c["kzz_n_per_m"]
    kxy, kyz, kxz = c["kxy_n_per_m"], c["kyz_n_per_m"], c["kxz_n_per_m"]
    stiffness = np.array([[kxx + kxy + kxz, -kxy, -kxz], [-kxy, kxy + kyy + kyz, -kyz], [-kxz, -kyz, kxz + kyz + kzz]])
    squared, modes = np.linalg.eigh(stiffness / c["mass_kg"])
    decay = [0.5 * c["a1_s"] * x for x in squared]
    damped = [sqrt(x - d * d) for x, d in zip(squared, decay, strict=True)]
    return modes, Oscillators((decay[0], decay[1], decay[2]), (damped[0], damped[1], damped[2]))


def _ubric(kinematics: HeadKinematics, velocity: FloatArray) -> ExtraValue:
    constants = EXTRA_CONSTANTS["ubric_mps"]
    total = 0.0
    for w, w_critical, a, a_critical in zip(
        velocity[:, 0],
        constants["critical_angular_velocity_rad_s"],
        rotational.peak_angular_acceleration(kinematics.motion)[:, 0],
        constants["critical_angular_acceleration_rad_s2"],
        strict=True,
    ):
        ratio_w, ratio_a = float(w) / w_critical, float(a) / a_critical
        # its limit where the velocity vanishes is the velocity term alone, which is zero
        term = ratio_w + (ratio_a - ratio_w) * exp(-ratio_a / ratio_w) if ratio_w > 0 else 0.0
        total += term * term
    return ExtraValue(sqrt(total))


def ubric_mps(kinematics: HeadKinematics) -> ExtraValue:
    """UBrIC (Gabler et al. 2018) with strain criticals, velocity = largest absolute value [-]."""
    return _ubric(kinematics, rotational.peak_angular_velocity(kinematics.motion))


def ubric_mps_peak_to_peak(kinematics: HeadKinematics) -> ExtraValue:
    """The same with velocity = largest minus smallest value: sources disagree, so the choice is in the name [-]."""
    return _ubric(kinematics, rotational.delta_angular_velocity(kinematics.motion))


def _bric(kinematics: HeadKinematics, name: str) -> ExtraValue:
    critical = np.array(EXTRA_CONSTANTS[name]["critical_angular_velocity_rad_s"])
    return ExtraValue(float(rotational.bric(kinematics.motion, critical)[0]))


def bric_mps(kinematics: HeadKinematics) -> ExtraValue:
    """BrIC with the critical velocities of the maximum principal strain (Takhounts et al. 2013) [-]."""
    return _bric(kinematics, "bric_mps")


def bric_average(kinematics: HeadKinematics) -> ExtraValue:
    """BrIC with the averaged critical velocities (Takhounts et al. 2013) [-]."""
    return _bric(kinematics, "bric_average")


def harm(kinematics: HeadKinematics) -> ExtraValue:
    """Head acceleration response metric (Bailey et al. 2020), from HIC15 and DAMAGE [-]."""
    constants = EXTRA_CONSTANTS["harm"]
    return ExtraValue(constants["hic15"] * _value("hic15", kinematics) + constants["damage"] * damage(kinematics).value)


def hic_d(kinematics: HeadKinematics) -> ExtraValue:
    """HIC(d) of the free-motion headform (49 CFR 571.201), from HIC36 [g^2.5 s]."""
    constants = EXTRA_CONSTANTS["hic_d"]
    return ExtraValue(constants["slope"] * _value("hic36", kinematics) + constants["offset"])


def _value(key: str, kinematics: HeadKinematics) -> float:
    """One of the thirteen."""
    return float(evaluate(kinematics.motion).values[key][0])


def _peak(signal: SignalName, kinematics: HeadKinematics) -> float:
    """The largest norm of a signal, in its unit."""
    motion = kinematics.motion
    return float(motion.peaks[motion.signals.index(signal)][0])


def _risk_weight(name: str, peak: float) -> ExtraValue:
    constants = EXTRA_CONSTANTS[name]
    return ExtraValue(1.0 / (1.0 + exp(-(constants["intercept"] + constants["slope"] * peak))))


def rwe_linear_collegiate(kinematics: HeadKinematics) -> ExtraValue:
    """This impact's share of the linear risk-weighted exposure, collegiate curve (Urban et al. 2013) [-]."""
    return _risk_weight("rwe_linear_collegiate", _peak("linear_acceleration", kinematics))


def rwe_linear_nfl(kinematics: HeadKinematics) -> ExtraValue:
    """This impact's share of the linear risk-weighted exposure, NFL curve (Urban et al. 2013) [-]."""
    return _risk_weight("rwe_linear_nfl", _peak("linear_acceleration", kinematics))


def rwe_rotational(kinematics: HeadKinematics) -> ExtraValue:
    """This impact's share of the rotational risk-weighted exposure (Urban et al. 2013) [-]."""
    return _risk_weight("rwe_rotational", _peak("angular_acceleration", kinematics))


def rwe_combined(kinematics: HeadKinematics) -> ExtraValue:
    """This impact's share of the combined risk-weighted exposure: the paper's VTCP [-]."""
    return ExtraValue(float(vtcp(kinematics.motion)[0]))


@dataclass(frozen=True, slots=True)
class ExtraCriterion:
    """One extra criterion: its key, unit, the signals it needs, its source and its function."""

    key: str
    unit: str
    needs: tuple[SignalName, ...]
    source: str
    evaluate: Callable[[HeadKinematics], ExtraValue]


_LINEAR: tuple[SignalName, ...] = ("linear_acceleration",)
_ANGULAR: tuple[SignalName, ...] = ("angular_acceleration",)
_VELOCITY: tuple[SignalName, ...] = ("angular_velocity",)

EXTRA_CRITERIA: dict[str, ExtraCriterion] = {
    criterion.key: criterion
    for criterion in (
        ExtraCriterion("damage", "-", _ANGULAR, "Gabler, Crandall & Panzer 2019", damage),
        ExtraCriterion("ubric_mps", "-", _VELOCITY + _ANGULAR, "Gabler et al. 2018", ubric_mps),
        ExtraCriterion(
            "ubric_mps_peak_to_peak", "-", _VELOCITY + _ANGULAR, "Gabler et al. 2018", ubric_mps_peak_to_peak
        ),
        ExtraCriterion("bric_mps", "-", _VELOCITY, "Takhounts et al. 2013", bric_mps),
        ExtraCriterion("bric_average", "-", _VELOCITY, "Takhounts et al. 2013", bric_average),
        ExtraCriterion("harm", "-", _LINEAR + _ANGULAR, "Bailey et al. 2020", harm),
        ExtraCriterion("hic_d", "g^2.5 s", _LINEAR, "49 CFR 571.201", hic_d),
        ExtraCriterion("rwe_linear_collegiate", "-", _LINEAR, "Urban et al. 2013", rwe_linear_collegiate),
        ExtraCriterion("rwe_linear_nfl", "-", _LINEAR, "Urban et al. 2013", rwe_linear_nfl),
        ExtraCriterion("rwe_rotational", "-", _ANGULAR, "Urban et al. 2013", rwe_rotational),
        ExtraCriterion("rwe_combined", "-", _LINEAR + _ANGULAR, "Urban et al. 2013", rwe_combined),
    )
}
