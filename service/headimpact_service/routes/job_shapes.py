"""Jobs as they are answered, and what a request may say about the job that it makes."""

from __future__ import annotations

import re
from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel, Field
from starlette.requests import Request
from starlette.responses import Response

from headimpact_service.answers import answer
from headimpact_service.errors import invalid_parameter
from headimpact_service.problem_shapes import ProblemDocument
from headimpact_service.routes.import_shapes import ImportResult
from headimpact_service.store import ids
from headimpact_service.store.jobs import Job

LOCATION = {"Location": "The job's address."}
IDEMPOTENCY_KEY = {
    "Idempotency-Key": "Your name for a request that becomes a job: sent again with the same request it answers the "
    "same job, with another it is 409. 1 to 200 visible ASCII characters."
}
PREFER = {"Prefer": "`respond-async` makes a job of a small file too."}

_KEY = re.compile(r"[!-~]{1,200}")
_RESPOND_ASYNC = re.compile(r"(^|[,;\s])respond-async($|[,;\s])", re.IGNORECASE)

State = Literal["queued", "running", "cancelling", "succeeded", "failed", "cancelled"]
JobKind = Literal["import", "fit", "rescore"]


class ProgressView(BaseModel):
    """How far a job is."""

    done: int = Field(description="Impacts that are committed; of a fit, 1 once it is.")
    total: int | None = Field(description="Null until it is known.")


class GateView(BaseModel):
    """How a model did at one gate."""

    gate: str
    criterion: str | None
    value: Any = Field(description="What was measured.")
    bound: Any = Field(description="What it must keep to.")
    passed: bool
    detail: str


class FitResult(BaseModel):
    """What a fit came to."""

    version: str | None = Field(description="Of the model; null where there is none.")
    skipped: str | None = Field(description="Why a schedule had nothing to do.")
    promoted: bool = Field(description="Whether it is active now, having passed every gate.")
    not_promoted: str | None = Field(description="Why it is not, although it passed every gate.")
    gates: list[GateView] | None = Field(description="Of a schedule's fit.")


class RescoreSummary(BaseModel):
    """How many of each."""

    scored: int
    unchanged: int = Field(description="The same score was there.")
    changed: int = Field(description="Corrected or deleted while the job ran; left alone.")
    failed: int


class RescoreResult(BaseModel):
    """What a re-score came to."""

    summary: RescoreSummary


class JobView(BaseModel):
    """A job."""

    id: str
    kind: JobKind
    state: State
    progress: ProgressView
    result: ImportResult | FitResult | RescoreResult | None = Field(
        description="Once the job has ended: what it came to, also where it stopped."
    )
    problem: ProblemDocument | None = Field(description="Why it failed, or was cancelled.")
    created_at: datetime
    updated_at: datetime
    started_at: datetime | None
    finished_at: datetime | None


class JobList(BaseModel):
    """A page of jobs."""

    data: list[JobView]
    next_cursor: str | None


def idempotency_key(request: Request) -> str | None:
    """The request's own name, if it gives one; 422 for one that cannot be."""
    key = request.headers.get("idempotency-key")
    if key is not None and _KEY.fullmatch(key) is None:
        raise invalid_parameter("Idempotency-Key", "Must have 1 to 200 visible ASCII characters.", "idempotency-key")
    return key


def prefers_job(request: Request) -> bool:
    """Whether the caller asked not to wait (RFC 7240)."""
    return any(_RESPOND_ASYNC.search(value) for value in request.headers.getlist("prefer"))


def job_document(job: Job) -> dict[str, Any]:
    """A job as it is answered."""
    return {
        "id": ids.encode("job", job.id),
        "kind": job.kind,
        "state": job.state,
        "progress": {"done": job.done, "total": job.total},
        "result": None if job.result is None else {**job.result, **(job.details or {})},
        "problem": job.problem,
        "created_at": job.created_at,
        "updated_at": job.updated_at,
        "started_at": job.started_at,
        "finished_at": job.finished_at,
    }


def accepted(job: Job) -> Response:
    """The 202 of a request that made a job."""
    return answer(job_document(job), 202, {"Location": f"/v1/jobs/{ids.encode('job', job.id)}"})
