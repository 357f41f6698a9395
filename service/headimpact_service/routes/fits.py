"""Fits and re-scores: jobs that make a model of labelled impacts, and scores of a model."""

from __future__ import annotations

from hashlib import sha256
from typing import Any

from pydantic import Field
from starlette.responses import Response

from headimpact_service import deps
from headimpact_service.answers import json_bytes
from headimpact_service.errors import Problem
from headimpact_service.ingest.impact_json import Strict
from headimpact_service.intake import registry
from headimpact_service.operation import Answer, Call, Routes
from headimpact_service.routes.fit_shapes import CohortBody, FitBody, stored
from headimpact_service.routes.job_shapes import IDEMPOTENCY_KEY, LOCATION, JobView, accepted, idempotency_key
from headimpact_service.routes.models import Version
from headimpact_service.store import jobs, models
from headimpact_service.store.jobs import Job, NewJob

routes = Routes("models")

CHUNK = 250
"""Impacts that a re-score commits together."""


class NewFitBody(FitBody):
    """A fit, and what its model is to be called."""

    version: Version | None = Field(None, description="A name of its own unless given.", examples=["spring-2027"])


class RescoreBody(Strict):
    """Which impacts."""

    cohort: CohortBody = Field(default_factory=CohortBody)
    make_current: bool = Field(
        default=True, description="Whether the new score stands for its impact from now on; the others are kept."
    )


@routes(
    "POST",
    "/v1/models/fits",
    "Fit a model",
    "models:fit",
    {202: Answer(JobView, "A job fits it.", headers=LOCATION)},
    body=NewFitBody,
    example={"criteria": ["bam", "bric", "hic15"], "incidence": 0.0055, "seed": 1, "version": "spring-2027"},
    request_headers=IDEMPOTENCY_KEY,
    problems=("conflict", "idempotency-conflict"),
)
async def order_fit(call: Call) -> Response:
    """On the impacts that are labelled `concussion` or `no_concussion` when the job begins.

    The model gets the alias `candidate`; nothing is scored by it until somebody promotes it. The job fails with
    `cohort-unfit` where the labels allow no fit, and with `cohort-changed` where an impact left the cohort meanwhile.
    """
    body: NewFitBody = call.body
    if body.version is not None:
        registry.require_free(body.version)
        taken = await deps.read(call.request, lambda conn: models.get(conn, call.data_set_id, body.version or ""))
        if taken is not None and not await _was_ordered(call):
            raise Problem("conflict", "There is a model of this version, and versions do not change.")
    return accepted(await _order(call, "fit", {"fit": stored(body, (await call.renewed()).terms)}))


@routes(
    "POST",
    "/v1/models/{version}/scores",
    "Score stored impacts again",
    "impacts:write",
    {202: Answer(JobView, "A job scores them.", headers=LOCATION)},
    body=RescoreBody,
    example={"cohort": {"sport": "rugby"}, "make_current": True},
    request_headers=IDEMPOTENCY_KEY,
    problems=("not-found", "idempotency-conflict"),
)
async def order_rescore(call: Call) -> Response:
    """Every impact of the cohort that is there now, under this version and the organisation's present settings.

    The scores before are kept; what an impact is corrected to while the job runs is left alone.
    """
    body: RescoreBody = call.body
    version = call.path("version")
    model = await deps.read(call.request, lambda conn: registry.model_of(conn, call.data_set_id, version))
    key = (await call.renewed()).key
    arguments = {
        "version": model.version,
        "cohort": body.cohort.model_dump(mode="json", exclude_none=True),
        "make_current": body.make_current,
        "terms": {"incidence": key.incidence, "operating_points": list(key.operating_points)},
        "chunk": CHUNK,
    }
    return accepted(await _order(call, "rescore", arguments))


async def _was_ordered(call: Call) -> bool:
    """Whether the request's idempotency key has made a job: perhaps the one that made the version."""
    key = idempotency_key(call.request)
    known = await deps.read(call.request, lambda conn: jobs.keyed(conn, call.data_set_id, key))
    return known is not None


async def _order(call: Call, kind: str, arguments: dict[str, Any]) -> Job:
    key = idempotency_key(call.request)
    asked = None if key is None else sha256(json_bytes([kind, arguments])).digest()
    new = NewJob(kind=kind, arguments=arguments, key_id=call.key.id, idempotency_key=key, request_hash=asked)
    return await deps.submit(call.request, call.data_set_id, new)
