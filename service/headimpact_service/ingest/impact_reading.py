"""A JSON body into a record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isnan
from typing import Any, TypeVar

import numpy as np

from headimpact.cut_offs import NO_FILTER, PAPER, LowPass
from headimpact.errors import TraceError
from headimpact.quality import QualityNote, check_reported_peak
from headimpact.recording import (
    AXES,
    SIGNALS,
    FloatArray,
    Mounting,
    Recording,
    Signal,
    SignalName,
    require_proper_rotation,
)
from headimpact.risk import OperatingPointRequest
from headimpact_service.errors import MAX_ERRORS, PayloadError, Problem
from headimpact_service.ingest import impact_rules
from headimpact_service.ingest.filling import FILLED
from headimpact_service.ingest.impact_json import (
    AthleteRef,
    FilterBody,
    ImpactBody,
    Kinematics,
    MountingBody,
    ScoreBody,
    SignalBody,
)
from headimpact_service.ingest.json_faults import parse, rules_problem
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.stamps import before_zero_ms, may_be_stated, nominal_rate

Body = TypeVar("Body", bound=ScoreBody)


def read_impact(data: bytes) -> ImpactRecord:
    """The body of an impact to be stored, validated in one pass; :class:`Problem` 400 or 422 otherwise."""
    return to_record(parse(data, ImpactBody))


def read_score(data: bytes) -> ImpactRecord:
    """The body of an impact to be scored only."""
    return to_record(parse(data, ScoreBody))


def to_record(body: ScoreBody, *, time_zone: str | None = None, what: str = "body") -> ImpactRecord:
    """A valid body as a record, once the rules between its fields hold."""
    occurred_at, late = impact_rules.occurred_at(body, time_zone)
    broken = impact_rules.faults(body) + late
    if broken:
        raise rules_problem(broken, what=what)
    athlete: AthleteRef | None = getattr(body, "athlete", None)
    unscorable: list[str] | None = getattr(body, "unscorable", None)
    kinematics = body.kinematics
    sent = recording(kinematics)
    if not kinematics.fill_gaps and unscorable is None:
        _require_whole(sent, what)
    return ImpactRecord(
        recording=sent,
        external_id=body.external_id,
        athlete_id=None if athlete is None else athlete.id,
        athlete_external_id=None if athlete is None else athlete.external_id,
        occurred_at=occurred_at,
        device_serial=None if body.device is None else body.device.serial,
        context={} if body.context is None else body.context.model_dump(exclude_none=True),
        metadata={"format": "json"},
        notes=tuple(_reported(kinematics, sent)),
        unscorable=tuple(unscorable or ()),
        left_out=_left_out(kinematics, sent),
        needs_device_mounting=kinematics.location == "sensor" and kinematics.mounting is None,
        operating_points=_operating_points(body),
        include=tuple(body.include or ()),
        extra_criteria=tuple(body.extra_criteria or ()),
    )


def recording(kinematics: Kinematics) -> Recording:
    """The kinematics of a body as the science takes them."""
    stamps = {
        name: np.array(body.time_ms) / 1000.0
        for name in SIGNALS
        if (body := getattr(kinematics, name)) is not None and body.time_ms is not None
    }
    rates = _rates(kinematics, stamps)
    signals: dict[SignalName, Signal | None] = {
        name: _signal(getattr(kinematics, name), stamps.get(name), rates.get(name)) for name in SIGNALS
    }
    return Recording(
        **signals,
        axes=kinematics.axes,
        mounting=None if kinematics.mounting is None else mounting(kinematics.mounting),
        constrained_plane=kinematics.constrained_plane,
        low_pass=low_pass(kinematics.filter),
        pre_trigger_ms=_pre_trigger_ms(kinematics),
        fill_gaps=kinematics.fill_gaps,
    )


def _pre_trigger_ms(kinematics: Kinematics) -> float | None:
    """The time before the trigger: as it is said, null for not known; where nothing is said, by the stamps."""
    if "pre_trigger_ms" in kinematics.model_fields_set:
        return kinematics.pre_trigger_ms
    stamps = [body.time_ms for body in _signals(kinematics) if body.time_ms is not None]
    return before_zero_ms((of_one[0], of_one[-1]) for of_one in stamps) if stamps else None


def _signals(kinematics: Kinematics) -> list[SignalBody]:
    bodies = (kinematics.linear_acceleration, kinematics.angular_velocity, kinematics.angular_acceleration)
    return [body for body in bodies if body is not None]


def _require_whole(sent: Recording, what: str) -> None:
    """Refuse null among samples: every one of them, up to the number of errors that an answer holds."""
    errors: list[PayloadError] = []
    for name, signal in sent.signals():
        # One sum is half the cost of looking at every sample.
        if isnan(signal.values.sum()):
            for axis, index in np.argwhere(np.isnan(signal.values.T)).tolist():
                place = f"/kinematics/{name}/{AXES[axis]}/{index}"
                errors.append(PayloadError(detail=f"A number is needed; {FILLED}.", code="wrong-type", pointer=place))
    if errors:
        raise rules_problem(errors[:MAX_ERRORS], what=what, count=len(errors))


def _left_out(kinematics: Kinematics, sent: Recording) -> tuple[tuple[SignalName, str], ...]:
    """The components that a plane of motion made needless."""
    if kinematics.constrained_plane is None:
        return ()
    bodies = ((name, getattr(kinematics, name)) for name, _ in sent.signals())
    return tuple((name, axis) for name, body in bodies for axis in AXES if getattr(body, axis) is None)


def _reported(kinematics: Kinematics, sent: Recording) -> Iterator[QualityNote]:
    """Where the device's own peaks are not those of its samples."""
    for name, signal in sent.signals():
        reported: float | None = getattr(kinematics, name).peak_resultant
        if reported is not None:
            yield from check_reported_peak(name, signal.unit, reported, signal.values)


