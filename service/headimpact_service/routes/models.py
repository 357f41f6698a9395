"""Risk models: the published one and those of the data set, their reports, and which of them is in service."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from functools import partial
from typing import Annotated, Any, Literal

from anyio.to_thread import run_sync
from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from starlette.responses import Response

from headimpact import model_document
from headimpact.errors import ModelDocumentError, UnknownCriterion
from headimpact.model_document import model_from_document, model_from_text, model_to_document
from headimpact.risk import PUBLISHED_MODELS, RiskModel
from headimpact.risk_map import RiskMap, draw_risk_map
from headimpact_service import deps
from headimpact_service.answers import HTML, JSON, SVG, answer
from headimpact_service.bodies import read_body, require_media_type
from headimpact_service.errors import PayloadError, Problem, invalid_parameter, not_found
from headimpact_service.ingest.impact_json import Incidence, Strict, Text
from headimpact_service.intake import registry
from headimpact_service.operation import Answer, BodyForm, Call, Routes
from headimpact_service.parameters import ListQuery, Query
from headimpact_service.routes.lists import MEDIA_TYPES, answer_list
from headimpact_service.routes.model_shapes import (
    ModelList,
    ModelSummary,
    ModelView,
    curve_document,
    metrics_of,
    point_document,
    summary,
)
from headimpact_service.routes.preconditions import IF_MATCH, etag, if_match
from headimpact_service.routes.short_lists import short_listing
from headimpact_service.store import aliases, ids, models
from headimpact_service.store.aliases import ALIASES, Alias, AliasName
from headimpact_service.store.models import NewModel, StoredModel

routes = Routes("models")

VERSION = f"^{model_document.VERSION.pattern}$"
Version = Annotated[str, Field(pattern=VERSION, max_length=model_document.MAX_VERSION, examples=["laksari-2020"])]
DOCUMENT_BYTES = 16 * 1024 * 1024


class ModelDocumentBody(BaseModel):
    """A model's document, as `headimpact refit` writes it into model.json."""

    model_config = ConfigDict(extra="allow", hide_input_in_errors=True)

    format: str = Field(examples=["headimpact-model/1"])
    version: Version


class ReportView(BaseModel):
    """What a fit found out; docs/recalibration.md explains every member."""

    model_config = ConfigDict(extra="allow")

    format: str
    cohort: dict[str, Any]
    criteria: dict[str, Any]


class RiskMapQuery(Query):
    """Of which criteria, at which incidence."""

    criteria: str | None = Field(None, max_length=200, description="Keys between commas; all of rotation unless given.")
    incidence: Annotated[Incidence | None, Field(description="The model's own unless given.")] = None


class RiskMapView(BaseModel):
    """Probabilities over half-sine pulses of angular acceleration about all three axes."""

    model: str
    incidence: float
    durations_ms: list[float]
    amplitudes_rad_s2: list[float]
    probabilities: dict[str, list[list[float]]] = Field(description="By criterion, amplitudes x durations.")


class AliasChangeView(BaseModel):
    """What an alias meant, from when on, and why."""

    version: str | None
    revision: int
    reason: str
    key: str | None
    created_at: datetime | None
    superseded_at: datetime | None


class AliasView(AliasChangeView):
    """What an alias means; `version` is null where it means none."""

    name: Literal["active", "candidate"]
    history: list[AliasChangeView] = Field(description="Oldest first; what it means now is the last.")


def _said(reason: str) -> str:
    if not reason.strip():
        raise ValueError("A reason says something.")
    return reason.strip()


class AliasBody(Strict):
    """What an alias is to mean, and why."""

    version: Version | None = Field(
        description="A version that `GET /v1/models` lists; null lets `candidate` mean none."
    )
    reason: Annotated[Text, AfterValidator(_said)] = Field(
        description="For whoever asks later.", examples=["Gates passed; reviewed by the data team."]
    )


ETAG = {"ETag": "The revision, for If-Match."}


@routes(
    "GET",
    "/v1/models",
    "List risk models",
    "models:read",
    {200: Answer(ModelList, "A page of models.", MEDIA_TYPES)},
    query=ListQuery,
    problems=("bad-cursor",),
)
async def list_models(call: Call) -> Response:
    """Those of the data set, newest first, and the published one."""

    def read(conn: Any) -> list[dict[str, Any]]:  # noqa: ANN401 - a connection of the store
        found, meant = models.list_all(conn, call.data_set_id), _meant(conn, call.data_set_id)
        own = [summary(model_from_document(stored.document), stored, meant) for stored in found]
        return own + [summary(model, None, meant) for model in PUBLISHED_MODELS.values()]

    columns = tuple(ModelSummary.model_fields)
    listing = short_listing("models", read, dict, "version", columns, numbers=frozenset({"incidence"}))
    return await answer_list(call, listing, call.query)


