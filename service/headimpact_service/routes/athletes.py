"""Athletes: pseudonymous people. To delete one is to erase identity, traces and scores."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from anyio.to_thread import run_sync
from pydantic import BaseModel, Field
from starlette.responses import Response

from headimpact_service import deps
from headimpact_service.answers import answer, no_content
from headimpact_service.ingest.impact_json import Name, Strict, Word, Zone
from headimpact_service.operation import Answer, Call, Routes
from headimpact_service.parameters import SyncQuery
from headimpact_service.routes.lists import MEDIA_TYPES, Listing, answer_list
from headimpact_service.routes.preconditions import IF_MATCH, etag, if_match
from headimpact_service.routes.tables import Cell
from headimpact_service.store import athletes, diagnoses, ids
from headimpact_service.store.athletes import Athlete, AthleteFields

routes = Routes("athletes")


class AthleteBody(Strict):
    """What is known of an athlete; no name and no date of birth belong here. Null clears a field."""

    external_id: Name | None = Field(None, description="Your pseudonymous id.", examples=["p-17"])
    tags: Annotated[list[Word], Field(max_length=50)] | None = Field(None, examples=[["varsity"]])
    sport: Word | None = Field(None, examples=["american_football"])
    level: Word | None = Field(None, examples=["collegiate"])
    position: Word | None = Field(None, examples=["LB"])
    sex: Literal["male", "female", "other"] | None = None
    birth_year: Annotated[int, Field(ge=1900, le=2100)] | None = None
    time_zone: Zone | None = Field(None, description="IANA zone of the athlete's days.", examples=["Europe/Dublin"])
    consent: Literal["granted", "withdrawn"] | None = None


class AthleteView(BaseModel):
    """An athlete."""

    id: str
    external_id: str | None
    tags: list[str]
    sport: str | None
    level: str | None
    position: str | None
    sex: str | None
    birth_year: int | None
    time_zone: str | None
    consent: str | None
    revision: int
    created_at: datetime
    updated_at: datetime


class AthleteTombstone(BaseModel):
    """What is left of an erased athlete."""

    id: str
    revision: int
    updated_at: datetime
    deleted_at: datetime
    merged_into: str | None = Field(description="The athlete who has the impacts now, where two were merged.")


class AthleteList(BaseModel):
    """A page of athletes; with `updated_since` erased ones among them, as tombstones."""

    data: list[AthleteView | AthleteTombstone]
    next_cursor: str | None


class AthleteQuery(SyncQuery):
    """Which athletes."""

    external_id: Name | None = Field(None, description="Your id of one, also one that was merged into another.")


ETAG = {"ETag": "The revision, for If-Match."}
_FIELDS = tuple(AthleteBody.model_fields)


@routes(
    "POST",
    "/v1/athletes",
    "Make an athlete",
    "athletes:write",
    {201: Answer(AthleteView, "The new athlete.", headers=ETAG | {"Location": "Its address."})},
    body=AthleteBody,
    problems=("external-id-conflict",),
)
async def create_athlete(call: Call) -> Response:
    """Not needed before impacts are sent: an impact makes its athlete on first sight."""
    fields = AthleteFields(**_stored(call.body.model_dump()))
    made = await deps.write(call.request, lambda conn: athletes.create(conn, call.data_set_id, fields))
    shown = document(made)
    return answer(shown, 201, etag(made.revision) | {"Location": f"/v1/athletes/{shown['id']}"})


@routes(
    "GET",
    "/v1/athletes",
    "List athletes",
    "athletes:read",
    {200: Answer(AthleteList, "A page of athletes, newest first.", MEDIA_TYPES)},
    query=AthleteQuery,
    problems=("bad-cursor",),
)
async def list_athletes(call: Call) -> Response:
    """With `updated_since` in the order of change, erased athletes as tombstones."""
    query: AthleteQuery = call.query
    listing = Listing(
        "athletes",
        lambda conn, after, limit: athletes.page(
            conn,
            call.data_set_id,
            external_id=query.external_id,
            updated_since=query.updated_since,
            limit=limit,
            after=after,
        ),
        document,
        ("id", *_FIELDS, "revision", "created_at", "updated_at", "deleted_at"),
        _cells,
    )
    return await answer_list(call, listing, query)


@routes(
    "GET",
    "/v1/athletes/{athlete_id}",
    "Read an athlete",
    "athletes:read",
    {200: Answer(AthleteView, "The athlete.", headers=ETAG)},
    problems=("not-found",),
)
async def read_athlete(call: Call) -> Response:
    """404 once erased, or merged into another, whom the 404 names."""
    athlete_id = _id(call)
    found = await deps.read(call.request, lambda conn: athletes.require(conn, call.data_set_id, athlete_id))
    return answer(document(found), headers=etag(found.revision))


@routes(
    "PATCH",
    "/v1/athletes/{athlete_id}",
    "Change an athlete",
    "athletes:write",
    {200: Answer(AthleteView, "The athlete now.", headers=ETAG)},
    body=AthleteBody,
    request_headers=IF_MATCH,
    problems=("not-found", "external-id-conflict", "precondition-failed"),
)
async def change_athlete(call: Call) -> Response:
    """Fields that are left out stay as they are."""
    athlete_id, revision = _id(call), if_match(call.request)
    changes = _stored(call.body.model_dump(exclude_unset=True))
    changed = await deps.write(
        call.request, lambda conn: athletes.patch(conn, call.data_set_id, athlete_id, changes, if_match=revision)
    )
    call.request.app.state.facts.forget()
    return answer(document(changed), headers=etag(changed.revision))


@routes(
    "DELETE",
    "/v1/athletes/{athlete_id}",
    "Erase an athlete",
    "athletes:write",
    {204: Answer(None, "Erased.", ())},
    request_headers=IF_MATCH,
    problems=("not-found", "precondition-failed"),
)
async def erase_athlete(call: Call) -> Response:
    """Identity, impacts, traces and scores go; tombstones stay, so that other systems can follow."""
    athlete_id, revision = _id(call), if_match(call.request)
    await deps.write(call.request, lambda conn: athletes.erase(conn, call.data_set_id, athlete_id, if_match=revision))
    call.request.app.state.facts.forget()
    # What was erased is in the write-ahead log until it is moved into the file.
    await run_sync(call.request.app.state.database.checkpoint)
    return no_content()


class MergeBody(Strict):
    """Who somebody turned out to be."""

    into: Name = Field(description="Our id of the athlete who stays.", examples=["ath_01kab3fz8c9vqt5n2m7d4xw6ye"])


@routes(
    "POST",
    "/v1/athletes/{athlete_id}/merge",
    "Merge an athlete into another",
    "athletes:write",
    {200: Answer(AthleteView, "The athlete who stays.", headers=ETAG)},
    body=MergeBody,
    request_headers=IF_MATCH,
    problems=("not-found", "conflict", "precondition-failed"),
)
async def merge_athletes(call: Call) -> Response:
    """Impacts go over with their history and labels. Impacts sent later under the other's external id follow them."""
    athlete_id, revision = _id(call), if_match(call.request)
    into = deps.identifier("ath", call.body.into, "athlete")

    def change(conn: Any) -> Athlete:  # noqa: ANN401 - a connection of the store
        found = athletes.merge(conn, call.data_set_id, athlete_id, into, if_match=revision)
        diagnoses.join(conn, call.data_set_id, into, call.key.id)
        return found

    merged = await deps.write(call.request, change)
    call.request.app.state.facts.forget()
    return answer(document(merged), headers=etag(merged.revision))


