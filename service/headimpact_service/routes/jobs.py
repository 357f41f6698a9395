"""Jobs: what was ordered, how far it is, what came of it; and the way to stop it."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import Field
from starlette.responses import Response

from headimpact_service import deps
from headimpact_service.answers import answer
from headimpact_service.operation import ANY_KEY, Answer, Call, Routes
from headimpact_service.parameters import ListQuery
from headimpact_service.routes.job_shapes import JobKind, JobList, JobView, State, job_document
from headimpact_service.routes.lists import MEDIA_TYPES, Listing, answer_list
from headimpact_service.routes.tables import Cell
from headimpact_service.store import ids, jobs
from headimpact_service.store.jobs import Job

routes = Routes("jobs")

SEEN_WITH: Mapping[str, frozenset[str]] = {
    "import": frozenset({"impacts:read", "impacts:write"}),
    "fit": frozenset({"models:read", "models:fit"}),
    "rescore": frozenset({"impacts:read", "impacts:write"}),
}
"""One of these scopes is needed to see a job of a kind."""
STOPPED_WITH: Mapping[str, str] = {"import": "impacts:write", "fit": "models:fit", "rescore": "impacts:write"}
"""The scope that cancels a job of a kind is the one that makes it."""


class JobQuery(ListQuery):
    """Which jobs."""

    state: State | None = Field(None, description="Only jobs in this state.")
    kind: JobKind | None = Field(None, description="Only jobs of this kind.")


@routes(
    "GET",
    "/v1/jobs",
    "List jobs",
    ANY_KEY,
    {200: Answer(JobList, "A page of jobs, newest first.", MEDIA_TYPES)},
    query=JobQuery,
    problems=("bad-cursor",),
)
async def list_jobs(call: Call) -> Response:
    """Those whose kind the key's scopes let it see. Ended jobs are kept for 30 days unless configured otherwise."""
    query: JobQuery = call.query
    kinds = {kind for kind, scopes in SEEN_WITH.items() if scopes & call.key.scopes and query.kind in {None, kind}}
    listing = Listing(
        "jobs",
        lambda conn, after, limit: jobs.page(
            conn, call.data_set_id, kinds=kinds, state=query.state, limit=limit, after=after
        ),
        job_document,
        ("id", "kind", "state", "done", "total", "created_at", "updated_at", "started_at", "finished_at"),
        _cells,
    )
    return await answer_list(call, listing, query)


@routes(
    "GET",
    "/v1/jobs/{job_id}",
    "Read a job",
    ANY_KEY,
    {200: Answer(JobView, "The job.")},
    problems=("not-found", "insufficient-scope"),
)
async def read_job(call: Call) -> Response:
    """`result` and `problem` are there once it has ended. A fit is seen with a scope for models, others for impacts."""
    return answer(job_document(await _visible(call)))


@routes(
    "DELETE",
    "/v1/jobs/{job_id}",
    "Cancel a job",
    ANY_KEY,
    {
        200: Answer(JobView, "It is cancelled."),
        202: Answer(JobView, "It stops before its next part."),
    },
    problems=("not-found", "insufficient-scope", "conflict"),
)
async def cancel_job(call: Call) -> Response:
    """What is stored stays stored. A job that has ended otherwise is 409."""
    found = await _visible(call)
    scope = STOPPED_WITH[found.kind]
    if scope not in call.key.scopes:
        raise deps.scope_missing(scope)
    job = await deps.write(call.request, lambda conn: jobs.cancel(conn, call.data_set_id, found.id))
    call.request.app.state.engine.wake()
    if job.ended:
        call.request.app.state.uploads.remove(ids.encode("job", job.id))
    return answer(job_document(job), 200 if job.ended else 202)


async def _visible(call: Call) -> Job:
    """The job in the path, if the key may see it."""
    job_id = deps.identifier("job", call.path("job_id"), "job")
    job = await deps.read(call.request, lambda conn: jobs.require(conn, call.data_set_id, job_id))
    if not SEEN_WITH[job.kind] & call.key.scopes:
        scopes = " or ".join(sorted(SEEN_WITH[job.kind]))
        raise deps.scope_missing(scopes)
    return job


def _cells(job: Job) -> list[Cell]:
    times = (job.created_at, job.updated_at, job.started_at, job.finished_at)
    return [ids.encode("job", job.id), job.kind, job.state, job.done, job.total, *times]
