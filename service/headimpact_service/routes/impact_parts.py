"""What hangs on an impact: its traces and all of its scores."""

from __future__ import annotations

from datetime import datetime
from functools import partial
from typing import Annotated, Any, Literal

from anyio.to_thread import run_sync
from pydantic import Field, RootModel
from starlette.responses import Response

from headimpact.preparation import prepare
from headimpact.recording import Recording
from headimpact_service import deps
from headimpact_service.answers import answer
from headimpact_service.errors import PayloadError, Problem, not_found
from headimpact_service.ingest.impact_json import MAX_OPERATING_POINTS, OperatingPointBody, Strict, Word
from headimpact_service.intake.records import raw_traces, rebuild_record
from headimpact_service.intake.registry import model_of
from headimpact_service.intake.rendering import brain_trace, head_traces, new_score, score_document
from headimpact_service.intake.scoring import Terms, operating_points, score_record
from headimpact_service.operation import Answer, Call, Routes
from headimpact_service.parameters import ListQuery, Query
from headimpact_service.routes.impact_shapes import SCORE_COLUMNS, SCORE_NUMBERS, score_cells
from headimpact_service.routes.impacts import identifier, present
from headimpact_service.routes.lists import MEDIA_TYPES, answer_list
from headimpact_service.routes.models import Version
from headimpact_service.routes.operating_points import requests_of
from headimpact_service.routes.score_shapes import ScoreView, Shape, TraceView
from headimpact_service.routes.short_lists import short_listing
from headimpact_service.store import impacts, scores, traces
from headimpact_service.store.impact_rows import Impact
from headimpact_service.store.score_rows import Score

routes = Routes("impacts")


class RawTraceView(TraceView):
    """A signal as it was sent; null where a sample is missing."""

    x: list[float | None]  # type: ignore[assignment] # what was scored has no such samples
    y: list[float | None]  # type: ignore[assignment]  # what was scored has no such samples
    z: list[float | None]  # type: ignore[assignment]  # what was scored has no such samples
    sample_rate_hz: float | None
    time_ms: list[float] | None


class RawTracesView(Shape):
    """The signals as they were sent: the members of a request's kinematics."""

    frame: Literal["raw"]
    revision: int
    linear_acceleration: RawTraceView | None
    angular_velocity: RawTraceView | None
    angular_acceleration: RawTraceView | None


class HeadTracesView(Shape):
    """The filtered motion of the head's centre of gravity, in anatomical axes, that the score was read from."""

    frame: Literal["head"]
    revision: int
    sample_rate_hz: float
    start_time_ms: float
    linear_acceleration: TraceView | None
    angular_velocity: TraceView | None
    angular_acceleration: TraceView | None


class BrainTracesView(Shape):
    """The brain's angle relative to the skull; null without rotation."""

    frame: Literal["brain"]
    revision: int
    sample_rate_hz: float
    start_time_ms: float
    brain_angle: TraceView | None


class TracesView(RootModel[RawTracesView | HeadTracesView | BrainTracesView]):
    """Traces in the frame that was asked for."""


class TracesQuery(Query):
    """Which traces."""

    frame: Annotated[
        Literal["raw", "head", "brain"],
        Field(description="As sent, at the head's centre of gravity after filtering, or the brain's angle."),
    ] = "raw"


@routes(
    "GET",
    "/v1/impacts/{impact_id}/traces",
    "Read an impact's traces",
    "impacts:read",
    {200: Answer(TracesView, "The traces.")},
    query=TracesQuery,
    problems=("not-found", "conflict"),
)
async def read_traces(call: Call) -> Response:
    """Raw traces come back as they were sent, to the last bit. 409 for a frame that an unscorable record has not."""
    query: TracesQuery = call.query
    impact, stored = await _with_trace(call)
    render = {"raw": _raw, "head": _head, "brain": _brain}[query.frame]
    document = await run_sync(partial(render, impact, stored))
    return answer({"frame": query.frame, "revision": impact.revision, **document})


async def _with_trace(call: Call) -> tuple[Impact, bytes]:
    impact_id = identifier(call)

    def query(conn: Any) -> tuple[Impact | None, impacts.Trace | None]:  # noqa: ANN401 - a connection of the store
        return impacts.get(conn, call.data_set_id, impact_id), impacts.trace(conn, call.data_set_id, impact_id)

    impact, trace = await deps.read(call.request, query)
    if impact is None or impact.document is None or trace is None:
        raise not_found("impact")
    return impact, trace.signals


def _raw(impact: Impact, stored: bytes) -> dict[str, Any]:
    return raw_traces(impact.document or {}, traces.decode(stored))


def _head(impact: Impact, stored: bytes) -> dict[str, Any]:
    return head_traces(prepare(_scorable(impact, stored)).kinematics)


