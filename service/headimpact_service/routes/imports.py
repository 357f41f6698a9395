"""`POST /v1/imports`: a file of impacts, each stored, found or refused by itself; and the layouts that are known."""

from __future__ import annotations

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
from headimpact_service.ingest.upload import read_upload, sample_count
from headimpact_service.intake.importing import Found, preview_row, summary
from headimpact_service.operation import ANY_KEY, Answer, BodyForm, Call, Routes
from headimpact_service.parameters import Flag, ListQuery, Query, validate_parameters
from headimpact_service.routes.import_flow import score_all, store_all
from headimpact_service.routes.import_jobs import earlier_job, order_import, wants_job
from headimpact_service.routes.import_shapes import ImportView
from headimpact_service.routes.job_shapes import IDEMPOTENCY_KEY, LOCATION, PREFER, JobView, accepted
from headimpact_service.routes.lists import MEDIA_TYPES, answer_list
from headimpact_service.routes.short_lists import short_listing
from headimpact_service.routes.uploads import MULTIPART, RAW, Upload, received

routes = Routes("imports")

MAX_IMPACTS = 1000
MAX_SAMPLES = 4_000_000
"""Of all channels together: what is held at once; more is read by a job, part by part."""
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
    fill_gaps: Annotated[str | None, Field(max_length=8), WithJsonSchema({"type": "boolean"})] = Field(
        None, description="Fill gaps of at most 2 samples; otherwise a missing sample is refused."
    )
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
    fill_gaps: Literal["true", "false"] = "false"
    dry_run: Literal["true", "false"] = "false"


class PresetList(BaseModel):
    """A page of presets."""

    data: list[dict[str, Any]]
    next_cursor: str | None


@routes(
    "POST",
    "/v1/imports",
    "Import a file",
    "impacts:write",
    {
        207: Answer(ImportView, "What became of each impact, even of a single one."),
        202: Answer(JobView, "A job imports it.", headers=LOCATION),
    },
    query=ImportQuery,
    body_forms=(BodyForm(MULTIPART, ImportForm), *(BodyForm(media_type, None) for media_type in RAW)),
    request_headers=IDEMPOTENCY_KEY | PREFER,
    problems=("invalid-parameter", "unreadable-file", "import-too-large", "idempotency-conflict"),
)
async def import_file(call: Call) -> Response:
    """CSV (also of DTS), JSON, NDJSON, Parquet, Arrow IPC, MATLAB (-v7), xlsx, npz; zips of ISO-MME, NHTSA or CSV.

    Their content tells them apart; the columns of each are described in docs/formats.md.

    Up to 1000 impacts and 16 MiB are answered at once, unless `Prefer: respond-async` asks for a job; more is a job.
    An impact whose athlete, time and signals are stored already is `unchanged`, whatever the file is called.
    """
    async with received(call.request) as upload:
        fields = validate_parameters(upload.fields, ImportQuery)
        sent = fields.model_dump(exclude={"dry_run"}, exclude_none=True)
        options = ImportOptions.from_fields(sent, filename=upload.filename, content_type=upload.content_type)
        if (earlier := await earlier_job(call, upload, sent)) is not None:
            return accepted(earlier)
        found = None
        if not wants_job(call.request, upload, dry_run=fields.dry_run):
            found = await run_sync(partial(_read, upload, options))
        if found is None:
            return accepted(await order_import(call, upload, sent, dry_run=fields.dry_run))
    items = await score_all(call, found)
    if fields.dry_run:
        rows = [preview_row(index, item) for index, item in enumerate(items)]
    else:
        rows = await store_all(call, items)
    return answer({"data": rows, "summary": summary(rows)}, 207)


def _read(upload: Upload, options: ImportOptions) -> Found | None:
    """The whole file first: where it breaks in its midst, nothing of it is stored. None for too much at once."""
    found: list[ImpactRecord | Problem] = []
    samples = 0
    for item in read_upload(upload.file.contents(), options):
        found.append(item)
        samples += sample_count(item)
        if len(found) > MAX_IMPACTS or samples > MAX_SAMPLES:
            return None
    return found


@routes(
    "GET",
    "/v1/presets",
    "List known layouts",
    ANY_KEY,
    {200: Answer(PresetList, "A page of presets.", MEDIA_TYPES)},
    query=ListQuery,
    problems=("bad-cursor",),
)
async def list_known_presets(call: Call) -> Response:
    """Columns, units and axes of known devices, and what the sender must add."""
    known = list_presets()
    listing = short_listing(
        "presets",
        lambda conn: known,  # noqa: ARG005 - presets are no rows of the database
        dict,
        "name",
        tuple(known[0]),
        numbers=frozenset({"sample_rate_hz", "pre_trigger_ms"}),
        flags=frozenset({"recognised"}),
    )
    return await answer_list(call, listing, call.query)
