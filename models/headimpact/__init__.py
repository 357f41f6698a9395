"""Head-impact traces in; brain angles, injury criteria and concussion probabilities out.

    >>> from headimpact import Recording, Signal, prepare, score
    >>> score(prepare(Recording(angular_velocity=Signal(samples, "rad/s", sample_rate_hz=1000.0))))

The names below are the package's public interface; those of its modules that are not listed here may change. Each is
imported when it is first used: SciPy's signal processing takes longer to import than most programs that need only an
error class or a constant should wait.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from headimpact.brain import brain_angle_history, peak_brain_angles
    from headimpact.criteria import CRITERIA, CRITERION_KEYS, Criterion
    from headimpact.criteria.extra import EXTRA_CRITERIA, ExtraCriterion
    from headimpact.cut_offs import NO_FILTER, PAPER, AppliedFilter, LowPass
    from headimpact.errors import (
        CalibrationError,
        HeadimpactError,
        ModelDocumentError,
        OperatingPointUnreachable,
        SeparationError,
        TraceError,
        UnknownCriterion,
        UnknownModel,
    )
    from headimpact.kinematics import HeadKinematics, Motion
    from headimpact.model_document import model_from_document, model_from_text, model_to_document
    from headimpact.preparation import Preparation, prepare, prepare_many
    from headimpact.quality import QualityNote
    from headimpact.recording import AXES, STANDARD_GRAVITY, Mounting, Recording, Signal
    from headimpact.risk import (
        DEFAULT_OPERATING_POINTS,
        LAKSARI_2020,
        PUBLISHED_MODELS,
        CriticalValue,
        KnownPoint,
        OperatingPoint,
        OperatingPointRequest,
        RiskCurve,
        RiskModel,
        critical_values,
        load_model,
        resolve_operating_point,
    )
    from headimpact.risk_map import RiskMap, draw_risk_map
    from headimpact.scoring import CONVENTIONS, BrainAngle, CriterionScore, ImpactScore, Peaks, score, score_many

__all__ = [
    "AXES",
    "CONVENTIONS",
    "CRITERIA",
    "CRITERION_KEYS",
    "DEFAULT_OPERATING_POINTS",
    "EXTRA_CRITERIA",
    "LAKSARI_2020",
    "NO_FILTER",
    "PAPER",
    "PUBLISHED_MODELS",
    "STANDARD_GRAVITY",
    "AppliedFilter",
    "BrainAngle",
    "CalibrationError",
    "Criterion",
    "CriterionScore",
    "CriticalValue",
    "ExtraCriterion",
    "HeadKinematics",
    "HeadimpactError",
    "ImpactScore",
    "KnownPoint",
    "LowPass",
    "ModelDocumentError",
    "Motion",
    "Mounting",
    "OperatingPoint",
    "OperatingPointRequest",
    "OperatingPointUnreachable",
    "Peaks",
    "Preparation",
    "QualityNote",
    "Recording",
    "RiskCurve",
    "RiskMap",
    "RiskModel",
    "SeparationError",
    "Signal",
    "TraceError",
    "UnknownCriterion",
    "UnknownModel",
    "brain_angle_history",
    "critical_values",
    "draw_risk_map",
    "load_model",
    "model_from_document",
    "model_from_text",
    "model_to_document",
    "peak_brain_angles",
    "prepare",
    "prepare_many",
    "resolve_operating_point",
    "score",
    "score_many",
]

_MODULES = {
    "brain": ("brain_angle_history", "peak_brain_angles"),
    "criteria": ("CRITERIA", "CRITERION_KEYS", "Criterion"),
    "criteria.extra": ("EXTRA_CRITERIA", "ExtraCriterion"),
    "errors": (
        "CalibrationError",
        "HeadimpactError",
        "ModelDocumentError",
        "OperatingPointUnreachable",
        "SeparationError",
        "TraceError",
        "UnknownCriterion",
        "UnknownModel",
    ),
    "cut_offs": ("NO_FILTER", "PAPER", "AppliedFilter", "LowPass"),
    "kinematics": ("HeadKinematics", "Motion"),
    "model_document": ("model_from_document", "model_from_text", "model_to_document"),
    "preparation": ("Preparation", "prepare", "prepare_many"),
    "quality": ("QualityNote",),
    "recording": ("AXES", "STANDARD_GRAVITY", "Mounting", "Recording", "Signal"),
    "risk": (
        "DEFAULT_OPERATING_POINTS",
        "LAKSARI_2020",
        "PUBLISHED_MODELS",
        "CriticalValue",
        "OperatingPoint",
        "OperatingPointRequest",
        "KnownPoint",
        "RiskCurve",
        "RiskModel",
        "critical_values",
        "load_model",
        "resolve_operating_point",
    ),
    "risk_map": ("RiskMap", "draw_risk_map"),
    "scoring": ("CONVENTIONS", "BrainAngle", "CriterionScore", "ImpactScore", "Peaks", "score", "score_many"),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