def _brain(impact: Impact, stored: bytes) -> dict[str, Any]:
    kinematics = prepare(_scorable(impact, stored)).kinematics
    times = {"sample_rate_hz": kinematics.sample_rate_hz, "start_time_ms": kinematics.start_time_ms}
    return {**times, "brain_angle": brain_trace(kinematics)}


def _scorable(impact: Impact, stored: bytes) -> Recording:
    record = rebuild_record(impact.document or {}, traces.decode(stored))
    if record.unscorable:
        raise Problem("conflict", "The record must not be scored, so only its raw traces exist.")
    return record.recording


class StoredScoreView(ScoreView):
    """A score of an impact."""

    number: int = Field(description="Counts the scores of the impact.")
    revision: int = Field(description="The impact's revision that it was made from.")
    current: bool = Field(description="Whether it stands for the impact.")
    created_at: datetime


class StoredScoreList(Shape):
    """A page of an impact's scores, oldest first."""

    data: list[StoredScoreView]
    next_cursor: str | None


class NewScoreBody(Strict):
    """A score to be made anew from what is stored, under the organisation's present settings."""

    model: Version = Field(description="Version of a model.")
    operating_points: Annotated[list[OperatingPointBody], Field(max_length=MAX_OPERATING_POINTS)] | None = None
    extra_criteria: Annotated[list[Word], Field(max_length=32)] | None = None
    make_current: bool = Field(default=False, description="Whether it stands for the impact from now on.")


@routes(
    "GET",
    "/v1/impacts/{impact_id}/scores",
    "List an impact's scores",
    "impacts:read",
    {200: Answer(StoredScoreList, "A page of scores, oldest first.", MEDIA_TYPES)},
    query=ListQuery,
    problems=("not-found", "bad-cursor"),
)
async def list_scores(call: Call) -> Response:
    """Those of revisions before and of other models too."""
    impact = await present(call)
    current = None if impact.score is None else impact.score.number
    listing = short_listing(
        f"scores {impact.id.hex()}",
        lambda conn: scores.list_all(conn, call.data_set_id, impact.id),
        lambda score: _document(score, current=score.number == current),
        "number",
        (*_PLACE, *SCORE_COLUMNS),
        cells=lambda score: [*_place(score, current=score.number == current).values(), *score_cells(score)],
        numbers=SCORE_NUMBERS,
        flags=frozenset({"current"}),
    )
    return await answer_list(call, listing, call.query)


@routes(
    "POST",
    "/v1/impacts/{impact_id}/scores",
    "Score an impact again",
    "impacts:write",
    {201: Answer(StoredScoreView, "The new score."), 200: Answer(StoredScoreView, "The same score was there.")},
    body=NewScoreBody,
    example={"model": "laksari-2020"},
    problems=("not-found", "operating-point-unreachable"),
)
async def create_score(call: Call) -> Response:
    """From the stored trace, so the same model under the same settings gives the same digits."""
    body: NewScoreBody = call.body
    impact, stored = await _with_trace(call)
    terms = await _terms(call, body)
    new = await run_sync(partial(_scored_again, impact, stored, terms, tuple(body.extra_criteria or ())))
    score, made = await deps.write(
        call.request,
        lambda conn: scores.add(conn, call.data_set_id, impact.id, new, make_current=body.make_current),
    )
    now = await present(call)
    current = now.score is not None and now.score.number == score.number
    return answer(_document(score, current=current), 201 if made else 200)


async def _terms(call: Call, body: NewScoreBody) -> Terms:
    try:
        model = await deps.read(call.request, lambda conn: model_of(conn, call.data_set_id, body.model))
    except Problem:
        detail = "There is no model with this version; GET /v1/models lists them."
        error = PayloadError(detail=detail, code="unknown-model", pointer="/model")
        raise Problem("invalid-payload", detail, errors=[error]) from None
    present_terms = (await call.renewed()).terms
    asked = body.operating_points
    points = present_terms.operating_points if asked is None else requests_of(asked)
    terms = Terms(incidence=present_terms.incidence, operating_points=points, model=model)
    if asked is not None:
        operating_points(points, terms)  # one that was asked for is refused where the model lacks it
    return terms


def _scored_again(impact: Impact, stored: bytes, terms: Terms, extra: tuple[str, ...]) -> scores.NewScore:
    record = rebuild_record(impact.document or {}, traces.decode(stored), extra_criteria=extra)
    return new_score(score_record(record, terms))


_PLACE = ("number", "revision", "current", "created_at")


def _document(score: Score, *, current: bool) -> dict[str, Any]:
    return score_document(score) | _place(score, current=current)


def _place(score: Score, *, current: bool) -> dict[str, Any]:
    """The members of :data:`_PLACE`."""
    return dict(zip(_PLACE, (score.number, score.revision, current, score.created_at), strict=True))
