"""The application: every operation, the edge around them, and what they stand on."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import cache

from anyio.to_thread import run_sync
from fastapi import FastAPI
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute

from headimpact_service import deps, openapi
from headimpact_service.answers import problem_answer
from headimpact_service.errors import PROBLEMS, Problem
from headimpact_service.middleware import Edge
from headimpact_service.operation import Operation
from headimpact_service.pages import docs, problems
from headimpact_service.routes import (
    athletes,
    devices,
    diagnoses,
    fits,
    health,
    impact_parts,
    impacts,
    imports,
    jobs,
    keys,
    labels,
    models,
    schedules,
    scoring,
    settings,
)
from headimpact_service.routes.facts import Facts
from headimpact_service.routes.scorer import Scorer
from headimpact_service.settings import Settings
from headimpact_service.store.database import Database
from headimpact_service.store.unavailable import reason_of

_log = logging.getLogger(__name__)
# In the order of the documentation; the first are matched first, so the busy ones lead.
_MODULES = (
    scoring,
    impacts,
    impact_parts,
    labels,
    imports,
    jobs,
    athletes,
    diagnoses,
    devices,
    fits,
    models,
    schedules,
    keys,
    settings,
    health,
    problems,
    docs,
)
OPERATIONS: tuple[Operation, ...] = tuple(operation for module in _MODULES for operation in module.routes.operations)


def create_app(configured: Settings, database: Database, engine: deps.JobEngine | None = None) -> FastAPI:
    """The application on a migrated database; it runs the engine, and closes both when the server stops it."""
    app = FastAPI(
        openapi_url=None,  # the document and its page are operations like the others: pages/docs.py
        routes=list(_routes()),
        middleware=[Middleware(Edge, access_log=configured.access_log)],
        exception_handlers={Problem: _problem, HTTPException: _http_exception},
        lifespan=_lifespan,
        telemetry={"tracing": False, "metrics": False, "logs": False},  # its logs tell what validation refused
    )
    app.router.redirect_slashes = False  # /v1/impacts/ is another path, and nothing is there
    deps.set_up(app, configured, database, engine)
    app.state.facts = Facts()
    app.state.scorer = Scorer()
    app.state.openapi = _document()
    return app


@cache
def _routes() -> tuple[BaseRoute, ...]:
    """The same for every application of a process, as is what describes them: to make either costs half a second."""
    return tuple(openapi.routes(OPERATIONS))


@cache
def _document() -> bytes:
    return openapi.as_text(openapi.document(OPERATIONS)).encode()


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    await run_sync(app.state.engine.start)
    yield
    await run_sync(app.state.engine.stop)
    app.state.database.close()  # what is queued is written first: its senders were promised an answer


async def _problem(_: Request, problem: Exception) -> Response:
    assert isinstance(problem, Problem)
    if problem.slug == "unavailable" and problem.__cause__ is not None:
        _log.warning(problem.slug, extra={"cause": reason_of(problem.__cause__)})
    return problem_answer(problem)


async def _http_exception(_: Request, exception: Exception) -> Response:
    """What Starlette raises by itself: an unknown path."""
    assert isinstance(exception, HTTPException)
    slug = next((slug for slug, kind in PROBLEMS.items() if kind.status == exception.status_code), "internal-error")
    return problem_answer(
        Problem(slug, "There is nothing at this path." if slug == "not-found" else PROBLEMS[slug].meaning)
    )