def _id(call: Call) -> bytes:
    return deps.identifier("ath", call.path("athlete_id"), "athlete")


def _stored(fields: dict[str, Any]) -> dict[str, Any]:
    return fields | {"tags": tuple(fields["tags"] or ())} if "tags" in fields else fields


def document(athlete: Athlete) -> dict[str, Any]:
    """An athlete, or a tombstone, as it is answered."""
    athlete_id = ids.encode("ath", athlete.id)
    if athlete.deleted_at is not None:
        times = {"updated_at": athlete.updated_at, "deleted_at": athlete.deleted_at}
        merged = None if athlete.merged_into is None else ids.encode("ath", athlete.merged_into)
        return {"id": athlete_id, "revision": athlete.revision, **times, "merged_into": merged}
    return {
        "id": athlete_id,
        **{name: getattr(athlete, name) for name in _FIELDS},
        "revision": athlete.revision,
        "created_at": athlete.created_at,
        "updated_at": athlete.updated_at,
    }


def _cells(athlete: Athlete) -> list[Cell]:
    fields = {name: getattr(athlete, name) for name in _FIELDS} | {"tags": " ".join(athlete.tags)}
    times = (athlete.created_at, athlete.updated_at, athlete.deleted_at)
    return [ids.encode("ath", athlete.id), *fields.values(), athlete.revision, *times]
