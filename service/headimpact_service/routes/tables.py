"""A table on its way out, row by row in the form that was asked for: CSV, NDJSON or Parquet."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any, Literal, Protocol

from headimpact_service import memory
from headimpact_service.answers import CSV, NDJSON, PARQUET, json_bytes
from headimpact_service.errors import Problem
from headimpact_service.ingest.formula_cells import guarded

Cell = str | float | int | bool | datetime | None
Kind = Literal["text", "number", "integer", "flag", "instant"]
"""What the cells of a column are; Parquet's columns have types."""

# A spreadsheet takes a cell that begins with one of these for a formula.
ROW_GROUP = 100_000
"""Rows of a Parquet file that are held until they are written together."""


class Form(Protocol):
    """Encodes part after part of what a list holds."""

    def encode(self, part: Sequence[Any]) -> bytes:
        """The bytes of some more of it."""

    def finish(self) -> bytes:
        """The bytes that end it."""


class CsvForm:
    """Separated text under one line of headings."""

    def __init__(self, columns: Sequence[str], rows: Callable[[Any], Iterable[Sequence[Cell]]]) -> None:
        """`rows` makes the rows of one item."""
        self._rows = rows
        self._text = io.StringIO()
        self._writer = csv.writer(self._text)
        self._writer.writerow(columns)

    def encode(self, part: Sequence[Any]) -> bytes:
        """The rows of some items; the headings before the first."""
        for item in part:
            self._writer.writerows([_csv_cell(cell) for cell in row] for row in self._rows(item))
        return self.finish()

    def finish(self) -> bytes:
        """What was written and not yet given away."""
        data = self._text.getvalue().encode()
        self._text.seek(0)
        self._text.truncate()
        return data


def _csv_cell(cell: Cell) -> str | float | int | None:
    if isinstance(cell, str):
        return guarded(cell)
    if isinstance(cell, bool):
        return "true" if cell else "false"
    return timestamp(cell) if isinstance(cell, datetime) else cell


class NdjsonForm:
    """One object a line."""

    def __init__(self, document: Callable[[Any], Mapping[str, Any]]) -> None:
        """`document` makes the object of one item."""
        self._document = document

    def encode(self, part: Sequence[Any]) -> bytes:
        """The lines of some items."""
        return b"".join(json_bytes(self._document(item)) + b"\n" for item in part)

    def finish(self) -> bytes:
        """Nothing ends it."""
        return b""


class _Sink(io.RawIOBase):
    """A file that keeps only what was written since it was last emptied."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._written = 0

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:  # noqa: ANN401 - any buffer
        part = bytes(data)
        self._parts.append(part)
        self._written += len(part)
        return len(part)

    def tell(self) -> int:
        return self._written

    def empty(self) -> bytes:
        data = b"".join(self._parts)
        self._parts.clear()
        return data


class ParquetForm:
    """Typed columns, row group by row group."""

    def __init__(self, columns: Sequence[str], kinds: Mapping[str, Kind], cells: Callable[[Any], Any]) -> None:
        """`cells` makes of one item a cell for each column, or an array of them.

        Raises
        ------
        Problem
            406 where the library is not installed.
        """
        self._arrow, self._parquet = _library()
        types = {
            "text": self._arrow.string(),
            "number": self._arrow.float64(),
            "integer": self._arrow.int64(),
            "flag": self._arrow.bool_(),
            "instant": self._arrow.timestamp("us", tz="UTC"),
        }
        self._schema = self._arrow.schema([(name, types[kinds.get(name, "text")]) for name in columns])
        self._cells = cells
        self._sink = _Sink()
        self._writer = self._parquet.ParquetWriter(self._sink, self._schema, compression="zstd")
        self._held: list[Any] = []
        self._rows = 0

    def encode(self, part: Sequence[Any]) -> bytes:
        """The row groups that are full."""
        batch = self._batch(part)
        self._held.append(batch)
        self._rows += batch.num_rows
        if self._rows >= ROW_GROUP:
            self._write()
        return self._sink.empty()

    def finish(self) -> bytes:
        """The last row group and the footer."""
        if self._rows:
            self._write()
        self._writer.close()
        return self._sink.empty()

    def _batch(self, part: Sequence[Any]) -> Any:  # noqa: ANN401 - a library without types
        rows = [self._cells(item) for item in part]
        columns = list(zip(*rows, strict=True)) if rows else [()] * len(self._schema)
        arrays = [self._column(cells, field) for cells, field in zip(columns, self._schema, strict=True)]
        return self._arrow.Table.from_arrays(arrays, schema=self._schema)

    def _column(self, cells: Sequence[Any], field: Any) -> Any:  # noqa: ANN401 - pyarrow has no types
        if not cells or not isinstance(cells[0], Repeated):
            return self._arrow.array(cells, field.type)
        return self._arrow.chunked_array([self._repeated(cell, field.type) for cell in cells], field.type)

    def _repeated(self, cell: Repeated, kind: Any) -> Any:  # noqa: ANN401 - pyarrow has no types
        if isinstance(cell.value, str | float | int | bool | datetime | None):
            return self._arrow.repeat(self._arrow.scalar(cell.value, kind), cell.count)
        return self._arrow.array(cell.value, kind, from_pandas=True)

    def _write(self) -> None:
        self._writer.write_table(self._arrow.concat_tables(self._held), row_group_size=max(self._rows, 1))
        self._held, self._rows = [], 0


class Repeated:
    """Many rows of one column: an array of them, or one cell that all of them have."""

    def __init__(self, value: Any, count: int) -> None:  # noqa: ANN401 - a cell, or an array of numbers
        """`count` rows."""
        self.value, self.count = value, count

    def cells(self) -> Iterable[Cell]:
        """The rows' cells; one that is no number is empty."""
        if isinstance(self.value, str | float | int | bool | datetime | None):
            return [self.value] * self.count
        return [None if cell != cell else cell for cell in self.value.tolist()]


def _library() -> tuple[Any, Any]:
    """pyarrow, loaded by the first table that needs it."""
    try:
        # Here, since a service that nobody asks for Parquet does without its tens of megabytes.
        import pyarrow as pa
        import pyarrow.parquet as pq

        with memory.without_pandas():
            pa.array([0.0])
    except ImportError:
        detail = "Parquet needs an extra that is not installed here: headimpact[files]."
        raise Problem("not-acceptable", detail) from None
    return pa, pq


def table_form(
    media_type: str, columns: Sequence[str], kinds: Mapping[str, Kind], cells: Callable[[Any], Sequence[Cell]]
) -> Form:
    """The form of a table with one row for each item."""
    if media_type == PARQUET:
        return ParquetForm(columns, kinds, cells)
    if media_type == NDJSON:
        return NdjsonForm(lambda item: dict(zip(columns, cells(item), strict=True)))
    assert media_type == CSV
    return CsvForm(columns, lambda item: [cells(item)])


def timestamp(moment: datetime) -> str:
    """An instant as JSON shows it."""
    return moment.isoformat(timespec="microseconds").replace("+00:00", "Z")