@routes(
    "POST",
    "/v1/models",
    "Register a model",
    "models:fit",
    {201: Answer(ModelView, "The model."), 200: Answer(ModelView, "The same model was registered before.")},
    body_forms=(BodyForm(JSON, ModelDocumentBody),),
    problems=("conflict", "invalid-payload", "body-too-large", "unsupported-media-type"),
)
async def register_model(call: Call) -> Response:
    """The model.json of `headimpact refit`. A version never changes: another document under its name is 409."""
    require_media_type(call.request, (JSON,))
    text = await read_body(call.request, DOCUMENT_BYTES)
    try:
        model = await run_sync(model_from_text, text)
    except ModelDocumentError as error:
        fault = PayloadError(error.detail, "model-document", pointer=error.pointer)
        raise Problem("invalid-payload", "The document is no risk model.", errors=[fault]) from None
    registry.require_free(model.version)
    new = NewModel(version=model.version, document=model_to_document(model), key_id=call.key.id)
    stored, made = await deps.write(call.request, lambda conn: models.add(conn, call.data_set_id, new))
    meant = await deps.read(call.request, lambda conn: _meant(conn, call.data_set_id))
    return answer(_document(model, stored, meant, None), 201 if made else 200)


@routes(
    "GET",
    "/v1/models/aliases/{alias}",
    "Read an alias",
    "models:read",
    {200: Answer(AliasView, "What it means now, and meant before.", headers=ETAG)},
    problems=("not-found",),
)
async def read_alias(call: Call) -> Response:
    """`active` scores new impacts: the published one, until somebody chooses. `candidate` is what a fit made last."""
    name = _alias(call)
    history = await deps.read(call.request, lambda conn: aliases.history(conn, call.data_set_id, name))
    return _alias_answer(name, history)


@routes(
    "PUT",
    "/v1/models/aliases/{alias}",
    "Change an alias",
    "models:promote",
    {200: Answer(AliasView, "What it means now.", headers=ETAG)},
    body=AliasBody,
    example={"version": "laksari-2020", "reason": "Back to the published model."},
    request_headers=IF_MATCH,
    problems=("not-found", "conflict", "operating-point-unreachable", "precondition-failed", "precondition-required"),
)
async def change_alias(call: Call) -> Response:
    """Promotion and rollback are the same call. Scores that are stored follow at once, in every process.

    Stored scores keep the model that made them. A model that lacks an operating point which the organisation has set
    is not promoted: alerts would be missing in silence.
    """
    name, revision = _alias(call), if_match(call.request, required=True)
    body: AliasBody = call.body
    if name == "active" and body.version is None:
        raise Problem("conflict", "Some model is always active: name one, as the published laksari-2020.")

    key = (await call.renewed()).key

    def change(conn: Any) -> list[Alias]:  # noqa: ANN401 - a connection of the store
        if body.version is not None:
            model = registry.model_of(conn, call.data_set_id, body.version)
            if name == "active":
                registry.require_promotable(model, key.incidence, key.operating_points)
        aliases.put(conn, call.data_set_id, name, body.version, body.reason, call.key.id, if_match=revision)
        return aliases.history(conn, call.data_set_id, name)

    history = await deps.write(call.request, change)
    call.request.app.state.gate.forget()
    return _alias_answer(name, history)


@routes(
    "GET",
    "/v1/models/{version}",
    "Read a risk model",
    "models:read",
    {200: Answer(ModelView, "The model.")},
    problems=("not-found",),
)
async def read_model(call: Call) -> Response:
    """Coefficients, operating points with their intervals, and the source of both."""
    version, data_set_id = call.path("version"), call.data_set_id

    def find(conn: Any) -> dict[str, Any]:  # noqa: ANN401 - a connection of the store
        model = registry.model_of(conn, data_set_id, version)
        stored = models.get(conn, data_set_id, version)
        return _document(model, stored, _meant(conn, data_set_id), models.report(conn, data_set_id, version))

    return answer(await deps.read(call.request, find))


