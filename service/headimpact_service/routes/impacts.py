"""Impacts: sent once, read, listed, corrected with their revisions kept, deleted with a tombstone left."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, WithJsonSchema
from starlette.responses import Response

from headimpact.quality import CODES
from headimpact_service import deps, examples
from headimpact_service.answers import JSON, answer, json_bytes, no_content
from headimpact_service.errors import invalid_parameter, not_found
from headimpact_service.ingest.digest import content_digest
from headimpact_service.ingest.impact_json import CriterionKey, ImpactBody, Name
from headimpact_service.ingest.impact_reading import to_record
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.intake.exporting import CONTEXT_FLAGS
from headimpact_service.intake.rendering import as_asked, scored_traces
from headimpact_service.intake.scoring import Scored
from headimpact_service.intake.storing import new_impact
from headimpact_service.operation import Answer, Call, Routes
from headimpact_service.parameters import Instant, Probability, SyncQuery
from headimpact_service.routes.impact_shapes import (
    COLUMNS,
    NUMBERS,
    ImpactList,
    ImpactView,
    impact_cells,
    impact_document,
    shown_to,
)
from headimpact_service.routes.lists import MEDIA_TYPES, Listing, answer_list
from headimpact_service.routes.preconditions import IF_MATCH, etag, if_match
from headimpact_service.routes.scoring import RECORD_PROBLEMS, score
from headimpact_service.routes.trace_export import trace_form, with_samples
from headimpact_service.store import impacts
from headimpact_service.store.impact_rows import NewImpact, Outcome, ScoreOutdated
from headimpact_service.store.impacts import Impact, ImpactFilters

routes = Routes("impacts")

TRIES = 20
"""How often an impact is scored before it is answered that what it depends on keeps changing."""
ETAG = {"ETag": "The revision, for If-Match."}
LOCATION = {"Location": "The impact's address."}


@routes(
    "POST",
    "/v1/impacts",
    "Send an impact",
    "impacts:write",
    {
        201: Answer(ImpactView, "Stored, with its score.", headers=ETAG | LOCATION),
        200: Answer(ImpactView, "It was stored before, with this content.", headers=ETAG | LOCATION),
    },
    body=ImpactBody,
    example=examples.impact(),
    problems=(*RECORD_PROBLEMS, "not-found", "external-id-conflict", "impact-deleted"),
)
async def create_impact(call: Call) -> Response:
    """Committed before the answer. With an `external_id` it is safe to send again: 200 for the same content.

    What is sent again is answered with the operating points and extra criteria that it asks for; stored are those of
    the first time.
    """
    outcome, scored = await _stored(call, lambda new, conn: impacts.add(conn, call.data_set_id, new))
    if outcome.status == "created":
        return _answer(call, outcome.impact, 201, scored)
    return _answer(call, outcome.impact, 200, scored, redelivered=True)


async def _stored(call: Call, change: Callable[[NewImpact, Any], Outcome]) -> tuple[Outcome, Scored]:
    """What became of the impact in the body, and its score.

    What a score depends on is remembered for a moment, in which another process may change it: then it is made anew.
    """
    record = to_record(call.body)
    tries = 0
    while True:
        scored, new = await _scored(call, record)
        try:
            return await deps.write_short(call.request, partial(change, new)), scored
        except ScoreOutdated:
            tries += 1
            if tries == TRIES:
                raise
        call.request.app.state.facts.forget_those_of(call, record)
        call = await call.renewed()


async def _scored(call: Call, record: ImpactRecord) -> tuple[Scored, NewImpact]:
    """The record's score, and the rows of both."""
    scored, seen = await score(call, record)
    return scored, new_impact(scored, content_digest(record, scored.sent_digest), call.key.id, seen)


def _answer(call: Call, impact: Impact, status: int, scored: Scored, *, redelivered: bool = False) -> Response:
    document = impact_document(shown_to(call.key, impact))
    if redelivered and impact.score is not None:
        as_asked(document["score"], impact.score, scored)
    if "traces" in scored.record.include:
        document["score"]["traces"] = scored_traces(scored)
    headers = {**etag(impact.revision), "Location": f"/v1/impacts/{document['id']}"}
    return answer(json_bytes(document), status, headers)


def _known_code(code: str) -> str:
    if code not in CODES:
        raise ValueError(f"A quality note is one of: {', '.join(CODES)}.")
    return code


QualityCode = Annotated[str, AfterValidator(_known_code), WithJsonSchema({"type": "string", "enum": list(CODES)})]


class ImpactQuery(SyncQuery):
    """Which impacts."""

    athlete_id: Name | None = Field(None, description="Of this athlete.")
    external_id: Name | None = Field(None, description="The one that you call this.")
    device_serial: Name | None = Field(None, description="From this device.")
    session_id: Name | None = Field(None, description="Of this session.")
    occurred_from: Annotated[Instant | None, Field(description="At this time or later.")] = None
    occurred_to: Annotated[Instant | None, Field(description="Before this time.")] = None
    quality: QualityCode | None = Field(None, description="With this quality note.")
    criterion: Annotated[CriterionKey | None, Field(description="The one that `min_probability` is about.")] = None
    min_probability: Annotated[
        Probability | None, Field(description="Where `criterion` gives at least this probability.")
    ] = None
    include: Annotated[
        Literal["traces"] | None,
        Field(description="In a table: impacts with their samples, to be imported elsewhere; no scores."),
    ] = None


