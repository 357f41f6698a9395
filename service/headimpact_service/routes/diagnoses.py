"""Diagnoses of a session whose impact nobody saw."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from pydantic import BaseModel, Field
from starlette.responses import Response

from headimpact_service import deps
from headimpact_service.answers import answer
from headimpact_service.errors import Problem
from headimpact_service.ingest.impact_json import Moment, Name, Strict
from headimpact_service.operation import Answer, Call, Routes
from headimpact_service.parameters import ListQuery
from headimpact_service.routes.lists import MEDIA_TYPES, answer_list
from headimpact_service.routes.short_lists import short_listing
from headimpact_service.store import diagnoses, ids
from headimpact_service.store.diagnoses import Diagnosis, NewDiagnosis
from headimpact_service.store.labels import Basis

routes = Routes("labels")


class DiagnosisBody(Strict):
    """A concussion that was diagnosed after a session."""

    session_id: Name = Field(description="The session that it came of.", examples=["2026-09-12-match"])
    basis: Basis = "physician_diagnosis"
    diagnosed_at: Moment | None = Field(None, description="RFC 3339 with an offset.", examples=["2026-09-13T10:00:00Z"])
    diagnosed_by: Name | None = Field(
        None, description="Your pseudonym for whoever diagnosed.", examples=["clinician-3"]
    )


class DiagnosisView(BaseModel):
    """A diagnosis, and the impact that it was attributed to."""

    id: str
    athlete: str
    session_id: str
    basis: Basis
    diagnosed_at: datetime | None
    diagnosed_by: str | None
    impact: str = Field(description="Labelled `concussion`, `assumed_highest_alpha`.")
    key: str | None
    created_at: datetime


class DiagnosisList(BaseModel):
    """A page of an athlete's diagnoses, oldest first."""

    data: list[DiagnosisView]
    next_cursor: str | None


@routes(
    "POST",
    "/v1/athletes/{athlete_id}/diagnoses",
    "Report a diagnosis",
    "labels:write",
    {
        201: Answer(DiagnosisView, "The diagnosis, with the impact that was labelled now."),
        200: Answer(DiagnosisView, "It was reported before, and its impact carries the label."),
    },
    body=DiagnosisBody,
    example={"session_id": "2026-09-12-match", "basis": "physician_diagnosis", "diagnosed_by": "clinician-3"},
    problems=("not-found", "label-conflict"),
)
async def report_diagnosis(call: Call) -> Response:
    """Labels the session's impact of highest peak angular acceleration, as Laksari et al. 2020 did.

    Impacts that could enter no cohort are passed over. The same diagnosis again is attributed by what is stored then:
    anew, if its impact was deleted, is another athlete's or has lost the label, or if a stronger one came in. For a
    concussion whose impact was seen, label that impact instead.
    """
    body: DiagnosisBody = call.body
    athlete_id = _athlete(call)
    new = NewDiagnosis(**body.model_dump())
    try:
        made, news = await deps.write(
            call.request, lambda conn: diagnoses.add(conn, call.data_set_id, athlete_id, new, call.key.id)
        )
    except Problem as problem:
        if problem.slug == "label-conflict" and "labels:read" not in call.key.scopes:
            raise Problem("label-conflict", "What is stored of this session contradicts the diagnosis.") from None
        raise
    return answer(_document(made), 201 if news else 200)


@routes(
    "GET",
    "/v1/athletes/{athlete_id}/diagnoses",
    "List an athlete's diagnoses",
    "labels:read",
    {200: Answer(DiagnosisList, "A page of them, oldest first.", MEDIA_TYPES)},
    query=ListQuery,
    problems=("not-found", "bad-cursor"),
)
async def list_diagnoses(call: Call) -> Response:
    """Those whose label was taken back or replaced later too: the impact's label is what holds."""
    athlete_id = _athlete(call)

    listing = short_listing(
        f"diagnoses {athlete_id.hex()}",
        lambda conn: diagnoses.of_athlete(conn, call.data_set_id, athlete_id),
        _document,
        "id",
        tuple(DiagnosisView.model_fields),
    )
    return await answer_list(call, listing, call.query)


def _athlete(call: Call) -> bytes:
    return deps.identifier("ath", call.path("athlete_id"), "athlete")


def _document(one: Diagnosis) -> dict[str, Any]:
    return {
        "id": ids.encode("dia", one.id),
        "athlete": ids.encode("ath", one.athlete_id),
        "session_id": one.session_id,
        "basis": one.basis,
        "diagnosed_at": one.diagnosed_at,
        "diagnosed_by": one.diagnosed_by,
        "impact": ids.encode("imp", one.impact_id),
        "key": None if one.key_id is None else ids.encode("key", one.key_id),
        "created_at": one.created_at,
    }