@routes(
    "GET",
    "/v1/models/{version}/report",
    "Read the report of a fit",
    "models:read",
    {200: Answer(ReportView, "What the fit found out.", (JSON, HTML))},
    problems=("not-found", "not-acceptable"),
)
async def read_report(call: Call) -> Response:
    """As JSON, or as a page for people. 404 for a model that was not fitted here."""
    version = call.path("version")
    if call.media_type == HTML:
        page = await deps.read(call.request, lambda conn: models.page(conn, call.data_set_id, version))
        if page is None:
            raise not_found("report")
        return Response(page, media_type=HTML)
    report = await deps.read(call.request, lambda conn: models.report(conn, call.data_set_id, version))
    if report is None:
        raise not_found("report")
    return answer(report)


@routes(
    "GET",
    "/v1/models/{version}/risk-map",
    "Draw a model's risk map",
    "models:read",
    {200: Answer(RiskMapView, "The risk over half-sine pulses.", (JSON, SVG))},
    query=RiskMapQuery,
    problems=("not-found", "not-acceptable"),
)
async def read_risk_map(call: Call) -> Response:
    """Figure 8 of Laksari et al. 2020, for any model: as numbers, or as a picture."""
    query: RiskMapQuery = call.query
    model = await deps.read(call.request, lambda conn: registry.model_of(conn, call.data_set_id, call.path("version")))
    chosen = None if query.criteria is None else [key.strip() for key in query.criteria.split(",")]
    try:
        drawn = await run_sync(partial(draw_risk_map, model, chosen, incidence=query.incidence))
    except UnknownCriterion as error:
        raise invalid_parameter("criteria", str(error), "not-allowed") from None
    if call.media_type == SVG:
        if not drawn.probabilities:
            raise Problem("not-found", "The model has no curve of a criterion of rotation alone.")
        return Response(await run_sync(partial(_picture, drawn)), media_type=SVG)
    return answer(_risk_map(drawn))


def _picture(drawn: RiskMap) -> str:
    # Here, since a service that nobody asks for a picture does without its tens of megabytes.
    from headimpact_service.reports.figures import risk_map_svg

    return risk_map_svg(drawn)


def _risk_map(drawn: RiskMap) -> dict[str, Any]:
    return {
        "model": drawn.model,
        "incidence": drawn.incidence,
        "durations_ms": [duration * 1000.0 for duration in drawn.durations_s],
        "amplitudes_rad_s2": list(drawn.amplitudes_rad_s2),
        "probabilities": {key: found.tolist() for key, found in drawn.probabilities.items()},
    }


def _alias(call: Call) -> AliasName:
    name = call.path("alias")
    for alias in ALIASES:
        if alias == name:
            return alias
    raise not_found("alias")


def _meant(conn: Any, data_set_id: bytes) -> dict[str, str | None]:  # noqa: ANN401 - a connection of the store
    """The version of each alias."""
    meant: dict[str, str | None] = {alias: aliases.get(conn, data_set_id, alias).version for alias in ALIASES}
    return meant | {"active": meant["active"] or registry.DEFAULT.version}


def _alias_answer(name: AliasName, history: list[Alias]) -> Response:
    first = registry.DEFAULT.version if name == "active" else None
    changes = [_change(replace(one, version=first) if one.revision == 0 else one) for one in history]
    return answer({"name": name, **changes[-1], "history": changes}, headers=etag(history[-1].revision))


def _change(alias: Alias) -> dict[str, Any]:
    return {
        "version": alias.version,
        "revision": alias.revision,
        "reason": alias.reason,
        "key": None if alias.key_id is None else ids.encode("key", alias.key_id),
        "created_at": alias.created_at,
        "superseded_at": alias.superseded_at,
    }


def _document(
    model: RiskModel, stored: StoredModel | None, meant: Mapping[str, str | None], report: Mapping[str, Any] | None
) -> dict[str, Any]:
    """A model as it is answered."""
    return {
        **summary(model, stored, meant),
        "probability": "p = 1/(1 + exp(b0 + b.x))",
        "cohort": dict(model.cohort),
        "curves": [curve_document(model, key) for key in model.curves],
        "operating_points": {
            key: [point_document(point) for point in points] for key, points in model.operating_points.items()
        },
        "metrics": metrics_of(report),
        "schedule": None if stored is None else stored.schedule,
        "job": None if stored is None or stored.job_id is None else ids.encode("job", stored.job_id),
    }
