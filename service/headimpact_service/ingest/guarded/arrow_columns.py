"""Arrow columns as a table: one row a sample, or one row an impact whose columns are lists of samples."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from headimpact_service.ingest.cells import Words, number_text
from headimpact_service.ingest.dated import DAY_S, FIRST_ROWS, NIGHT_S, Elapsed, are_dated
from headimpact_service.ingest.guarded.arrow_types import (
    is_instant,
    is_list,
    is_list_of_numbers,
    is_number,
    is_text,
    is_told,
)
from headimpact_service.ingest.guarded.contents import checked_headings, checked_text, unreadable
from headimpact_service.ingest.guarded.nested_columns import Batches, laid_out
from headimpact_service.ingest.heading_rows import LOOK, stated
from headimpact_service.ingest.table import DURATION, Columns, FloatArray

MICROSECONDS = "us"
UNIT_KEYS = (b"unit", b"units")
ROWS_AT_ONCE = 8192
MAX_LIST = 20_001
"""Of a longer list this much is read: one sample more than an impact may have, which is then refused by name."""
MAX_SAID = 100
"""Bytes of a value in a table's metadata that may be a rate: data frames keep a page of theirs there."""
ATTRIBUTES = b"PANDAS_ATTRS"
MAX_ATTRIBUTES = 64 * 1024
_NO_TEXT = "A column that is to be read as text holds something else."
_EPOCH = dt.datetime(1970, 1, 1, tzinfo=dt.UTC)


class ArrowTable:
    """A table over batches of Arrow columns."""

    beside: Sequence[Sequence[str]] = ()

    def __init__(self, schema: pa.Schema, batches: Batches) -> None:
        """Look at the schema, and for times that are text at the first rows."""
        schema, batches = laid_out(schema, batches)
        self.headings = checked_headings(schema.names)
        self.above: Sequence[Sequence[str]] = _said_of_all(schema)
        self._types = list(schema.types)
        self._batches = batches
        self.units = {place: unit for place, field in enumerate(schema) if (unit := _unit(field)) is not None}
        self.parted = any(map(is_list_of_numbers, self._types))
        self.dated: frozenset[int] = frozenset()
        self._elapsed = Elapsed()
        self.wordless = [place for place, kind in enumerate(self._types) if not is_told(kind)]
        durations = self._samples(pa.types.is_duration)
        self.units |= dict.fromkeys(durations, DURATION)
        self.dated = frozenset({*self._samples(is_instant), *self._written_times()})
        self._timed = self.dated.union(durations)

    def _samples(self, is_kind: Callable[[pa.DataType], bool]) -> list[int]:
        """The columns whose samples are of such a type; where rows are impacts, samples stand in lists."""
        if not self.parted:
            return [place for place, kind in enumerate(self._types) if is_kind(kind)]
        return [place for place, kind in enumerate(self._types) if is_list(kind) and is_kind(kind.value_type)]

    def _written_times(self) -> Iterator[int]:
        """Columns of times that are text, by their first rows."""
        texts = [] if self.parted else self._samples(is_text)
        batch = next((batch for batch in self._batches(texts) if batch.num_rows), None) if texts else None
        if batch is not None:
            yield from (place for place, column in zip(texts, batch.columns, strict=True) if _is_dated(column))

    def has_samples(self, place: int) -> bool:
        """Where rows are impacts, lists of numbers do; where they are samples, numbers and times."""
        return self._holds_numbers(place) and (not self.parted or is_list(self._types[place]))

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Columns]:
        """The asked-for columns; those of lists end to end, with the length of each impact."""
        wanted = sorted({*numbers, *texts})
        for place in numbers:
            self._require_numbers(place)
        for batch in self._batches(wanted):
            columns = {place: batch.column(index) for index, place in enumerate(wanted)}
            if self.parted:
                yield from _impacts(columns, numbers, texts)
            elif batch.num_rows:
                cells = {place: self._numbers(columns[place]) for place in numbers}
                yield Columns(batch.num_rows, cells, {place: words(columns[place]) for place in texts})

    def _numbers(self, column: pa.Array) -> FloatArray:
        if not is_text(column.type):
            return floats(column)
        return np.array([self._elapsed.microseconds(cell or "") for cell in column.to_pylist()])

    def _require_numbers(self, place: int) -> None:
        if not self._holds_numbers(place):
            raise unreadable(f"Column {place + 1} holds no numbers.")

    def _holds_numbers(self, place: int) -> bool:
        kind = self._types[place]
        return is_number(kind) or is_list_of_numbers(kind) or place in self._timed


