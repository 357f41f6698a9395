"""The rules between the fields of an impact, which no field can hold alone."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime

from headimpact.criteria.extra import EXTRA_CRITERIA
from headimpact.recording import AXES, SIGNALS, SignalName
from headimpact_service.errors import PayloadError
from headimpact_service.ingest.impact_json import FileImpactBody, ImpactBody, Kinematics, ScoreBody, SignalBody
from headimpact_service.ingest.times import TimeError, instant, known_zone

# The axis that a plane's normal lies along: translation along it and rotation about the two others are outside.
_NORMAL = {"sagittal": "y", "coronal": "x", "axial": "z"}


def required_axes(signal: SignalName, constrained_plane: str | None) -> tuple[str, ...]:
    """The components that a signal must have: all three, or those inside the plane that the motion is held to."""
    if constrained_plane is None:
        return AXES
    normal = _NORMAL[constrained_plane]
    return tuple(axis for axis in AXES if (axis == normal) != (signal == "linear_acceleration"))


def faults(body: ScoreBody) -> list[PayloadError]:
    """Every rule between fields that `body` breaks."""
    found = list(_kinematics(body.kinematics))
    if isinstance(body, ImpactBody | FileImpactBody):
        found += _athlete(body)
    found += _operating_points(body)
    found += _extra_criteria(body)
    return found


def occurred_at(body: ScoreBody, time_zone: str | None = None) -> tuple[datetime | None, list[PayloadError]]:
    """When it happened, or why that cannot be told; `time_zone` serves a local time that has none beside it."""
    zone = body.time_zone if body.time_zone is not None else time_zone
    try:
        if body.occurred_at is not None:
            return instant(body.occurred_at, zone), []
        if body.time_zone is not None:
            known_zone(body.time_zone)
    except TimeError as fault:
        return None, [PayloadError(detail=str(fault), code=fault.code, pointer=f"/{fault.field}")]
    return None, []


def _kinematics(kinematics: Kinematics) -> Iterator[PayloadError]:
    signals = [(name, body) for name in SIGNALS if (body := getattr(kinematics, name)) is not None]
    if not signals:
        yield PayloadError(
            detail="At least one of linear_acceleration, angular_velocity and angular_acceleration is needed.",
            code="no-signal",
            pointer="/kinematics",
        )
    if kinematics.mounting is not None and kinematics.location != "sensor":
        yield PayloadError(
            detail="A mounting is for signals of the sensor: give location sensor with it.",
            code="mounting-not-needed",
            pointer="/kinematics/mounting",
        )
    for name, body in signals:
        yield from _signal(body, required_axes(name, kinematics.constrained_plane), f"/kinematics/{name}")


def _signal(body: SignalBody, required: tuple[str, ...], place: str) -> Iterator[PayloadError]:
    if (body.sample_rate_hz is None) == (body.time_ms is None):
        yield PayloadError(
            detail="Exactly one of sample_rate_hz and time_ms is needed.", code="rate-or-times", pointer=place
        )
    for axis in required:
        if getattr(body, axis) is None:
            detail = "This component is needed: only those outside a constrained_plane may be left out."
            yield PayloadError(detail=detail, code="missing", pointer=f"{place}/{axis}")
    yield from _lengths(body, place)


def _lengths(body: SignalBody, place: str) -> Iterator[PayloadError]:
    named = [(name, samples) for name in (*AXES, "time_ms") if (samples := getattr(body, name)) is not None]
    if not named:
        return
    first, count = named[0][0], len(named[0][1])
    for name, samples in named[1:]:
        if len(samples) != count:
            detail = f"As many entries as in {first} are needed: {count}."
            yield PayloadError(detail=detail, code="length-mismatch", pointer=f"{place}/{name}")


def _athlete(body: ImpactBody | FileImpactBody) -> list[PayloadError]:
    if body.athlete is None or (body.athlete.id is None) != (body.athlete.external_id is None):
        return []
    return [PayloadError(detail="Exactly one of id and external_id is needed.", code="one-of", pointer="/athlete")]


def _operating_points(body: ScoreBody) -> Iterator[PayloadError]:
    for index, point in enumerate(body.operating_points or ()):
        given = [value for value in (point.sensitivity, point.specificity, point.threshold) if value is not None]
        if len(given) != 1:
            yield PayloadError(
                detail="Exactly one of sensitivity, specificity and threshold is needed.",
                code="one-of",
                pointer=f"/operating_points/{index}",
            )


def _extra_criteria(body: ScoreBody) -> Iterator[PayloadError]:
    for index, name in enumerate(body.extra_criteria or ()):
        if name not in EXTRA_CRITERIA:
            detail = f"One of these is needed: {', '.join(EXTRA_CRITERIA)}."
            yield PayloadError(detail=detail, code="not-allowed", pointer=f"/extra_criteria/{index}")
