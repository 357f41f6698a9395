"""What an organisation has its impacts scored with."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, Field
from starlette.responses import Response

from headimpact.risk import DEFAULT_OPERATING_POINTS, RiskModel
from headimpact_service import deps
from headimpact_service.answers import answer
from headimpact_service.errors import Problem
from headimpact_service.ingest.impact_json import MAX_OPERATING_POINTS, Incidence, OperatingPointBody, Strict
from headimpact_service.intake.scoring import Terms, operating_points
from headimpact_service.operation import ANY_KEY, Answer, Call, Routes
from headimpact_service.routes.operating_points import requests_of
from headimpact_service.routes.preconditions import IF_MATCH, etag, if_match
from headimpact_service.store import organisation_settings
from headimpact_service.store.organisation_settings import OrganisationSettings

routes = Routes("settings")


class OperatingPointSetting(BaseModel):
    """An operating point that is answered where a request names none."""

    criterion: str
    sensitivity: float | None = None
    specificity: float | None = None
    threshold: float | None = None


class SettingsView(BaseModel):
    """The settings of the organisation."""

    incidence: float = Field(description="Concussions per impact that probabilities are served at.")
    operating_points: list[OperatingPointSetting]
    revision: int


class SettingsBody(Strict):
    """What is to change; null takes a setting back to the active model's."""

    incidence: Incidence | None = None
    operating_points: Annotated[list[OperatingPointBody], Field(max_length=MAX_OPERATING_POINTS)] | None = Field(
        None, description="None at all are the active model's, too; an impact that asks for `[]` gets none."
    )


ETAG = {"ETag": "The revision, for If-Match."}


@routes(
    "GET", "/v1/settings", "The organisation's settings", ANY_KEY, {200: Answer(SettingsView, "As set.", headers=ETAG)}
)
async def read_settings(call: Call) -> Response:
    """Live and test keys of an organisation share its settings."""
    found = await deps.read(call.request, lambda conn: organisation_settings.get(conn, call.key.organisation_id))
    return answer(_document(found, call.terms.model), headers=etag(found.revision))


@routes(
    "PATCH",
    "/v1/settings",
    "Change settings",
    "admin",
    {200: Answer(SettingsView, "As set now.", headers=ETAG)},
    body=SettingsBody,
    example={"incidence": 0.0055, "operating_points": [{"criterion": "bam", "sensitivity": 0.9}]},
    request_headers=IF_MATCH,
    problems=("precondition-failed", "operating-point-unreachable"),
)
async def change_settings(call: Call) -> Response:
    """Scores that are stored from now on follow at once, in every process; stored ones stay as they are.

    `POST /v1/score` follows in other processes within five seconds.

    Live and test keys share them, so only a live key may change them.
    """
    if call.key.mode != "live":
        raise Problem("insufficient-scope", "A test key cannot change the settings of live data.")
    revision = if_match(call.request)
    body: SettingsBody = call.body
    named = body.model_fields_set
    points = _points(body, (await call.renewed()).terms.model)

    def change(conn: Any) -> OrganisationSettings:  # noqa: ANN401 - a connection of the store
        present = organisation_settings.get(conn, call.key.organisation_id)
        return organisation_settings.put(
            conn,
            call.key.organisation_id,
            incidence=body.incidence if "incidence" in named else present.incidence,
            operating_points=points if "operating_points" in named else present.operating_points,
            if_match=revision,
        )

    found = await deps.write(call.request, change)
    call.request.app.state.gate.forget()
    return answer(_document(found, call.terms.model), headers=etag(found.revision))


def _points(body: SettingsBody, model: RiskModel) -> list[dict[str, object]]:
    """The operating points of a body as they are stored, once the model has them all."""
    requests = requests_of(body.operating_points or ())
    operating_points(requests, Terms(model=model))
    return [{"criterion": request.criterion, **request.requested} for request in requests]


def _document(found: OrganisationSettings, model: RiskModel) -> dict[str, Any]:
    default = [{"criterion": point.criterion, **point.requested} for point in DEFAULT_OPERATING_POINTS]
    return {
        "incidence": model.incidence if found.incidence is None else found.incidence,
        "operating_points": list(found.operating_points) or default,
        "revision": found.revision,
    }
