"""An uploaded file: the raw body with its fields as query parameters, or one part of a multipart body."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Iterable
from dataclasses import dataclass
from pathlib import PurePosixPath

from starlette.datastructures import FormData, UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.requests import Request

from headimpact_service.bodies import read_body, require_media_type
from headimpact_service.errors import PayloadError, Problem, invalid_parameter

MULTIPART = "multipart/form-data"
RAW = (
    "text/csv",
    "application/json",
    "application/x-ndjson",
    "application/zip",
    "application/octet-stream",
)
# Other names of the same types: what a file is, its content says.
_ALIASES = ("text/plain", "application/jsonl", "application/x-zip-compressed", "application/vnd.ms-excel")

SYNCHRONOUS_BYTES = 16 * 1024 * 1024
"""Larger files are not read in one request."""
MAX_FIELDS = 20
MAX_FIELD_BYTES = 64 * 1024
MAX_FILENAME = 200


@dataclass(frozen=True, slots=True)
class Upload:
    """A file and what came beside it."""

    data: bytes
    fields: tuple[tuple[str, str], ...]
    filename: str | None
    content_type: str | None


async def read_file(request: Request) -> Upload:
    """The uploaded file; 415 for another kind of body, 413 for too large a one, 400 for a broken multipart."""
    media_type = require_media_type(request, (MULTIPART, *RAW, *_ALIASES), (MULTIPART, *RAW))
    limit = min(request.app.state.settings.max_upload, SYNCHRONOUS_BYTES)
    body = await read_body(request, limit, "import-too-large")
    query = tuple(request.query_params.multi_items())
    if media_type != MULTIPART:
        return Upload(body, query, None, media_type)
    return _with_query(await _parts(request, body), query)


class _InMemory(MultiPartParser):
    """Parts stay in memory: the whole body is bounded, and a read-only root has nowhere to spool to."""

    spool_max_size = 2 * SYNCHRONOUS_BYTES


async def _parts(request: Request, body: bytes) -> FormData:
    async def stream() -> AsyncGenerator[bytes, None]:
        yield body

    parser = _InMemory(request.headers, stream(), max_files=1, max_fields=MAX_FIELDS, max_part_size=MAX_FIELD_BYTES)
    try:
        return await parser.parse()
    except MultiPartException:
        detail = f"The multipart body cannot be read: it needs a boundary, one file and at most {MAX_FIELDS} fields."
        raise Problem("malformed-request", detail) from None


def _with_query(form: FormData, query: Iterable[tuple[str, str]]) -> Upload:
    file = form.get("file")
    if not isinstance(file, UploadFile):
        error = PayloadError(detail="The form needs a part with a file name.", code="missing", parameter="file")
        raise Problem("invalid-parameter", error.detail, errors=[error])
    fields = [(name, value) for name, value in form.multi_items() if isinstance(value, str)]
    if len(form.multi_items()) != len(fields) + 1:
        raise invalid_parameter("file", "Only the part `file` is a file.", "unknown-parameter")
    data = file.file.read()
    file.file.close()
    return Upload(data, (*fields, *query), _base_name(file.filename), file.content_type)


def _base_name(filename: str | None) -> str | None:
    """The last part of what the sender calls the file, of bounded length and without control characters."""
    name = PurePosixPath((filename or "").replace("\\", "/")).name
    return "".join(character for character in name if character.isprintable())[:MAX_FILENAME] or None
