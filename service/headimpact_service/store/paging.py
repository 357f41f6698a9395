"""Lists: keyset pages, and the opaque cursors that name where the next one begins."""

from __future__ import annotations

import binascii
import struct
from base64 import urlsafe_b64decode, urlsafe_b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from hashlib import blake2b
from typing import Any, Generic, Protocol, TypeVar

from sqlalchemy import Select, Table, literal, tuple_

from headimpact_service.errors import Problem
from headimpact_service.store.columns import EPOCH, MICROSECOND, Identifier, Instant
from headimpact_service.store.ids import LENGTH


class Positioned(Protocol):
    """A row that a list can go on behind."""

    @property
    def id(self) -> bytes:
        """Its identifier."""

    @property
    def updated_at(self) -> datetime:
        """When it last changed."""


Row = TypeVar("Row")
Kept = TypeVar("Kept", bound=Positioned)
Columns = TypeVar("Columns", bound=tuple[Any, ...])

_FORM = struct.Struct(f">4sq{LENGTH}s4s")
_LATEST = (datetime.max.replace(tzinfo=EPOCH.tzinfo) - EPOCH) // MICROSECOND


@dataclass(frozen=True, slots=True)
class Position:
    """The last row of a page: the next page begins behind it."""

    updated_at: datetime
    id: bytes


@dataclass(frozen=True, slots=True)
class Page(Generic[Row]):
    """Some rows of a list, and where it goes on; `next` is None on the last page."""

    rows: tuple[Row, ...]
    next: Position | None


def encode_cursor(position: Position, of: str) -> str:
    """An opaque cursor for the list and filters that `of` names."""
    microseconds = (position.updated_at - EPOCH) // MICROSECOND
    mark = _mark(of)
    packed = _FORM.pack(mark, microseconds, position.id, _check(mark, microseconds, position.id))
    return urlsafe_b64encode(packed).rstrip(b"=").decode()


def decode_cursor(cursor: str, of: str) -> Position:
    """The position in a cursor; a `bad-cursor` problem if it was not made by :func:`encode_cursor` for `of`."""
    try:
        raw = cursor.encode("ascii")
        mark, microseconds, identifier, check = _FORM.unpack(urlsafe_b64decode(raw + b"=" * (-len(raw) % 4)))
    except (UnicodeEncodeError, binascii.Error, struct.error):
        raise _bad_cursor() from None
    if mark != _mark(of) or not 0 <= microseconds <= _LATEST or check != _check(mark, microseconds, identifier):
        raise _bad_cursor()
    return Position(EPOCH + timedelta(microseconds=microseconds), identifier)


def _check(mark: bytes, microseconds: int, identifier: bytes) -> bytes:
    """Tells a cursor that was altered or cut on its way; it is no secret."""
    return blake2b(mark + microseconds.to_bytes(8, "big") + identifier, digest_size=4).digest()


def _mark(of: str) -> bytes:
    return blake2b(of.encode(errors="backslashreplace"), digest_size=4).digest()


def _bad_cursor() -> Problem:
    return Problem("bad-cursor", "The cursor was not made by this list with these filters.")


def keyset(
    query: Select[Columns], table: Table, *, updated_since: datetime | None, after: Position | None, limit: int
) -> Select[Columns]:
    """One page of a query on `table`, with one row more to see whether it goes on.

    Newest first and without tombstones; with `updated_since`, in the order of change and with tombstones, so that a
    client which follows the list to its end has missed nothing.
    """
    if updated_since is not None:
        return _by_change(query, table, updated_since, after).limit(limit + 1)
    if "deleted_at" in table.c:
        query = query.where(table.c.deleted_at.is_(None))
    if after is not None:
        query = query.where(table.c.id < after.id)
    return query.order_by(table.c.id.desc()).limit(limit + 1)


def _by_change(
    query: Select[Columns], table: Table, updated_since: datetime, after: Position | None
) -> Select[Columns]:
    """In the order of change, from an instant on or behind a position."""
    if after is None:
        query = query.where(table.c.updated_at >= updated_since)
    else:
        # Typed, or the driver would send the instant in a form of its own.
        position = tuple_(literal(after.updated_at, Instant()), literal(after.id, Identifier))
        query = query.where(tuple_(table.c.updated_at, table.c.id) > position)
    return query.order_by(table.c.updated_at, table.c.id)


def page_of(rows: Sequence[Kept], limit: int) -> Page[Kept]:
    """The page of the rows that a :func:`keyset` query gave."""
    kept = tuple(rows[:limit])
    more = len(rows) > limit
    return Page(kept, Position(kept[-1].updated_at, kept[-1].id) if more else None)
