"""Lists: pages of JSON with a cursor, or one flat table as CSV or NDJSON, streamed to its end."""

from __future__ import annotations

import csv
import io
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Generic, TypeVar

from starlette.responses import Response, StreamingResponse

from headimpact_service import deps
from headimpact_service.answers import CSV, JSON, NDJSON, answer, json_bytes
from headimpact_service.operation import Call
from headimpact_service.parameters import ListQuery
from headimpact_service.store.paging import Page, Position, Positioned, decode_cursor, encode_cursor

Row = TypeVar("Row", bound=Positioned)
Cell = str | float | int | bool | datetime | None

MEDIA_TYPES = (JSON, CSV, NDJSON)
"""What a list can be answered as, the preferred one first."""
PAGE_OF_TABLE = 1000
"""Rows that a table reads at a time, so that no reader holds the database for long."""

NEXT_CURSOR = "X-Next-Cursor"
# A spreadsheet takes a cell that begins with one of these for a formula.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


@dataclass(frozen=True, slots=True)
class Listing(Generic[Row]):
    """How one resource is listed: its page, and a row as JSON and as cells."""

    name: str
    page: Callable[[Any, Position | None, int], Page[Row]]
    """Of a connection, a position and a limit."""
    document: Callable[[Row], Mapping[str, Any]]
    columns: Sequence[str]
    cells: Callable[[Row], Iterable[Cell]]


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
    encode = _csv_rows if call.media_type == CSV else _json_rows
    headers = {NEXT_CURSOR: cursor} if cursor is not None and not whole else {}
    stream = _stream(call, listing, page, encode, whole=whole)
    return StreamingResponse(stream, media_type=call.media_type, headers=headers)


def _mark(call: Call, listing: Listing[Row], query: ListQuery) -> str:
    """The list and its filters: a cursor is good for these only."""
    filters = query.model_dump_json(exclude={"cursor", "limit"})
    return f"{listing.name} {call.data_set_id.hex()} {filters}"


async def _read(call: Call, listing: Listing[Row], after: Position | None, limit: int) -> Page[Row]:
    return await deps.read(call.request, lambda conn: listing.page(conn, after, limit))


Encoder = Callable[[Listing[Any], Sequence[Any], bool], bytes]


async def _stream(
    call: Call, listing: Listing[Row], page: Page[Row], encode: Encoder, *, whole: bool
) -> AsyncIterator[bytes]:
    yield encode(listing, page.rows, True)
    while whole and page.next is not None:
        page = await _read(call, listing, page.next, PAGE_OF_TABLE)
        yield encode(listing, page.rows, False)


def _csv_rows(listing: Listing[Row], rows: Sequence[Row], first: bool) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text)
    if first:
        writer.writerow(listing.columns)
    writer.writerows([_csv_cell(cell) for cell in listing.cells(row)] for row in rows)
    return text.getvalue().encode()


def _csv_cell(cell: Cell) -> str | float | int | None:
    if isinstance(cell, str):
        return "'" + cell if cell.startswith(_FORMULA) else cell
    if isinstance(cell, bool):
        return "true" if cell else "false"
    return timestamp(cell) if isinstance(cell, datetime) else cell


def _json_rows(listing: Listing[Row], rows: Sequence[Row], first: bool) -> bytes:  # noqa: ARG001 - no heading
    return b"".join(json_bytes(dict(zip(listing.columns, listing.cells(row), strict=True))) + b"\n" for row in rows)


def timestamp(moment: datetime) -> str:
    """An instant as JSON shows it."""
    return moment.isoformat(timespec="microseconds").replace("+00:00", "Z")
