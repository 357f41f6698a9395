"""An import that a job does: the file is kept, the job ordered."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from hashlib import sha256
from typing import Any

from anyio.to_thread import run_sync
from starlette.requests import Request

from headimpact_service import deps
from headimpact_service.answers import json_bytes
from headimpact_service.errors import Problem
from headimpact_service.operation import Call
from headimpact_service.routes.job_shapes import idempotency_key, prefers_job
from headimpact_service.routes.uploads import Upload
from headimpact_service.store import ids, jobs
from headimpact_service.store.jobs import Job, NewJob

CHUNK = 500
"""Impacts that a job commits together."""


def wants_job(request: Request, upload: Upload, *, dry_run: bool) -> bool:
    """Whether a job is to be made before anybody has looked into the file."""
    return upload.file.is_large or (prefers_job(request) and not dry_run)


async def earlier_job(call: Call, upload: Upload, sent: Mapping[str, str]) -> Job | None:
    """The job that the request's idempotency key has made before; 409 if that was another request."""
    key = idempotency_key(call.request)
    if key is None:
        return None
    asked = await run_sync(partial(_request_hash, upload, sent))
    return await deps.read(call.request, lambda conn: jobs.find_same_request(conn, call.data_set_id, key, asked))


async def order_import(call: Call, upload: Upload, sent: Mapping[str, str], *, dry_run: bool) -> Job:
    """A job that imports this file."""
    if dry_run:
        raise Problem("import-too-large", "A dry run takes at most 16 MiB and 1000 impacts: send a part of the file.")
    key = idempotency_key(call.request)
    new = NewJob(
        kind="import",
        arguments=_arguments(await call.renewed(), upload, sent),
        key_id=call.key.id,
        idempotency_key=key,
        request_hash=None if key is None else await run_sync(partial(_request_hash, upload, sent)),
    )
    return await _submit(call, upload, new)


async def _submit(call: Call, upload: Upload, new: NewJob) -> Job:
    """The file first: a job whose file is not there could not be done; a file without a job is only in the way."""
    name = ids.encode("job", new.id)
    await run_sync(upload.file.keep, name)
    try:
        made = await deps.submit(call.request, call.data_set_id, new)
    except Exception:
        # A commit whose answer was lost may have ordered it; who is cut off here leaves the file to the clean-up.
        if not await deps.read(call.request, lambda conn: jobs.get(conn, call.data_set_id, new.id)):
            call.request.app.state.uploads.remove(name)
        raise
    if made.id != new.id:
        call.request.app.state.uploads.remove(name)
    return made


def _request_hash(upload: Upload, sent: Mapping[str, str]) -> bytes:
    """What was asked for: the file and the fields beside it."""
    return sha256(upload.file.digest() + json_bytes(sorted(sent.items()))).digest()


def _arguments(call: Call, upload: Upload, sent: Mapping[str, str]) -> dict[str, Any]:
    """Everything that the result depends on, as it is now: every part is scored under the same terms."""
    return {
        "fields": dict(sent),
        "known": {"filename": upload.filename, "content_type": upload.content_type},
        "terms": {"incidence": call.key.incidence, "operating_points": list(call.key.operating_points)},
        "model": call.terms.model.version,
        "chunk": CHUNK,
    }
