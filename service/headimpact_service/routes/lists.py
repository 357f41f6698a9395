"""Lists: pages of JSON with a cursor, or one flat table as CSV or NDJSON, streamed to its end."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from anyio.to_thread import run_sync
from starlette.responses import Response, StreamingResponse

from headimpact_service import deps
from headimpact_service.answers import CSV, JSON, NDJSON, NEXT_CURSOR, PARQUET, answer
from headimpact_service.operation import Call
from headimpact_service.parameters import ListQuery
from headimpact_service.routes.tables import Cell, Form, Kind, table_form
from headimpact_service.store.paging import Page, Position, Positioned, decode_cursor, encode_cursor

Row = TypeVar("Row", bound=Positioned)

MEDIA_TYPES = (JSON, CSV, NDJSON, PARQUET)
"""What a list can be answered as, the preferred one first."""
PAGE_OF_TABLE = 1000
"""Rows that a table reads at a time, so that no reader holds the database for long."""

_INTEGERS = frozenset({"revision", "birth_year", "done", "total", "number", "drop_rows"})
_INSTANTS = ("_at", "_due", "_fired")
"""How the names of columns of times end, of every list."""


@dataclass(frozen=True, slots=True)
class Listing(Generic[Row]):
    """How one resource is listed: its page, and a row as JSON and as cells."""

    name: str
    page: Callable[[Any, Position | None, int], Page[Row]]
    """Of a connection, a position and a limit."""
    document: Callable[[Row], Mapping[str, Any]]
    columns: Sequence[str]
    cells: Callable[[Row], Sequence[Cell]]
    numbers: frozenset[str] = frozenset()
    flags: frozenset[str] = frozenset()
    form: Callable[[str], Form] | None = None
    """Of a media type, where a table is not one row of `cells` for each row of the list."""
    parts: Callable[[Sequence[Row]], AsyncIterator[Sequence[Any]]] | None = None
    """What such a form takes, from some rows of the list."""

    @property
    def kinds(self) -> Mapping[str, Kind]:
        """The types of the columns that hold no text."""
        return {name: kind for name in self.columns if (kind := self._kind(name)) != "text"}

    def _kind(self, name: str) -> Kind:
        if name in self.numbers:
            return "number"
        if name in self.flags:
            return "flag"
        if name in _INTEGERS:
            return "integer"
        return "instant" if name.endswith(_INSTANTS) else "text"


async def answer_list(call: Call, listing: Listing[Row], query: ListQuery) -> Response:
    """The list in the form that `Accept` asks for.

    JSON is a page. A table runs to the end of the list, unless `limit` is given: then it is a page too, with the
    cursor of the next in `X-Next-Cursor`.
    """
    mark = _mark(call, listing, query)
    after = decode_cursor(query.cursor, mark) if query.cursor is not None else None
    whole = call.media_type != JSON and "limit" not in query.model_fields_set
    limit = PAGE_OF_TABLE if whole else query.limit
    page = await _read(call, listing, after, limit)
    cursor = None if page.next is None else encode_cursor(page.next, mark)
    if call.media_type == JSON:
        return answer({"data": [listing.document(row) for row in page.rows], "next_cursor": cursor})
    form = await run_sync(_form, call.media_type, listing)
    headers = {NEXT_CURSOR: cursor} if cursor is not None and not whole else {}
    return StreamingResponse(
        _stream(call, listing, page, form, whole=whole), media_type=call.media_type, headers=headers
    )


def _form(media_type: str, listing: Listing[Row]) -> Form:
    if listing.form is not None:
        return listing.form(media_type)
    return table_form(media_type, listing.columns, listing.kinds, listing.cells)


def _mark(call: Call, listing: Listing[Row], query: ListQuery) -> str:
    """The list and its filters: a cursor is good for these only."""
    filters = query.model_dump_json(exclude={"cursor", "limit"})
    return f"{listing.name} {call.data_set_id.hex()} {filters}"


async def _read(call: Call, listing: Listing[Row], after: Position | None, limit: int) -> Page[Row]:
    return await deps.read(call.request, lambda conn: listing.page(conn, after, limit))


async def _stream(
    call: Call, listing: Listing[Row], page: Page[Row], form: Form, *, whole: bool
) -> AsyncIterator[bytes]:
    while True:
        async for part in _parts(listing, page.rows):
            yield await run_sync(form.encode, part)
        if not whole or page.next is None:
            break
        page = await _read(call, listing, page.next, PAGE_OF_TABLE)
    yield await run_sync(form.finish)


async def _parts(listing: Listing[Row], rows: Sequence[Row]) -> AsyncIterator[Sequence[Any]]:
    if listing.parts is None:
        yield rows
        return
    async for part in listing.parts(rows):
        yield part
