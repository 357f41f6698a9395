"""Scores as rows to keep, and rows as the JSON to answer: one way for scores that are stored and those that are not."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from headimpact.brain import brain_angle_history
from headimpact.criteria import CRITERIA
from headimpact.cut_offs import AppliedFilter
from headimpact.kinematics import HeadKinematics
from headimpact.quality import QualityNote
from headimpact.recording import AXES
from headimpact.risk import OperatingPoint, resolve_operating_point
from headimpact.scoring import CriterionScore, ImpactScore
from headimpact_service import __version__
from headimpact_service.ingest.digest import shown
from headimpact_service.intake.records import axes_lists
from headimpact_service.intake.scoring import MissingPoint, Scored
from headimpact_service.store.score_rows import NewScore

_OF_A_POINT = ("threshold", "threshold_interval", "exceeded", "sensitivity", "specificity", "basis")
_UNITS = tuple((criterion.key, criterion.unit) for criterion in CRITERIA)


def new_score(scored: Scored) -> NewScore:
    """The score as it is kept."""
    if scored.score is None:
        return _unscorable(scored)
    score = scored.score
    quality = (*scored.record.notes, *score.quality)
    return NewScore(
        state="scored",
        model=score.model,
        incidence=score.incidence,
        service_version=__version__,
        input_digest=scored.input_digest,
        values={key: criterion.value for key, criterion in score.criteria.items()},
        probabilities={key: criterion.probability for key, criterion in score.criteria.items()},
        brain_angle_resultant=None if score.brain_angle is None else score.brain_angle.resultant,
        linear_acceleration_g=score.peaks.linear_acceleration_g,
        angular_velocity_rad_s=score.peaks.angular_velocity_rad_s,
        angular_acceleration_rad_s2=score.peaks.angular_acceleration_rad_s2,
        quality_codes=tuple(dict.fromkeys(note.code for note in quality)),
        details=_details(scored, score, quality),
        provenance=_provenance(score),
    )


def _unscorable(scored: Scored) -> NewScore:
    reason = " ".join(scored.reasons)
    details: dict[str, Any] = {
        "quality": [note_document(note) for note in scored.record.notes],
        "reasons": list(scored.reasons),
        "missing": {key: reason for key, _ in _UNITS},
        "operating_points": [_operating_point(point, None) for point in scored.points],
    }
    return NewScore(
        state="unscorable",
        model=scored.terms.model.version,
        incidence=scored.terms.incidence or scored.terms.model.incidence,
        service_version=__version__,
        input_digest=scored.input_digest,
        quality_codes=tuple(dict.fromkeys(note.code for note in scored.record.notes)),
        details=details,
        provenance={"filters": [], "conventions": {}},
    )


def _details(scored: Scored, score: ImpactScore, quality: Iterable[QualityNote]) -> dict[str, Any]:
    """What has no column, as JSON reads it back: only what there is, so that an ordinary score is a short document."""
    criteria = score.criteria
    details: dict[str, Any] = {
        "quality": [note_document(note) for note in quality],
        "windows_ms": {key: list(found.window_ms) for key, found in criteria.items() if found.window_ms is not None},
        "operating_points": [_operating_point(point, score) for point in scored.points],
    }
    missing = {key: found.reason for key, found in criteria.items() if found.reason is not None}
    if missing:
        details["missing"] = missing
    intervals = {
        key: list(found.probability_interval)
        for key, found in criteria.items()
        if found.probability_interval is not None
    }
    if intervals:
        details["probability_intervals"] = intervals
    if score.brain_angle is not None:
        details["time_of_peak_ms"] = list(score.brain_angle.time_of_peak_ms)
    if score.extra_criteria:
        details["extra_criteria"] = {key: _extra(found) for key, found in score.extra_criteria.items()}
    return details


def note_document(note: QualityNote) -> dict[str, Any]:
    """A note as it is answered."""
    shown = {"code": note.code, "severity": note.severity, "detail": note.detail}
    if note.signal is not None:
        shown["signal"] = note.signal
    if note.channel is not None:
        shown["channel"] = note.channel
    return shown


def _operating_point(point: OperatingPoint | MissingPoint, score: ImpactScore | None) -> dict[str, Any]:
    if isinstance(point, MissingPoint):
        asked = {"criterion": point.request.criterion, "requested": point.request.requested}
        return asked | dict.fromkeys(_OF_A_POINT) | {"reason": point.reason}
    return _point(point, None if score is None else score.criteria[point.request.criterion].probability)


def _point(point: OperatingPoint, probability: float | None) -> dict[str, Any]:
    return {
        "criterion": point.request.criterion,
        "requested": point.request.requested,
        "threshold": point.threshold,
        "threshold_interval": None if point.threshold_interval is None else list(point.threshold_interval),
        "exceeded": None if probability is None else probability >= point.threshold,
        "sensitivity": point.sensitivity,
        "specificity": point.specificity,
        "basis": point.basis,
    }


def as_asked(document: dict[str, Any], stored: NewScore, scored: Scored) -> None:
    """Answer a redelivery's own operating points and extra criteria, on the probabilities that are stored.

    Those of a model that is not in service any more keep the operating points that they were stored with.
    """
    requests = scored.record.operating_points
    if requests and stored.state == "scored" and stored.model == scored.terms.model.version:
        points = [resolve_operating_point(request, scored.terms.model, stored.incidence) for request in requests]
        document["operating_points"] = [
            _point(point, stored.probabilities[point.request.criterion]) for point in points
        ]
    if scored.score is not None and scored.score.extra_criteria:
        document["extra_criteria"] = {key: _extra(found) for key, found in scored.score.extra_criteria.items()}


def _extra(found: CriterionScore) -> dict[str, Any]:
    shown = {"value": _value(found.value), "unit": found.unit, "probability": found.probability}
    if found.risks:
        shown["risks"] = dict(found.risks)
    if found.reason is not None:
        shown["reason"] = found.reason
    return shown


def _provenance(score: ImpactScore) -> dict[str, Any]:
    return {
        "filters": [_filter(applied) for applied in score.filters],
        "conventions": dict(score.conventions),
        "angular_velocity_source": score.angular_velocity_source,
        "angular_acceleration_source": score.angular_acceleration_source,
    }


def _filter(applied: AppliedFilter) -> dict[str, Any]:
    return {
        "signal": applied.signal,
        "cut_off": applied.cut_off,
        "corner_hz": applied.corner_hz,
        "applied": applied.applied,
    }


def score_document(score: NewScore) -> dict[str, Any]:
    """A score, stored or not, as it is answered."""
    details = score.details
    document: dict[str, Any] = {"state": score.state, "model": score.model}
    if score.state == "unscorable":
        document["reasons"] = details["reasons"]
    document["quality"] = details["quality"]
    document["brain_angle"] = _brain_angle(score)
    document["peaks"] = {
        "linear_acceleration_g": score.linear_acceleration_g,
        "angular_velocity_rad_s": score.angular_velocity_rad_s,
        "angular_acceleration_rad_s2": score.angular_acceleration_rad_s2,
    }
    document["criteria"] = _criteria(score)
    if "extra_criteria" in details:
        document["extra_criteria"] = details["extra_criteria"]
    document["operating_points"] = details["operating_points"]
    document["provenance"] = {
        "input_digest": shown(score.input_digest),
        "service_version": score.service_version,
        "model": score.model,
        "incidence": score.incidence,
        **score.provenance,
    }
    return document


def _criteria(score: NewScore) -> dict[str, Any]:
    values, probabilities = score.values, score.probabilities
    windows: Mapping[str, Any] = score.details.get("windows_ms", {})
    missing: Mapping[str, str] = score.details.get("missing", {})
    intervals: Mapping[str, Any] = score.details.get("probability_intervals", {})
    shown = {}
    for key, unit in _UNITS:
        entry = {"value": _value(values.get(key)), "unit": unit, "probability": probabilities.get(key)}
        if key in intervals:
            entry["probability_interval"] = intervals[key]
        if key in windows:
            entry["window_ms"] = windows[key]
        if key in missing:
            entry["reason"] = missing[key]
        shown[key] = entry
    return shown


def _value(value: Any) -> Any:  # noqa: ANN401 - a number, a vector or nothing
    return dict(zip(AXES, value, strict=True)) if isinstance(value, tuple) else value


def _brain_angle(score: NewScore) -> dict[str, Any] | None:
    bam = score.values.get("bam")
    if not isinstance(bam, tuple):
        return None
    x, y, z = bam
    times = dict(zip(AXES, score.details["time_of_peak_ms"], strict=True))
    return {"unit": "rad", "x": x, "y": y, "z": z, "resultant": score.brain_angle_resultant, "time_of_peak_ms": times}


def head_traces(kinematics: HeadKinematics) -> dict[str, Any]:
    """The filtered motion of the head's centre of gravity."""
    signals = {
        "linear_acceleration": ("g", kinematics.linear_acceleration_g),
        "angular_velocity": ("rad/s", kinematics.angular_velocity),
        "angular_acceleration": ("rad/s^2", kinematics.angular_acceleration),
    }
    return {
        "sample_rate_hz": kinematics.sample_rate_hz,
        "start_time_ms": kinematics.start_time_ms,
        **{
            name: None if values is None else {"unit": unit, **axes_lists(values)}
            for name, (unit, values) in signals.items()
        },
    }


def brain_trace(kinematics: HeadKinematics) -> dict[str, Any] | None:
    """The brain's angle relative to the skull; None without rotation."""
    if kinematics.angular_acceleration is None:
        return None
    history = brain_angle_history(kinematics.angular_acceleration, kinematics.sample_rate_hz)
    return {"unit": "rad", **axes_lists(history)}


def scored_traces(scored: Scored) -> dict[str, Any] | None:
    """What `include: ["traces"]` adds; None for a record without a score."""
    if scored.preparation is None:
        return None
    kinematics = scored.preparation.kinematics
    return {**head_traces(kinematics), "brain_angle": brain_trace(kinematics)}