@routes(
    "GET",
    "/v1/impacts",
    "List impacts",
    "impacts:read",
    {200: Answer(ImpactList, "A page of impacts, newest first.", MEDIA_TYPES)},
    query=ImpactQuery,
    problems=("bad-cursor",),
)
async def list_impacts(call: Call) -> Response:
    """With `updated_since` in the order of change, deleted impacts as tombstones.

    Filters see what impacts are now: one that moved to another athlete leaves the first one's list without a tombstone.

    What labels say (`outcome`, in tables `event` too) is shown to keys with the scope `labels:read`.

    With `include=traces`, NDJSON holds an impact a line as `POST /v1/imports` takes it, CSV and Parquet a sample a row.
    """
    query: ImpactQuery = call.query
    filters = _filters(query)
    traces = query.include is not None
    if traces and call.media_type == JSON:
        raise invalid_parameter("include", "Traces are listed as NDJSON, CSV or Parquet: name one in Accept.", "accept")
    listing = Listing(
        "impacts",
        lambda conn, after, limit: impacts.page(
            conn, call.data_set_id, filters, updated_since=query.updated_since, limit=limit, after=after
        ),
        lambda impact: impact_document(shown_to(call.key, impact)),
        COLUMNS,
        lambda impact: impact_cells(shown_to(call.key, impact)),
        numbers=NUMBERS,
        flags=CONTEXT_FLAGS,
        form=trace_form if traces else None,
        parts=partial(with_samples, call) if traces else None,
    )
    return await answer_list(call, listing, query)


def _filters(query: ImpactQuery) -> ImpactFilters:
    if (query.criterion is None) != (query.min_probability is None):
        raise invalid_parameter("criterion", "criterion and min_probability go together.", "one-of")
    probability = None
    if query.criterion is not None and query.min_probability is not None:
        probability = (query.criterion, query.min_probability)
    return ImpactFilters(
        athlete_id=None if query.athlete_id is None else deps.filter_identifier("ath", query.athlete_id),
        external_id=query.external_id,
        device_serial=query.device_serial,
        session_id=query.session_id,
        occurred_from=query.occurred_from,
        occurred_to=query.occurred_to,
        quality_code=query.quality,
        min_probability=probability,
    )


@routes(
    "GET",
    "/v1/impacts/{impact_id}",
    "Read an impact",
    "impacts:read",
    {200: Answer(ImpactView, "The impact with its score.", headers=ETAG)},
    problems=("not-found",),
)
async def read_impact(call: Call) -> Response:
    """The same as the answer to the POST or PUT that stored it, without traces."""
    found = await present(call)
    return answer(impact_document(shown_to(call.key, found)), headers=etag(found.revision))


async def present(call: Call) -> Impact:
    """The impact in the path; 404 if it is none of the caller's, or deleted."""
    impact_id = identifier(call)
    found = await deps.read(call.request, lambda conn: impacts.get(conn, call.data_set_id, impact_id))
    if found is None:
        raise not_found("impact")
    return found


def identifier(call: Call) -> bytes:
    """The impact's identifier in the path."""
    return deps.identifier("imp", call.path("impact_id"), "impact")


@routes(
    "PUT",
    "/v1/impacts/{impact_id}",
    "Correct an impact",
    "impacts:write",
    {200: Answer(ImpactView, "The impact as it is now.", headers=ETAG | LOCATION)},
    body=ImpactBody,
    example=examples.impact(),
    request_headers=IF_MATCH,
    problems=(
        *RECORD_PROBLEMS,
        "not-found",
        "conflict",
        "external-id-conflict",
        "precondition-failed",
        "precondition-required",
    ),
)
async def correct_impact(call: Call) -> Response:
    """The whole impact anew, also under another athlete (swapped sensors). The revision before is kept.

    It is scored with the device's page as it is now, also where only the context is new: the same body is a correction
    once the device's mounting or ranges were changed. To keep the mounting of before, send it inline. Other operating
    points or extra criteria alone are no correction: they are answered, and what is stored stays as it is.
    """
    impact_id, revision = identifier(call), if_match(call.request, required=True)
    await present(call)
    outcome, scored = await _stored(
        call, lambda new, conn: impacts.correct(conn, call.data_set_id, impact_id, new, if_match=revision)
    )
    return _answer(call, outcome.impact, 200, scored, redelivered=outcome.status == "unchanged")


@routes(
    "DELETE",
    "/v1/impacts/{impact_id}",
    "Delete an impact",
    "impacts:write",
    {204: Answer(None, "Deleted; a tombstone is left.", ())},
    request_headers=IF_MATCH,
    problems=("not-found", "precondition-failed"),
)
async def delete_impact(call: Call) -> Response:
    """Trace, score and revisions go. Its `external_id` stays taken, so that a redelivery does not bring it back."""
    impact_id, revision = identifier(call), if_match(call.request)
    await deps.write(call.request, lambda conn: impacts.delete(conn, call.data_set_id, impact_id, if_match=revision))
    return no_content()