def low_pass(choice: str | FilterBody) -> LowPass:
    """The filters that a request names."""
    if isinstance(choice, FilterBody):
        return LowPass(linear_acceleration=choice.linear_acceleration, angular_velocity=choice.angular_velocity)
    return PAPER if choice == "paper" else NO_FILTER


def mounting(body: MountingBody, place: str = "/kinematics/mounting") -> Mounting:
    """A mounting of a request; 422 `improper-rotation`, pointing below `place`, for a matrix that is no rotation."""
    gyroscope = body.gyroscope or body.accelerometer
    _require_rotation(body.accelerometer.rotation, "accelerometer", place)
    _require_rotation(gyroscope.rotation, "gyroscope" if body.gyroscope else "accelerometer", place)
    return Mounting(
        accelerometer_rotation=np.array(body.accelerometer.rotation),
        gyroscope_rotation=np.array(gyroscope.rotation),
        offset_m=np.array(body.accelerometer.offset_mm) / 1000.0,
        accelerometer_delay_s=body.accelerometer.delay_ms / 1000.0,
        gyroscope_delay_s=gyroscope.delay_ms / 1000.0,
    )


def _require_rotation(rotation: list[list[float]], sensor: str, place: str) -> None:
    try:
        require_proper_rotation(np.array(rotation), sensor)
    except TraceError as error:
        fault = PayloadError(detail=str(error), code=error.code, pointer=f"{place}/{sensor}/rotation")
        raise Problem("improper-rotation", str(error), errors=[fault]) from None


def _rates(kinematics: Kinematics, stamps: Mapping[SignalName, FloatArray]) -> dict[SignalName, float | None]:
    """The rates that stand for stamps; none where stamps have to show when a signal begins, or that rates are one."""
    if not stamps or not _share_their_start(kinematics):
        return {}
    rates = {name: nominal_rate(stamps_s) for name, stamps_s in stamps.items()}
    return rates if may_be_stated(rates.values()) else {}


def _share_their_start(kinematics: Kinematics) -> bool:
    """Whether every signal starts at one instant: only then may stamps be replaced by the rate that they say."""
    starts = {None if body.time_ms is None else body.time_ms[0] for body in _signals(kinematics)}
    return len(starts) == 1


def _signal(body: Any, stamps_s: FloatArray | None, rate: float | None) -> Signal | None:  # noqa: ANN401 - one of three bodies, each with its unit
    if body is None:
        return None
    values = _samples(body)
    if stamps_s is None:
        rate = body.sample_rate_hz
    times = stamps_s if rate is None else None
    return Signal(values=values, unit=body.unit, sample_rate_hz=rate, time_s=times, declared_range=body.range)


def _samples(body: SignalBody) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The components side by side; one that a constrained plane leaves out is zero."""
    if body.x is not None and body.y is not None and body.z is not None:
        return np.ascontiguousarray(np.array((body.x, body.y, body.z), dtype=np.float64).T)
    given = {axis: samples for axis in AXES if (samples := getattr(body, axis)) is not None}
    values = np.zeros((len(next(iter(given.values()))), 3))
    for column, axis in enumerate(AXES):
        if axis in given:
            values[:, column] = given[axis]
    return values


def _operating_points(body: ScoreBody) -> tuple[OperatingPointRequest, ...] | None:
    if body.operating_points is None:
        return None
    return tuple(
        OperatingPointRequest(
            criterion=point.criterion,
            sensitivity=point.sensitivity,
            specificity=point.specificity,
            threshold=point.threshold,
        )
        for point in body.operating_points
    )
