"""The server process: uvicorn, with a guard against clients that stall."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from typing import Any, ClassVar

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from headimpact_service.answers import PROBLEM_JSON, json_bytes
from headimpact_service.errors import Problem
from headimpact_service.middleware import new_request_id
from headimpact_service.settings import Settings

MAX_HEAD = 64 * 1024
"""Bytes of a request's target and header fields."""
MAX_UNPARSED = 1024 * 1024
"""Bytes in which a head must end: what is read at once may hold the end of another body, too."""
SHUTDOWN_S = 20
"""Requests under way may take this long to end once the process is told to stop."""


class GuardedProtocol(HttpToolsProtocol):
    """Closes a connection whose request head, or the rest of a body already answered, does not come in time.

    uvicorn has no such bound: without it a few thousand silent connections hold the service. (A body that is still
    being read is given up by `bodies.read_body`, with 408.)
    """

    head_timeout_s: ClassVar[float] = 20.0
    rest_timeout_s: ClassVar[float] = 30.0
    guard: asyncio.TimerHandle | None = None
    head_is_open = False
    """A head has begun, and is not there as a whole."""
    head_bytes = 0
    """Of the target and the header fields that are there as a whole, trailers among them."""
    unparsed_bytes = 0
    """Received while a head was open: with its last field, of which nothing is told before its end."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override] # as uvicorn has it
        """A new connection owes a head."""
        super().connection_made(transport)
        self._expect_within(self.head_timeout_s)

    def connection_lost(self, exc: Exception | None) -> None:
        """Nothing is owed any more."""
        self._met()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """A head of which only a part has come: the rest is owed, also on a connection that is kept."""
        super().data_received(data)
        if not self.head_is_open:
            return
        self.unparsed_bytes += len(data)
        if self.unparsed_bytes > MAX_UNPARSED and not self.transport.is_closing():
            self.send_400_response("")
        elif self.guard is None:
            self._expect_within(self.head_timeout_s)

    def on_message_begin(self) -> None:
        """The first byte of a request."""
        super().on_message_begin()
        self.head_is_open = True
        self.head_bytes = self.unparsed_bytes = 0

    def on_url(self, url: bytes) -> None:
        """The target, or a part of it."""
        self._count(len(url))
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """A field of the head, or of the trailer behind a body in chunks."""
        self._count(len(name) + len(value) + len(": \r\n"))
        super().on_header(name, value)

    def _count(self, size: int) -> None:
        """Refuse a head that is too long: the parser makes a 400 of it."""
        self.head_bytes += size
        if self.head_bytes > MAX_HEAD:
            raise ValueError

    def on_headers_complete(self) -> None:
        """The head is there."""
        self.head_is_open = False
        self._met()
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        """The whole request is there."""
        self._met()
        super().on_message_complete()

    def on_response_complete(self) -> None:
        """An answer that did not wait for the whole body: the rest is discarded for a while, not for ever."""
        super().on_response_complete()
        if self.cycle.more_body and not self.transport.is_closing():
            self._expect_within(self.rest_timeout_s)

    def send_400_response(self, msg: str) -> None:  # noqa: ARG002 - uvicorn's own words are not for callers
        """What is no HTTP, or a head of more than 64 KiB, gets the same form of answer as everything else."""
        detail = (
            "This is not an HTTP/1.1 request, or its method is none that is known, its head is too long, or its body "
            "is not in chunks as they are announced."
        )
        problem = Problem("malformed-request", detail)
        body = json_bytes(problem.as_dict())
        head = (
            "HTTP/1.1 400 Bad Request\r\n"
            f"content-type: {PROBLEM_JSON}\r\ncontent-length: {len(body)}\r\n"
            f"x-request-id: {new_request_id()}\r\nconnection: close\r\n\r\n"
        )
        self.transport.write(head.encode() + body)
        self.transport.close()

    def _expect_within(self, seconds: float) -> None:
        self._met()
        self.guard = self.loop.call_later(seconds, self._give_up)

    def _met(self) -> None:
        if self.guard is not None:
            self.guard.cancel()
            self.guard = None

    def _give_up(self) -> None:
        self.guard = None
        if not self.transport.is_closing():
            self.transport.close()


class Server(uvicorn.Server):
    """uvicorn's server, which says when it listens."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[], None]) -> None:
        """`ready` is called once, when connections are accepted."""
        super().__init__(config)
        self.ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start, then say so."""
        await super().startup(sockets)
        if self.started:
            self.ready()


def listen(settings: Settings) -> socket.socket:
    """A bound socket, so that the address is known, or refused, before anything else is said."""
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((settings.host, settings.port))
    except OSError:
        listener.close()
        raise
    return listener


def run(app: ASGIApp, settings: Settings, listener: socket.socket, ready: Callable[[], None]) -> None:
    """Serve until the process is told to stop; requests under way are answered first."""
    bounds: dict[str, Any] = {"head_timeout_s": settings.head_timeout_s, "rest_timeout_s": settings.body_timeout_s}
    config = uvicorn.Config(
        app,
        http=type("BoundedProtocol", (GuardedProtocol,), bounds),
        ws="none",
        lifespan="on",
        access_log=False,
        log_config=None,
        server_header=False,
        timeout_graceful_shutdown=SHUTDOWN_S,
    )
    with listener:
        Server(config, ready).run(sockets=[listener])
