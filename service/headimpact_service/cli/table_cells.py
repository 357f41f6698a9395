"""A table's cells by column, from CSV or Parquet, and where each row stands in its file."""

from __future__ import annotations

import csv
import gzip
import io
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PARQUET_MAGIC = b"PAR1"
GZIP_MAGIC = b"\x1f\x8b"


class TableError(ValueError):
    """A table that cannot be read as a cohort; the message names the column and the row."""


class RowError(TableError):
    """A fault of rows, by their positions: where they stand in the file is known to whoever read it."""

    def __init__(self, told: str, *rows: int) -> None:
        super().__init__(told)
        self.rows = rows


@dataclass(frozen=True, slots=True)
class Cells:
    """The table's cells by column, and the number of each row as a spreadsheet shows it, below the heading's 1."""

    columns: Mapping[str, Sequence[Any]]
    numbers: Sequence[int]

    def located(self, fault: RowError) -> TableError:
        """The same fault with the rows' numbers."""
        numbers = [str(self.numbers[row]) for row in fault.rows]
        rows = f"Row {numbers[0]}" if len(numbers) == 1 else f"Rows {' and '.join(numbers)}"
        return TableError(f"{rows} (the heading is row 1){fault}")


def read_cells(path: Path) -> Cells:
    """The table's cells: text where it is separated text.

    Raises
    ------
    TableError
        It is neither, or not whole.
    """
    with path.open("rb") as file:
        magic = file.read(4)
    if magic == PARQUET_MAGIC:
        return _parquet_cells(path)
    content = path.read_bytes()
    try:
        text = (gzip.decompress(content) if magic[:2] == GZIP_MAGIC else content).decode("utf-8-sig")
        return _csv_cells(csv.reader(io.StringIO(text, newline=""), strict=True))
    except (UnicodeDecodeError, EOFError, zlib.error, gzip.BadGzipFile):
        raise TableError("The table is neither Parquet nor text in UTF-8.") from None
    except csv.Error as error:
        raise TableError(f"The table is no separated text: {error}.") from None


def _csv_cells(lines: Iterator[list[str]]) -> Cells:
    names = [name.strip() for name in next(lines, [])]
    _require_distinct(names)
    columns: list[list[str]] = [[] for _ in names]
    numbers = []
    for number, cells in enumerate(lines, start=2):
        if not cells:
            continue
        if len(cells) != len(names):
            found = f"{len(cells)} cells where the table has {len(names)} columns"
            raise TableError(f"Row {number} (the heading is row 1) has {found}.")
        for column, cell in zip(columns, cells, strict=True):
            column.append(cell.strip())
        numbers.append(number)
    return Cells(dict(zip(names, columns, strict=True)), numbers)


def _parquet_cells(path: Path) -> Cells:
    try:
        # Here, since a service without the extra reads CSV all the same.
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise TableError("Parquet needs an extra that is not installed here: headimpact[files].") from None
    try:
        table = pq.read_table(path)
    except (pa.ArrowException, OSError) as error:
        raise TableError(f"The table is no readable Parquet file: {error}".splitlines()[0]) from None
    _require_distinct(table.column_names)
    columns = {name: table.column(name).to_pylist() for name in table.column_names}
    return Cells(columns, range(2, table.num_rows + 2))


def _require_distinct(names: Sequence[str]) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise TableError(f"The table has the column {twice[0] or 'without a name'} twice.")
