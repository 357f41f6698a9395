"""Request bodies: bounded while they stream, inflated under the same bound, given up when the client stalls."""

from __future__ import annotations

import asyncio
import zlib
from collections.abc import AsyncGenerator, Iterable, Iterator
from typing import TypeVar

from pydantic import BaseModel
from starlette.requests import Request

from headimpact_service.answers import JSON
from headimpact_service.errors import Problem
from headimpact_service.ingest.json_faults import parse

Model = TypeVar("Model", bound=BaseModel)

SLOWEST_BYTES_PER_S = 16 * 1024
"""A client that keeps up this rate is never given up, however large its body."""

MAX_MEMBERS = 64
"""Of one gzip body: thousands of empty members would cost seconds and inflate to nothing."""
_GZIP = 16 + zlib.MAX_WBITS
_PART = 1024 * 1024


def media_type_of(request: Request) -> str:
    """The request's media type in lower case, without parameters; empty when none is given."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


def require_media_type(request: Request, accepted: Iterable[str], named: Iterable[str] = ()) -> str:
    """The request's media type; 415, with those that are `named`, unless it is one of `accepted`."""
    accepted = tuple(accepted)
    media_type = media_type_of(request)
    if media_type not in accepted:
        raise Problem("unsupported-media-type", f"This operation reads {', '.join(named or accepted)}.")
    return media_type


async def read_body(request: Request, limit: int, slug: str = "body-too-large") -> bytes:
    """The whole body, inflated if it is gzip; 413 as soon as it, sent or inflated, passes `limit` bytes."""
    parts = [part async for part in body_parts(request, limit, slug)]
    return parts[0] if len(parts) == 1 else b"".join(parts)


async def body_parts(request: Request, limit: int, slug: str) -> AsyncGenerator[bytes, None]:
    """The same as it arrives, in parts of bounded size."""
    inflate = _inflater(request, limit, slug)
    declared = request.headers.get("content-length", "")
    if declared.isdigit() and int(declared) > limit:
        raise _too_large(limit, slug)
    received, more = 0, True
    loop = asyncio.get_running_loop()
    started, patience = loop.time(), request.app.state.settings.body_timeout_s
    while more:
        deadline = started + patience + received / SLOWEST_BYTES_PER_S
        chunk, more = await _next_chunk(request, deadline)
        received += len(chunk)
        if received > limit:
            raise _too_large(limit, slug)
        if inflate is None:
            yield chunk
        else:
            for part in inflate.feed(chunk, more=more):
                yield part


async def _next_chunk(request: Request, deadline: float) -> tuple[bytes, bool]:
    try:
        async with asyncio.timeout_at(deadline):
            message = await request.receive()
    except TimeoutError:
        raise Problem("request-timeout", "The body did not arrive in time.", headers={"Connection": "close"}) from None
    if message["type"] == "http.disconnect":
        raise Problem("malformed-request", "The body ended before it was complete.")
    return message.get("body", b""), message.get("more_body", False)


def _too_large(limit: int, slug: str) -> Problem:
    # The rest of the body is not worth reading: the connection ends with the answer.
    return Problem(slug, f"The body may have at most {limit} bytes.", headers={"Connection": "close"})


def _inflater(request: Request, limit: int, slug: str) -> _Gzip | None:
    encoding = request.headers.get("content-encoding", "identity").strip().lower()
    if encoding == "identity":
        return None
    if encoding not in {"gzip", "x-gzip"}:
        raise Problem("unsupported-media-type", "Content-Encoding may be identity or gzip.")
    return _Gzip(limit, slug)


class _Gzip:
    """A gzip body of one or more members as it arrives, never inflated beyond the bound."""

    def __init__(self, limit: int, slug: str) -> None:
        self.limit, self.slug, self.room = limit, slug, limit
        self.members = 1
        self.member = zlib.decompressobj(_GZIP)

    def feed(self, data: bytes, *, more: bool) -> Iterator[bytes]:
        """What the next bytes inflate to; without `more` they are the last."""
        while data:
            if self.member.eof:
                self._next_member()
            yield self._inflate(data)
            data = self.member.unconsumed_tail or self.member.unused_data
        if not more and not self.member.eof:
            raise Problem("malformed-request", "The gzip body is not complete.")

    def _inflate(self, data: bytes) -> bytes:
        try:
            part = self.member.decompress(data, min(_PART, self.room + 1))
        except zlib.error:
            raise Problem("malformed-request", "The body is not valid gzip.") from None
        self.room -= len(part)
        if self.room < 0:
            raise _too_large(self.limit, self.slug)
        return part

    def _next_member(self) -> None:
        self.members += 1
        if self.members > MAX_MEMBERS:
            raise Problem("malformed-request", f"The gzip body may have at most {MAX_MEMBERS} members.")
        self.member = zlib.decompressobj(_GZIP)


async def read_json(request: Request, model: type[Model]) -> Model:
    """A JSON body as `model`: media type (415), size (413), JSON (400), payload (422), in that order."""
    require_media_type(request, (JSON,))
    return parse(await read_body(request, request.app.state.settings.max_body), model)
