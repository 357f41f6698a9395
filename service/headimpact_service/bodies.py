"""Request bodies: bounded while they stream, inflated under the same bound, given up when the client stalls."""

from __future__ import annotations

import asyncio
import zlib
from collections.abc import AsyncGenerator, Iterable, Iterator
from contextlib import suppress
from typing import TypeVar

from pydantic import BaseModel
from starlette.requests import Request
from starlette.types import Message

from headimpact_service.answers import JSON
from headimpact_service.errors import Problem
from headimpact_service.ingest.json_faults import parse

Model = TypeVar("Model", bound=BaseModel)

SLOWEST_BYTES_PER_S = 16 * 1024
"""A client that keeps up this rate is never given up, however large its body."""

MAX_DISCARDED = 64 * 1024 * 1024
"""Bytes beyond the bound that are taken and dropped, so that their sender hears why."""

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
    """The whole body, inflated if it is gzip; 413 where it, sent or inflated, passes `limit` bytes."""
    parts = [part async for part in body_parts(request, limit, slug)]
    return parts[0] if len(parts) == 1 else b"".join(parts)


async def body_parts(request: Request, limit: int, slug: str) -> AsyncGenerator[bytes, None]:
    """The same as it arrives, in parts of bounded size."""
    body = _Body(request, limit, slug)
    try:
        body.require_size()
        while body.more:
            for part in body.take(await body.next_message()):
                yield part
    except Problem as problem:
        if problem.slug == slug:
            await body.discard()
        raise


class _Body:
    """A body as it arrives, within its bounds of size and time."""

    def __init__(self, request: Request, limit: int, slug: str) -> None:
        self._request = request
        self.limit, self.slug = limit, slug
        self.received, self.more = 0, True
        self._inflate = _inflater(request, limit, slug)
        self._until = asyncio.get_running_loop().time() + request.app.state.settings.body_timeout_s

    @property
    def deadline(self) -> float:
        """When the next bytes must be there, on the loop's clock."""
        return float(self._until + self.received / SLOWEST_BYTES_PER_S)

    @property
    def declared(self) -> int:
        """How many bytes the client says that it sends; 0 where it does not."""
        length = self._request.headers.get("content-length", "")
        return int(length) if length.isdigit() else 0

    def require_size(self) -> None:
        """Refuse a body that is declared to be too large."""
        if self.declared > self.limit:
            raise _too_large(self.limit, self.slug)

    async def next_message(self) -> Message:
        """What the server brings next; 408 where that does not come in time."""
        try:
            async with asyncio.timeout_at(self.deadline):
                return await self._request.receive()
        except TimeoutError:
            raise _given_up() from None

    def take(self, message: Message) -> Iterable[bytes]:
        """What one message of the server brings, inflated."""
        if message["type"] == "http.disconnect":
            raise Problem("malformed-request", "The body ended before it was complete.")
        chunk: bytes = message.get("body", b"")
        self.more = message.get("more_body", False)
        self.received += len(chunk)
        if self.received > self.limit:
            raise _too_large(self.limit, self.slug)
        return (chunk,) if self._inflate is None else self._inflate.feed(chunk, more=self.more)

    async def discard(self) -> None:
        """Take what is left of a refused body and drop it: a client that is still sending hears no answer.

        What is far larger, or comes too slowly, is cut off. A client that asked whether it may send is told at once.
        """
        most = self.limit + MAX_DISCARDED
        if self.declared > most or (not self.received and "expect" in self._request.headers):
            return
        with suppress(TimeoutError):
            async with asyncio.timeout_at(self.deadline):
                while self.more and self.received <= most:
                    message = await self._request.receive()
                    self.more = message.get("more_body", False)
                    self.received += len(message.get("body", b""))


def _given_up() -> Problem:
    return Problem("request-timeout", "The body did not arrive in time.", headers={"Connection": "close"})


def _too_large(limit: int, slug: str) -> Problem:
    # The rest of the body may not have been read: the connection ends with the answer.
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
