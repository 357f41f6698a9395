"""An uploaded file: the raw body with its fields as query parameters, or one part of a multipart body."""

from __future__ import annotations

from collections.abc import AsyncGenerator, AsyncIterator, Iterable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import BinaryIO, cast

from anyio.to_thread import run_sync
from starlette.datastructures import FormData, UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.requests import Request

from headimpact_service.bodies import body_parts, require_media_type
from headimpact_service.errors import PayloadError, Problem, invalid_parameter
from headimpact_service.store.uploads import Incoming

MULTIPART = "multipart/form-data"
RAW = (
    "text/csv",
    "application/json",
    "application/x-ndjson",
    "application/vnd.apache.parquet",
    "application/vnd.apache.arrow.file",
    "application/vnd.apache.arrow.stream",
    "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
    "application/x-matlab-data",
    "application/zip",
    "application/octet-stream",
)
# Other names of the same types: what a file is, its content says.
_ALIASES = ("text/plain", "application/jsonl", "application/x-zip-compressed", "application/vnd.ms-excel")

SYNCHRONOUS_BYTES = 16 * 1024 * 1024
"""Larger files are read by a job."""
MAX_FIELDS = 20
MAX_FIELD_BYTES = 64 * 1024
MAX_FILENAME = 200


@dataclass(frozen=True, slots=True)
class Upload:
    """A file and what came beside it."""

    file: Incoming
    fields: tuple[tuple[str, str], ...]
    filename: str | None
    content_type: str | None


@asynccontextmanager
async def received(request: Request) -> AsyncIterator[Upload]:
    """The uploaded file, which is gone with the block unless it is kept.

    415 for another kind of body, 413 for too large a one, 400 for a broken multipart.
    """
    media_type = require_media_type(request, (MULTIPART, *RAW, *_ALIASES), (MULTIPART, *RAW))
    parts = body_parts(request, request.app.state.settings.max_upload, "import-too-large")
    query = tuple(request.query_params.multi_items())
    with request.app.state.uploads.receive(SYNCHRONOUS_BYTES) as file:
        if media_type == MULTIPART:
            yield _with_query(await _form(request, parts, file), file, query)
        else:
            async for part in parts:
                await _write(file, part)
            yield Upload(file, query, None, media_type)


async def _write(file: Incoming, part: bytes) -> None:
    """Append, beside the event loop once that may wait for the disk."""
    if file.is_large:
        await run_sync(file.write, part)
    else:
        file.write(part)


class _IntoFile(MultiPartParser):
    """The one file of a form goes where uploads go, not to the system's temporary folder."""

    def __init__(self, request: Request, parts: AsyncGenerator[bytes, None], file: Incoming) -> None:
        super().__init__(request.headers, parts, max_files=1, max_fields=MAX_FIELDS, max_part_size=MAX_FIELD_BYTES)
        self._file = file

    def on_headers_finished(self) -> None:
        super().on_headers_finished()
        begun = self._current_part.file
        if begun is not None:
            begun.file.close()
            self._current_part.file = UploadFile(
                file=cast("BinaryIO", self._file), size=0, filename=begun.filename, headers=begun.headers
            )


async def _form(request: Request, parts: AsyncGenerator[bytes, None], file: Incoming) -> FormData:
    try:
        return await _IntoFile(request, parts, file).parse()
    except MultiPartException:
        detail = f"The multipart body cannot be read: it needs a boundary, one file and at most {MAX_FIELDS} fields."
        raise Problem("malformed-request", detail) from None


def _with_query(form: FormData, file: Incoming, query: Iterable[tuple[str, str]]) -> Upload:
    part = form.get("file")
    if not isinstance(part, UploadFile):
        error = PayloadError(detail="The form needs a part with a file name.", code="missing", parameter="file")
        raise Problem("invalid-parameter", error.detail, errors=[error])
    fields = [(name, value) for name, value in form.multi_items() if isinstance(value, str)]
    if len(form.multi_items()) != len(fields) + 1:
        raise invalid_parameter("file", "Only the part `file` is a file.", "unknown-parameter")
    return Upload(file, (*fields, *query), _base_name(part.filename), part.content_type)


def _base_name(filename: str | None) -> str | None:
    """The last part of what the sender calls the file, of bounded length and without control characters."""
    name = PurePosixPath((filename or "").replace("\\", "/")).name
    return "".join(character for character in name if character.isprintable())[:MAX_FILENAME] or None
