"""The rules between the fields of an impact, which no field can hold alone."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from datetime import datetime

import numpy as np

from headimpact.criteria.extra import EXTRA_CRITERIA
from headimpact.quality import words
from headimpact.recording import AXES, SIGNALS, FloatArray, Recording, SignalName
from headimpact_service.errors import PayloadError, Problem
from headimpact_service.ingest.impact_json import FileImpactBody, ImpactBody, Kinematics, ScoreBody, SignalBody
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.times import TimeError, instant, known_zone

# The axis that a plane's normal lies along: translation along it and rotation about the two others are outside.
_NORMAL = {"sagittal": "y", "coronal": "x", "axial": "z"}


# A coefficient of a rotation below it is none: what a right angle's cosine comes to.
_NO_PART = 1e-9


def missing_axes(
    signal: SignalName, given: Collection[str], constrained_plane: str | None, *, turned: bool
) -> tuple[str, ...]:
    """The components that a signal lacks: of all three, or of those inside the plane that the motion is held to.

    Of a sensor that a mounting turns any one is enough here: :func:`require_recorded` has the rest once its rotation
    is known.
    """
    needed: tuple[str, ...]
    if constrained_plane is None or (turned and not given):
        needed = AXES
    else:
        needed = () if turned else _inside(signal, constrained_plane)
    return tuple(axis for axis in needed if axis not in given)


def _inside(signal: SignalName, constrained_plane: str) -> tuple[str, ...]:
    """The components of the head that a plane of motion leaves."""
    normal = _NORMAL[constrained_plane]
    return tuple(axis for axis in AXES if (axis == normal) != (signal == "linear_acceleration"))


def require_recorded(record: ImpactRecord) -> None:
    """Refuse a component that was left out although what moves inside the plane has a part of it.

    The plane is one of the head's, so a sensor that is turned may lack only what its rotation keeps out of it.

    Raises
    ------
    Problem
        422 `invalid-trace`.
    """
    plane = record.recording.constrained_plane
    if not record.left_out:
        return
    if plane is None:  # of a table, in which a column says the plane of each impact
        detail = (
            f"The {words(record.left_out[0][0])} has not all its axes, and the impact names no plane of its motion."
        )
        error = PayloadError(detail=detail, code="missing", pointer="/kinematics/constrained_plane")
        raise Problem("invalid-trace", detail, errors=[error])
    errors = []
    for signal, axis in record.left_out:
        parts = _rotation(signal, record.recording)[:, AXES.index(axis)]
        heads = [head for head in _inside(signal, plane) if abs(parts[AXES.index(head)]) > _NO_PART]
        if heads:
            detail = (
                f"The {words(signal)}'s {axis} may not be left out: it is a part of the head's {' and '.join(heads)}, "
                f"inside the {plane} plane."
            )
            errors.append(PayloadError(detail=detail, code="missing", pointer=f"/kinematics/{signal}/{axis}"))
    if errors:
        raise Problem("invalid-trace", errors[0].detail, errors=errors)


def _rotation(signal: SignalName, recording: Recording) -> FloatArray:
    """What takes a signal to head axes; the signs of SAE J211's axes before it leave every part where it is."""
    mounting = recording.mounting
    if mounting is None:
        return np.eye(3)
    return mounting.accelerometer_rotation if signal == "linear_acceleration" else mounting.gyroscope_rotation


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
        given = [axis for axis in AXES if getattr(body, axis) is not None]
        turned = kinematics.location == "sensor"
        missing = missing_axes(name, given, kinematics.constrained_plane, turned=turned)
        yield from _signal(body, missing, f"/kinematics/{name}")


def _signal(body: SignalBody, missing: tuple[str, ...], place: str) -> Iterator[PayloadError]:
    if (body.sample_rate_hz is None) == (body.time_ms is None):
        yield PayloadError(
            detail="Exactly one of sample_rate_hz and time_ms is needed.", code="rate-or-times", pointer=place
        )
    for axis in missing:
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
