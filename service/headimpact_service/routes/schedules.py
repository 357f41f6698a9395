"""Schedules: fits that come by themselves."""

from __future__ import annotations

import re
from datetime import datetime
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, Field, ValidationInfo, field_validator
from starlette.responses import Response

from headimpact_service import deps
from headimpact_service.answers import answer, no_content
from headimpact_service.errors import invalid_parameter, not_found
from headimpact_service.ingest.impact_json import Strict, Zone
from headimpact_service.intake.cron import next_due, require_cron
from headimpact_service.operation import Answer, Call, Routes
from headimpact_service.parameters import ListQuery
from headimpact_service.routes.fit_shapes import FitBody, GatesBody, stored
from headimpact_service.routes.lists import MEDIA_TYPES, answer_list
from headimpact_service.routes.models import VERSION
from headimpact_service.routes.preconditions import IF_MATCH, etag, if_match
from headimpact_service.routes.short_lists import short_listing
from headimpact_service.store import ids, schedules
from headimpact_service.store.schedules import NewSchedule, Schedule

routes = Routes("models")


def _cron(expression: str) -> str:
    require_cron(expression)
    return expression


class ScheduleBody(Strict):
    """When to fit, what, and what the model must pass."""

    cron: Annotated[str, Field(max_length=100), AfterValidator(_cron)] = Field(
        description="Five fields: minute, hour, day of the month, month, day of the week.", examples=["30 3 * * 1"]
    )
    time_zone: Zone = Field(default="UTC", description="IANA zone of its clock.")
    enabled: bool = True
    fit: FitBody = Field(default_factory=FitBody)
    gates: GatesBody = Field(default_factory=GatesBody, validate_default=True)
    promote: bool = Field(
        default=False, description="Whether a model that passes every gate becomes active without anybody's word."
    )

    @field_validator("gates")
    @classmethod
    def _judge_what_is_fitted(cls, gates: GatesBody, info: ValidationInfo) -> GatesBody:
        """The gates' criteria are fitted; where the sender names none and BAM is not, they are all that is fitted."""
        fit: FitBody | None = info.data.get("fit")
        if fit is None or fit.criteria is None or set(gates.criteria) <= set(fit.criteria):
            return gates
        if "criteria" in gates.model_fields_set:
            raise ValueError(f"Gates judge criteria that are fitted, which are {', '.join(fit.criteria)}.")
        return gates.model_copy(update={"criteria": list(fit.criteria)})


class ScheduleView(BaseModel):
    """A schedule, and what it did last."""

    name: str
    cron: str
    time_zone: str
    enabled: bool
    fit: dict[str, Any]
    gates: dict[str, Any]
    promote: bool
    next_due: datetime | None
    last_fired: datetime | None
    last_job: str | None = Field(description="Its job says what came of it, or why it was skipped.")
    revision: int
    created_at: datetime
    updated_at: datetime


class ScheduleList(BaseModel):
    """A page of schedules, by name."""

    data: list[ScheduleView]
    next_cursor: str | None


ETAG = {"ETag": "The revision, for If-Match."}


_FLAGS = frozenset({"enabled", "promote"})


@routes(
    "GET",
    "/v1/schedules",
    "List schedules",
    "models:read",
    {200: Answer(ScheduleList, "A page of schedules, by name.", MEDIA_TYPES)},
    query=ListQuery,
    problems=("bad-cursor",),
)
async def list_schedules(call: Call) -> Response:
    """With when each is due next."""

    listing = short_listing(
        "schedules",
        lambda conn: schedules.list_all(conn, call.data_set_id),
        _document,
        "name",
        tuple(ScheduleView.model_fields),
        flags=_FLAGS,
    )
    return await answer_list(call, listing, call.query)


@routes(
    "GET",
    "/v1/schedules/{name}",
    "Read a schedule",
    "models:read",
    {200: Answer(ScheduleView, "The schedule.", headers=ETAG)},
    problems=("not-found",),
)
async def read_schedule(call: Call) -> Response:
    """With when it is due next, and the job that it made last."""
    name = call.path("name")
    found = await deps.read(call.request, lambda conn: schedules.get(conn, call.data_set_id, name))
    if found is None:
        raise not_found("schedule")
    return answer(_document(found), headers=etag(found.revision))


@routes(
    "PUT",
    "/v1/schedules/{name}",
    "Make or replace a schedule",
    "models:fit",
    {
        200: Answer(ScheduleView, "The schedule as it is now.", headers=ETAG),
        201: Answer(ScheduleView, "The new schedule.", headers=ETAG),
    },
    body=ScheduleBody,
    example={"cron": "30 3 * * 1", "time_zone": "Europe/Dublin", "fit": {"criteria": ["bam"], "seed": 1}},
    request_headers=IF_MATCH,
    problems=("precondition-failed", "insufficient-scope", "invalid-parameter"),
)
async def put_schedule(call: Call) -> Response:
    """It fires once for each time it is due, however many processes run; times missed while none ran, once together.

    With nothing new labelled its job is skipped, and says so. `promote` needs the scope models:promote too.
    """
    body: ScheduleBody = call.body
    name = _name(call)
    revision = if_match(call.request)
    if body.promote and "models:promote" not in call.key.scopes:
        raise deps.scope_missing("models:promote")
    new = NewSchedule(
        cron=body.cron,
        time_zone=body.time_zone,
        enabled=body.enabled,
        fit=stored(body.fit, (await call.renewed()).terms, "/fit"),
        gates=body.gates.model_dump(mode="json"),
        promote=body.promote,
    )
    found, made = await deps.write(
        call.request,
        lambda conn: schedules.put(conn, call.data_set_id, name, new, call.key.id, next_due, if_match=revision),
    )
    return answer(_document(found), 201 if made else 200, etag(found.revision))


@routes(
    "DELETE",
    "/v1/schedules/{name}",
    "Delete a schedule",
    "models:fit",
    {204: Answer(None, "Deleted; the models that it made stay.", ())},
    request_headers=IF_MATCH,
    problems=("not-found", "precondition-failed"),
)
async def delete_schedule(call: Call) -> Response:
    """A job of it that is under way goes on."""
    name, revision = call.path("name"), if_match(call.request)
    await deps.write(call.request, lambda conn: schedules.remove(conn, call.data_set_id, name, if_match=revision))
    return no_content()


def _name(call: Call) -> str:
    name = call.path("name")
    if re.fullmatch(VERSION, name) is None:
        raise invalid_parameter("name", "A name has 1 to 100 letters, digits, dots and dashes.", "pattern")
    return name


def _document(found: Schedule) -> dict[str, Any]:
    return {
        "name": found.name,
        "cron": found.cron,
        "time_zone": found.time_zone,
        "enabled": found.enabled,
        "fit": found.fit,
        "gates": found.gates,
        "promote": found.promote,
        "next_due": found.next_due,
        "last_fired": found.last_fired,
        "last_job": None if found.last_job_id is None else ids.encode("job", found.last_job_id),
        "revision": found.revision,
        "created_at": found.created_at,
        "updated_at": found.updated_at,
    }
