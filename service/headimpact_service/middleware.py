"""The outermost layer: a request id on every answer, a 500 that tells nothing but that id, one log line if wanted."""

from __future__ import annotations

import asyncio
import logging
import os
import re
import time
from typing import Any

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from headimpact_service.answers import problem_answer
from headimpact_service.errors import Problem

LOG = logging.getLogger("headimpact.request")
RETRY_AFTER_S = "10"
"""When to try again a service that is shutting down: another one takes a while to start."""
_USABLE_ID = re.compile(rb"[\w.:/+=@-]{1,128}", re.ASCII)
_ALWAYS = ((b"x-content-type-options", b"nosniff"), (b"referrer-policy", b"no-referrer"))
_PRIVATE = (b"cache-control", b"no-store")


class Edge:
    """Pure ASGI: everything else runs inside it, so no answer leaves without its id."""

    def __init__(self, app: ASGIApp, *, access_log: bool = False) -> None:
        self.app = app
        self.access_log = access_log

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Run one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request_id = _request_id(scope)
        # Answers about people stay out of shared caches; pages and their assets may be kept.
        private = scope["path"].startswith("/v1")
        status = 0
        started = time.perf_counter()

        async def send_with_id(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                extra = (*_ALWAYS, _PRIVATE) if private else _ALWAYS
                message["headers"] = [*message["headers"], (b"x-request-id", request_id), *extra]
            await send(message)

        try:
            await self.app(scope, receive, send_with_id)
        except asyncio.CancelledError:  # nobody cancels a request but the server that is told to stop, at its last
            LOG.warning("cut_off", extra=_fields(scope, request_id))
            if status:
                raise
            problem = Problem("unavailable", "The service is shutting down.", headers={"Retry-After": RETRY_AFTER_S})
            await problem_answer(problem)(scope, receive, send_with_id)
        except Exception:
            LOG.exception("uncaught", extra=_fields(scope, request_id))
            if status:  # too late for another answer: end the connection, so that the client sees a broken one
                raise
            detail = f"The fault is logged under the id {request_id.decode()}."
            await problem_answer(Problem("internal-error", detail))(scope, receive, send_with_id)
        finally:
            if self.access_log:
                duration = round((time.perf_counter() - started) * 1000, 3)
                LOG.info("answered", extra=_fields(scope, request_id) | {"status": status, "duration_ms": duration})


def _request_id(scope: Scope) -> bytes:
    for name, value in scope["headers"]:
        if name == b"x-request-id" and _USABLE_ID.fullmatch(value):
            return bytes(value)
    return new_request_id().encode()


def new_request_id() -> str:
    """An id for a request that brought none."""
    return os.urandom(12).hex()


def _fields(scope: Scope, request_id: bytes) -> dict[str, Any]:
    return {"request_id": request_id.decode(), "method": scope["method"], "path": scope["path"]}
