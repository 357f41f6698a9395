"""`POST /v1/imports`: a file of impacts, each stored, found or refused by itself; and the layouts that are known."""

from __future__ import annotations

from datetime import datetime
from functools import partial
from typing import Annotated, Any, Literal

from anyio.to_thread import run_sync
from pydantic import BaseModel, Field, WithJsonSchema
from starlette.responses import Response

from headimpact_service.answers import answer
from headimpact_service.errors import Problem
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.presets import list_presets
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.upload import read_upload
from headimpact_service.intake.importing import preview_row, summary
from headimpact_service.operation import ANY_KEY, Answer, BodyForm, Call, Routes
from headimpact_service.parameters import Flag, Query, validate_parameters
from headimpact_service.problem_shapes import ProblemDocument
from headimpact_service.routes.impact_shapes import KinematicsView
from headimpact_service.routes.import_flow import score_all, store_all
from headimpact_service.routes.score_shapes import PeaksView, QualityView
from headimpact_service.routes.uploads import MULTIPART, RAW, Upload, read_file

routes = Routes("imports")

MAX_IMPACTS = 1000
Status = Literal["created", "unchanged", "failed", "readable"]
FieldText = Annotated[str | None, Field(max_length=200)]


class ImportQuery(Query):
    """What comes beside the file, as query parameters or form fields; a field given overrides the file."""

    preset: FieldText = Field(None, description="A device's layout, as `GET /v1/presets` lists them.")
    mapping: str | None = Field(None, max_length=4000, description="JSON: which column is what.")
    athlete: FieldText = Field(None, description="Your id of the athlete.")
    device: FieldText = Field(None, description="Serial number of the device.")
    occurred_at: FieldText = Field(None, description="RFC 3339, or a local time with `time_zone`.")
    time_zone: FieldText = Field(None, description="IANA zone of local times.")
    sample_rate_hz: Annotated[
        str | None, Field(max_length=40), WithJsonSchema({"type": "number", "minimum": 500, "maximum": 1_000_000})
    ] = Field(None, description="Samples per second [Hz].")
    axes: FieldText = Field(None, description="`anatomical` or `sae_j211`.")
    filter: FieldText = Field(None, description="`paper`, `none`, or JSON with a cut-off for each signal.")
    dry_run: Flag = Field(default=False, description="Show what is understood; store nothing.")


class ImportForm(BaseModel):
    """A multipart body."""

    file: Annotated[bytes, WithJsonSchema({"type": "string", "format": "binary"})]
    preset: str = ""
    mapping: str = ""
    athlete: str = ""
    device: str = ""
    occurred_at: str = ""
    time_zone: str = ""
    sample_rate_hz: str = ""
    axes: str = ""
    filter: str = ""
    dry_run: Literal["true", "false"] = "false"


class PreviewView(BaseModel):
    """What a dry run understood of an impact."""

    athlete: str | None
    device: str | None
    occurred_at: datetime | None
    kinematics: KinematicsView
    source: dict[str, Any]
    state: Literal["scored", "unscorable"]
    peaks: PeaksView
    quality: list[QualityView]


class ImportedView(BaseModel):
    """What became of one impact of the file."""

    index: int
    external_id: str | None
    status: Status
    id: str | None
    problem: ProblemDocument | None
    preview: PreviewView | None = Field(None, description="Only of a dry run.")


class SummaryView(BaseModel):
    """How many of each."""

    created: int
    unchanged: int
    failed: int


class ImportView(BaseModel):
    """What became of a file."""

    data: list[ImportedView]
    summary: SummaryView


class PresetList(BaseModel):
    """Every preset, on one page."""

    data: list[dict[str, Any]]
    next_cursor: None


@routes(
    "POST",
    "/v1/imports",
    "Import a file",
    "impacts:write",
    {207: Answer(ImportView, "What became of each impact, even of a single one.")},
    query=ImportQuery,
    body_forms=(BodyForm(MULTIPART, ImportForm), *(BodyForm(media_type, None) for media_type in RAW)),
    problems=("invalid-parameter", "unreadable-file", "import-too-large"),
)
async def import_file(call: Call) -> Response:
    """CSV, JSON, NDJSON and NHTSA zip, told apart by their content. Up to 1000 impacts and 16 MiB.

    An impact whose athlete, time and signals are stored already is `unchanged`, whatever the file is called.
    """
    upload = await read_file(call.request)
    options, dry_run = _options(upload)
    found = await run_sync(partial(_read, upload.data, options))
    items = await score_all(call, found)
    if dry_run:
        rows = [preview_row(index, item) for index, item in enumerate(items)]
    else:
        rows = await store_all(call, items)
    return answer({"data": rows, "summary": summary(rows)}, 207)


def _options(upload: Upload) -> tuple[ImportOptions, bool]:
    fields = validate_parameters(upload.fields, ImportQuery)
    texts = fields.model_dump(exclude={"dry_run"}, exclude_none=True)
    options = ImportOptions.from_fields(
        texts, filename=upload.filename, content_type=upload.content_type, max_impacts=MAX_IMPACTS
    )
    return options, fields.dry_run


def _read(data: bytes, options: ImportOptions) -> list[ImpactRecord | Problem]:
    """The whole file first: where it breaks in its midst, nothing of it is stored."""
    return list(read_upload(data, options))


@routes("GET", "/v1/presets", "List known layouts", ANY_KEY, {200: Answer(PresetList, "All presets.")})
async def list_known_presets(call: Call) -> Response:  # noqa: ARG001 - the shape of a handler
    """Columns, units and axes of known devices, and what the sender must add."""
    return answer({"data": list_presets(), "next_cursor": None})
