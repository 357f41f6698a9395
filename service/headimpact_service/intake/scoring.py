"""A record and the terms of its organisation in, the document of its score out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from headimpact.criteria.extra import EXTRA_CRITERIA
from headimpact.errors import OperatingPointUnreachable, TraceError
from headimpact.preparation import Preparation, prepare, prepare_many
from headimpact.quality import QualityNote
from headimpact.recording import Mounting, Recording, Signal
from headimpact.risk import (
    DEFAULT_OPERATING_POINTS,
    LAKSARI_2020,
    OperatingPoint,
    OperatingPointRequest,
    RiskModel,
    resolve_operating_point,
)
from headimpact.scoring import ImpactScore, score, score_many
from headimpact_service.errors import PayloadError, Problem
from headimpact_service.ingest.digest import input_digest
from headimpact_service.ingest.impact_rules import require_recorded
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.trace_errors import trace_problem
from headimpact_service.intake.parts import parts


@dataclass(frozen=True, slots=True)
class MissingPoint:
    """A default operating point that the model does not have, and why."""

    request: OperatingPointRequest
    reason: str


Points = tuple[OperatingPoint | MissingPoint, ...]


@dataclass(frozen=True)
class Terms:
    """What an organisation has its impacts scored with."""

    incidence: float | None = None
    operating_points: tuple[OperatingPointRequest, ...] = DEFAULT_OPERATING_POINTS
    model: RiskModel = LAKSARI_2020

    @cached_property
    def default_points(self) -> Points:
        """The thresholds of the organisation's operating points, each in its place, also where the model has none.

        A model that lacks one that was set is not promoted, but a sandbox or a score made anew may have another model.
        """
        return tuple(self._default(request) for request in self.operating_points)

    def _default(self, request: OperatingPointRequest) -> OperatingPoint | MissingPoint:
        try:
            return resolve_operating_point(request, self.model, self.incidence)
        except OperatingPointUnreachable as error:
            return MissingPoint(request, str(error))


@dataclass(frozen=True, slots=True)
class DeviceFacts:
    """What a device's own page says that a score depends on."""

    mounting: Mounting | None = None
    linear_acceleration_range_g: float | None = None
    angular_velocity_range_rad_s: float | None = None
    revision: int | None = None
    """Of the page; None where there is none."""


@dataclass(frozen=True, slots=True)
class Scored:
    """A record with its score, which is None where it must not be scored.

    `preparation`, the motion that was scored, is None there too, and where many were scored together.
    """

    record: ImpactRecord
    terms: Terms
    score: ImpactScore | None
    preparation: Preparation | None
    points: Points
    reasons: tuple[str, ...]
    sent_digest: bytes
    """SHA-256 of the kinematics as they were sent."""
    input_digest: bytes
    """SHA-256 of what the score depends on: the same, with the mounting of the device where that was needed."""


UNKNOWN_DEVICE = DeviceFacts()
TOGETHER = 1000
"""Records that are prepared and scored together, at most."""
NOT_WORN = QualityNote("not_worn", "note", "The device reports that it was not worn.")


def score_record(record: ImpactRecord, terms: Terms, device: DeviceFacts = UNKNOWN_DEVICE) -> Scored:
    """Score a record, or say why it must not be scored.

    Raises
    ------
    Problem
        422 for a record that breaks a rule, or that asks for what the model does not have.
    """
    asked = _asked(record, terms, device)
    if asked.reasons:
        return asked
    try:
        preparation = prepare(asked.record.recording)
    except TraceError as error:
        raise trace_problem(error, asked.record.recording) from None
    found = score(preparation, terms.model, incidence=terms.incidence, extra_criteria=asked.record.extra_criteria)
    return replace(asked, preparation=preparation, score=found)


def score_records(records: Iterable[tuple[ImpactRecord, DeviceFacts]], terms: Terms) -> list[Scored | Problem]:
    """Score many records together, with the same digits as one by one; what is wrong with one stands in its place.

    What they hold in memory beside the records is bounded: they are taken part by part, and their motion is let go.
    """
    return [item for part in parts(records, _values, TOGETHER) for item in _scored(part, terms)]


def _values(pair: tuple[ImpactRecord, DeviceFacts]) -> int:
    return pair[0].values


def _scored(records: Sequence[tuple[ImpactRecord, DeviceFacts]], terms: Terms) -> list[Scored | Problem]:
    """A part of them."""
    asked = [_asked_or_problem(record, terms, device) for record, device in records]
    to_score = [item for item in asked if isinstance(item, Scored) and not item.reasons]
    found = iter(_scores([item.record for item in to_score], terms))
    results: list[Scored | Problem] = []
    for item in asked:
        if isinstance(item, Problem) or item.reasons:
            results.append(item)
        else:
            result = next(found)
            results.append(result if isinstance(result, Problem) else _with_score(item, result))
    return results


def _with_score(item: Scored, found: ImpactScore) -> Scored:
    """Field by field: `dataclasses.replace` takes four times as long, as often as there are impacts."""
    return Scored(item.record, item.terms, found, None, item.points, item.reasons, item.sent_digest, item.input_digest)