def _is_dated(column: pa.Array) -> bool:
    """Whether a column of text begins with times; one that is not even text does not."""
    try:
        return are_dated(cell or "" for cell in column.slice(0, FIRST_ROWS).to_pylist())
    except UnicodeDecodeError:
        return False


def floats(column: pa.Array) -> FloatArray:
    """A column of numbers, of times in microseconds; NaN where a cell is empty."""
    cast = _in_microseconds(column).cast(pa.float64(), safe=False)
    found = np.ascontiguousarray(cast.to_numpy(zero_copy_only=False), dtype=np.float64)
    return _unwrapped(found) if pa.types.is_time(column.type) else found


def _unwrapped(microseconds: FloatArray) -> FloatArray:
    """Times of day that go on behind midnight, as :class:`Elapsed` has them of text."""
    steps = np.diff(microseconds, prepend=microseconds[:1])
    days = np.cumsum((steps < -NIGHT_S * 1e6).astype(np.float64) - (steps > NIGHT_S * 1e6))
    found: FloatArray = microseconds + days * (DAY_S * 1e6)
    return found


def _in_microseconds(column: pa.Array) -> pa.Array:
    """Times as whole numbers of them; what is no time stays as it is."""
    kind = column.type
    if pa.types.is_timestamp(kind):
        column = column.cast(pa.timestamp(MICROSECONDS, kind.tz), safe=False)
    elif pa.types.is_duration(kind):
        column = column.cast(pa.duration(MICROSECONDS), safe=False)
    elif pa.types.is_time(kind):
        column = column.cast(pa.time64(MICROSECONDS), safe=False)
    else:
        return column
    return column.cast(pa.int64())


def words(column: pa.Array) -> Words:
    """A column as text: names and numbers as they are, times as RFC 3339 has them; empty where a cell is."""
    if pa.types.is_nested(column.type):
        raise unreadable(_NO_TEXT)
    encoded = column if isinstance(column, pa.DictionaryArray) else column.dictionary_encode()
    known = [checked_text(text) for text in _texts(encoded.dictionary)] + [""]
    places = pc.fill_null(encoded.indices.cast(pa.int32()), len(known) - 1).to_numpy(zero_copy_only=False)
    return Words(places, known)


def _texts(values: pa.Array) -> list[str]:
    kind = values.type
    if pa.types.is_null(kind):  # of a column without any value nobody says what it would hold
        return [""] * len(values)
    if pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_integer(kind):
        return ["" if value is None else str(value) for value in values.to_pylist()]
    if pa.types.is_floating(kind):
        return ["" if value is None else number_text(value) for value in values.to_pylist()]
    if pa.types.is_timestamp(kind):
        micros = values.cast(pa.timestamp("us", kind.tz), safe=False).cast(pa.int64()).to_pylist()
        return ["" if value is None else _instant(value, placed=kind.tz is not None) for value in micros]
    if pa.types.is_boolean(kind):
        return ["" if value is None else str(value).lower() for value in values.to_pylist()]
    if pa.types.is_time(kind):
        micros = values.cast(pa.time64(MICROSECONDS), safe=False).to_pylist()
        return ["" if value is None else value.isoformat() for value in micros]
    if pa.types.is_date(kind):
        return ["" if value is None else value.isoformat() for value in values.to_pylist()]
    raise unreadable(_NO_TEXT)


def _instant(microseconds: int, *, placed: bool) -> str:
    try:
        moment = _EPOCH + dt.timedelta(microseconds=microseconds)
    except OverflowError:
        return "out of range"
    return moment.isoformat() if placed else moment.replace(tzinfo=None).isoformat()


