"""Lists that are short enough to be read whole: paged and answered as tables like every other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from hashlib import blake2b
from typing import Any, Generic, TypeVar

from headimpact_service.answers import json_bytes
from headimpact_service.routes.lists import Listing
from headimpact_service.routes.tables import Cell
from headimpact_service.store.columns import EPOCH, MICROSECOND
from headimpact_service.store.ids import LENGTH
from headimpact_service.store.paging import Page, Position, page_of

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Held(Generic[T]):
    """A row that is in memory; a cursor knows it by its name, and its place in the time that rows have elsewhere."""

    id: bytes
    item: T
    updated_at: datetime


def short_listing(
    name: str,
    read: Callable[[Any], Sequence[T]],
    document: Callable[[T], Mapping[str, Any]],
    key: str,
    columns: Sequence[str],
    *,
    cells: Callable[[T], Sequence[Cell]] | None = None,
    numbers: frozenset[str] = frozenset(),
    flags: frozenset[str] = frozenset(),
) -> Listing[Held[T]]:
    """How a short list is answered.

    Parameters
    ----------
    name
        Of the list, and of what it belongs to: a cursor is good for it only.
    read
        All of it in its order, of a connection.
    document, key
        A row as JSON, and the member of it that tells rows apart.
    columns, cells, numbers, flags
        As in :class:`Listing`; without `cells`, those are the members that the columns name.
    """

    def page(conn: Any, after: Position | None, limit: int) -> Page[Held[T]]:  # noqa: ANN401 - a connection of the store
        rows = [
            Held(_id(str(document(item)[key])), item, EPOCH + place * MICROSECOND)
            for place, item in enumerate(read(conn))
        ]
        return page_of(_behind(rows, after), limit)

    def members(item: T) -> Sequence[Cell]:
        shown = document(item)
        return [_cell(shown[column]) for column in columns]

    made = cells or members
    return Listing(
        name,
        page,
        lambda row: document(row.item),
        columns,
        lambda row: made(row.item),
        numbers=numbers,
        flags=flags,
    )


def _id(name: str) -> bytes:
    return blake2b(name.encode(), digest_size=LENGTH).digest()


def _behind(rows: Sequence[Held[T]], after: Position | None) -> Sequence[Held[T]]:
    """The rows behind the last one of the page before, or from its place on if that one is gone."""
    if after is None:
        return rows
    place = next((place for place, row in enumerate(rows) if row.id == after.id), None)
    return rows[(after.updated_at - EPOCH) // MICROSECOND if place is None else place + 1 :]


def _cell(value: Any) -> Cell:  # noqa: ANN401 - whatever a document holds
    """A member as a cell: what is no single value as JSON."""
    return value if isinstance(value, Cell) else json_bytes(value).decode()