def _scores(records: Sequence[ImpactRecord], terms: Terms) -> list[ImpactScore | Problem]:
    """The score of each, those that are asked for the same extra criteria together, or the problem that it met."""
    results: dict[int, ImpactScore | Problem] = {}
    batches: dict[tuple[str, ...], list[tuple[int, Preparation]]] = {}
    for index, preparation in enumerate(prepare_many([record.recording for record in records])):
        if isinstance(preparation, TraceError):
            results[index] = trace_problem(preparation, records[index].recording)
        else:
            batches.setdefault(records[index].extra_criteria, []).append((index, preparation))
    for extra, members in batches.items():
        preparations = [preparation for _, preparation in members]
        scores = score_many(preparations, terms.model, incidence=terms.incidence, extra_criteria=extra)
        results.update((index, found) for (index, _), found in zip(members, scores, strict=True))
    return [results[index] for index in range(len(records))]


def _asked_or_problem(record: ImpactRecord, terms: Terms, device: DeviceFacts) -> Scored | Problem:
    try:
        return _asked(record, terms, device)
    except Problem as problem:
        return problem


def _asked(record: ImpactRecord, terms: Terms, device: DeviceFacts) -> Scored:
    """What is asked of a record, with what its device adds; not prepared yet, and never if there are reasons."""
    points = operating_points(record.operating_points, terms)
    _require_known(record.extra_criteria)
    sent_digest = input_digest(record)
    needed_device = record.needs_device_mounting
    record = with_device(record, device)
    require_recorded(record)
    if record.context.get("worn") is False:
        record = replace(record, notes=(*record.notes, NOT_WORN))
    digest = input_digest(record) if needed_device else sent_digest
    return Scored(record, terms, None, None, points, record.unscorable, sent_digest, digest)


def _require_known(extra_criteria: Sequence[str]) -> None:
    for index, name in enumerate(extra_criteria):
        if name not in EXTRA_CRITERIA:
            detail = f"Extra criteria are {', '.join(EXTRA_CRITERIA)}."
            error = PayloadError(detail=detail, code="not-allowed", pointer=f"/extra_criteria/{index}")
            raise Problem("invalid-payload", detail, errors=[error])


def with_device(record: ImpactRecord, device: DeviceFacts) -> ImpactRecord:
    """The record with what its context and its device's page add: the ranges and the mounting where it has none."""
    recording = record.recording
    if record.needs_device_mounting:
        if device.mounting is None:
            raise mounting_missing()
        recording = replace(recording, mounting=device.mounting)
    context = record.context
    recording = _with_ranges(
        recording,
        context.get("linear_acceleration_range_g") or device.linear_acceleration_range_g,
        context.get("angular_velocity_range_rad_s") or device.angular_velocity_range_rad_s,
    )
    return (
        record if recording is record.recording else replace(record, recording=recording, needs_device_mounting=False)
    )


def mounting_missing() -> Problem:
    """The 422 for signals of the sensor whose place on the head nobody has said."""
    detail = "Signals of the sensor need a mounting, inline or of the device."
    error = PayloadError(detail=detail, code="mounting-missing", pointer="/kinematics/mounting")
    return Problem("mounting-missing", detail, errors=[error])


def _with_ranges(recording: Recording, range_g: float | None, range_rad_s: float | None) -> Recording:
    linear = _with_range(recording.linear_acceleration, range_g, "g")
    angular = _with_range(recording.angular_velocity, range_rad_s, "rad/s")
    if linear is recording.linear_acceleration and angular is recording.angular_velocity:
        return recording
    return replace(recording, linear_acceleration=linear, angular_velocity=angular)


def _with_range(signal: Signal | None, full_scale: float | None, unit: str) -> Signal | None:
    if signal is None or full_scale is None or signal.declared_range is not None:
        return signal
    return replace(signal, declared_range=full_scale * _PER_UNIT[signal.unit] / _PER_UNIT[unit])


# How many of a unit make one of the criteria's.
_PER_UNIT = {"g": 1.0, "m/s^2": 9.80665, "rad/s": 1.0, "deg/s": 57.29577951308232}


def requests_of(stored: Iterable[Mapping[str, object]]) -> tuple[OperatingPointRequest, ...]:
    """The operating points that an organisation has set, as its settings keep them."""
    return tuple(OperatingPointRequest(**point) for point in stored)  # type: ignore[arg-type]  # stored as it was validated


def terms_of(incidence: float | None, points: Iterable[Mapping[str, object]], model: RiskModel) -> Terms:
    """The terms of an organisation, from its settings as they are kept, and the model in service."""
    return Terms(incidence, requests_of(points) or DEFAULT_OPERATING_POINTS, model)


def operating_points(asked: Sequence[OperatingPointRequest] | None, terms: Terms) -> Points:
    """The thresholds that were asked for, in that order; the organisation's default where none were.

    Raises
    ------
    Problem
        422 `operating-point-unreachable` for one that was asked for and that the model does not have.
    """
    if asked is None:
        return terms.default_points
    return tuple(_point(request, terms, index) for index, request in enumerate(asked))


def _point(request: OperatingPointRequest, terms: Terms, index: int) -> OperatingPoint:
    try:
        return resolve_operating_point(request, terms.model, terms.incidence)
    except OperatingPointUnreachable as error:
        fault = PayloadError(
            detail=str(error), code="operating-point-unreachable", pointer=f"/operating_points/{index}"
        )
        raise Problem("operating-point-unreachable", str(error), errors=[fault]) from None
