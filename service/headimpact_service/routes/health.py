"""Whether the process lives, and whether it can serve."""

from __future__ import annotations

from typing import Literal

from anyio.to_thread import run_sync
from pydantic import BaseModel
from starlette.responses import Response

from headimpact_service.answers import answer
from headimpact_service.operation import PUBLIC, Answer, Call, Routes
from headimpact_service.store.database import Database

routes = Routes("health")


class Liveness(BaseModel):
    """The process answers."""

    status: Literal["ok"]


class Readiness(BaseModel):
    """The process can serve; `warnings` are what an operator should know and no reason to take it out of service."""

    status: Literal["ok"]
    warnings: list[str]


@routes("GET", "/livez", "Whether the process lives", PUBLIC, {200: Answer(Liveness, "It does.")})
async def read_liveness(call: Call) -> Response:  # noqa: ARG001 - the shape of a handler
    """Says nothing of the database: a process that waits for it must not be killed for that."""
    return answer({"status": "ok"})


@routes("GET", "/readyz", "Whether requests can be served", PUBLIC, {200: Answer(Readiness, "They can.")})
async def read_readiness(call: Call) -> Response:
    """The database answers and has this version's schema; 503 otherwise."""
    database: Database = call.request.app.state.database
    await run_sync(database.check)
    warnings = await run_sync(database.warnings) + await run_sync(call.request.app.state.uploads.warnings)
    return answer({"status": "ok", "warnings": warnings})