def _said_of_all(schema: pa.Schema) -> list[list[str]]:
    """What the file's metadata says of the table, as rows above its headings."""
    metadata = schema.metadata or {}
    short = ((key, value) for key, value in metadata.items() if len(value) <= MAX_SAID and key != ATTRIBUTES)
    pairs = [tuple(part.decode("utf-8", "replace") for part in pair) for pair in islice(short, LOOK)]
    return [stated(pair) for pair in (*pairs, *islice(_attributes(metadata.get(ATTRIBUTES, b"{}")), LOOK))]


def _attributes(text: bytes) -> Iterator[tuple[str, str]]:
    """What a data frame says of itself: an object of JSON."""
    try:
        attributes = json.loads(text) if len(text) <= MAX_ATTRIBUTES else {}
    except (ValueError, RecursionError):
        return
    if isinstance(attributes, dict):
        yield from ((name, str(value)) for name, value in attributes.items() if isinstance(value, str | int | float))


def _unit(field: pa.Field) -> str | None:
    metadata = field.metadata or {}
    stated = next((metadata[key] for key in UNIT_KEYS if key in metadata), None)
    return None if stated is None else checked_text(stated.decode("utf-8", "replace"))


class _Lists:
    """One column of lists: where each list lies in the values of all."""

    def __init__(self, column: pa.Array) -> None:
        self.lengths = pc.fill_null(pc.list_value_length(column), 0).to_numpy(zero_copy_only=False).astype(np.int64)
        self.starts = np.cumsum(self.lengths) - self.lengths
        self._values = floats(column.flatten())

    def laid_out(self, first: int, rooms: np.ndarray[Any, np.dtype[np.int64]]) -> FloatArray:
        """The lists from the `first` on, each in the room it is given, NaN where it is shorter."""
        last = first + rooms.size
        lengths, starts = np.minimum(self.lengths[first:last], rooms), self.starts[first:last]
        if np.array_equal(lengths, rooms) and np.array_equal(lengths, self.lengths[first:last]):
            return self._values[starts[0] : starts[-1] + lengths[-1]]
        room = np.full(int(rooms.sum()), np.nan)
        room[_places(np.cumsum(rooms) - rooms, lengths)] = self._values[_places(starts, lengths)]
        return room


def _places(
    starts: np.ndarray[Any, np.dtype[np.int64]], lengths: np.ndarray[Any, np.dtype[np.int64]]
) -> np.ndarray[Any, np.dtype[np.int64]]:
    """`starts[0]`, `starts[0] + 1`, … as many as the first length says, then those of the second, and so on."""
    before = np.cumsum(lengths) - lengths
    return np.repeat(starts - before, lengths) + np.arange(int(lengths.sum()))


def _impacts(columns: dict[int, pa.Array], numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Columns]:
    """The impacts of a batch, no more rows at a time than a block of samples has."""
    lists = {place: _Lists(columns[place]) for place in numbers if not is_number(columns[place].type)}
    scalars = {place: floats(columns[place]) for place in numbers if place not in lists}
    names = {place: words(columns[place]) for place in texts}
    if not lists:
        raise unreadable("No column of lists is read: the table's rows are impacts, and hold no samples.")
    rooms = np.minimum(np.max([column.lengths for column in lists.values()], axis=0), MAX_LIST)
    for first, last in _portions(rooms):
        room = rooms[first:last]
        cells = {
            place: lists[place].laid_out(first, room) if place in lists else np.repeat(scalars[place][first:last], room)
            for place in numbers
        }
        cut = {place: column[first:last] for place, column in names.items()}
        yield Columns(int(room.sum()), cells, cut, lengths=room.tolist())


def _portions(rooms: np.ndarray[Any, np.dtype[np.int64]]) -> Iterator[tuple[int, int]]:
    """Impacts that fit into a block together, at least one."""
    first = rows = 0
    for place, room in enumerate(rooms.tolist()):
        if rows and rows + room > ROWS_AT_ONCE:
            yield first, place
            first, rows = place, 0
        rows += room
    if first < rooms.size:
        yield first, rooms.size
