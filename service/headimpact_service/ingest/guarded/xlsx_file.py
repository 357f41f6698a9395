"""Workbooks (xlsx): each sheet a table. Formulas are not computed: a cell is the value that was saved with it.

A sheet may hold words above its headings, and a second block of columns below the first, as devices write that have
two sensors; blocks are read side by side, the shorter one ending in empty cells.
"""

from __future__ import annotations

import datetime as dt
import io
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np
from python_calamine import CalamineSheet, CalamineWorkbook, SheetTypeEnum

from headimpact_service.ingest.cells import NUMBER, is_no_number, number_text, said
from headimpact_service.ingest.dated import FIRST_ROWS, Elapsed, dated_columns, elapsed_text
from headimpact_service.ingest.decimal_commas import MIXED, UNCLEAR_COMMA, has_comma, has_decimal_comma
from headimpact_service.ingest.guarded.contents import (
    Content,
    NamedTable,
    checked_headings,
    checked_text,
    unreadable,
)
from headimpact_service.ingest.heading_rows import LOOK, are_units, joined, stated
from headimpact_service.ingest.scaled_units import known_units
from headimpact_service.ingest.table import Columns, FloatArray
from headimpact_service.ingest.zip_guard import GuardedZip

ROWS_AT_ONCE = 16_384
MAX_SHEETS = 2000

_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_LINKS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006/relationships"
_SMALLEST = {
    "_rels/.rels": f'<Relationships xmlns="{_PACKAGE}">'
    f'<Relationship Id="r1" Type="{_LINKS}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
    "xl/workbook.xml": f'<workbook xmlns="{_MAIN}" xmlns:r="{_LINKS}"><sheets>'
    '<sheet name="a" sheetId="1" r:id="r1"/></sheets></workbook>',
    "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{_PACKAGE}">'
    f'<Relationship Id="r1" Type="{_LINKS}/worksheet" Target="worksheets/s1.xml"/></Relationships>',
    "xl/worksheets/s1.xml": f'<worksheet xmlns="{_MAIN}"><sheetData>'
    '<row r="1"><c r="A1" t="inlineStr"><is><t>a</t></is></c><c r="B1" t="inlineStr"><is><t>b</t></is></c></row>'
    '<row r="2"><c r="A2"><v>1</v></c><c r="B2"><v>2.5</v></c></row></sheetData></worksheet>',
}
"""The parts of a workbook of our own."""

Row = list[Any]


def contents(stream: BinaryIO) -> Iterator[Content]:
    """Every worksheet that has headings with numbers below them, with the sheets of words that come last before it."""
    GuardedZip(stream)
    stream.seek(0)
    workbook = CalamineWorkbook.from_filelike(stream)
    names = [sheet.name for sheet in workbook.sheets_metadata if sheet.typ == SheetTypeEnum.WorkSheet]
    if len(names) > MAX_SHEETS:
        raise unreadable(f"A workbook may have at most {MAX_SHEETS} sheets.")
    found = False
    beside: list[list[str]] = []
    is_told = False
    for name in names:
        blocks, above = _blocks(workbook.get_sheet_by_name(name))
        if blocks:
            found = is_told = True
            yield NamedTable(checked_text(name), SheetTable(blocks, above, beside))
        else:
            beside = above if is_told else (beside + above)[:LOOK]
            is_told = False
    if not found:
        raise unreadable("No sheet of the workbook has headings with numbers below them.")


def warm_up() -> None:
    """Read a workbook of our own, so that every library is loaded, and every file of ours that is needed."""
    known_units()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, part in _SMALLEST.items():
            archive.writestr(name, part)
    for content in contents(buffer):
        if isinstance(content, NamedTable):
            list(content.table.blocks([0], [1]))


@dataclass(slots=True)
class _Block:
    """Headings and the rows below them; of the `columns` some may have no heading."""

    columns: list[int]
    headings: list[str]
    units: list[str]
    rows: list[Row] = field(default_factory=list)
    joined: bool = False
    """Whether the headings stood again among the rows."""

    @property
    def named(self) -> list[int]:
        """The columns that have a heading."""
        return [column for column, heading in zip(self.columns, self.headings, strict=True) if heading]

    def goes_on(self, other: _Block) -> bool:
        """Whether another block has the same headings in the same columns."""
        return (self.columns, self.headings) == (other.columns, other.headings)

    def cells(self, place: int, first: int | None = None) -> list[Any]:
        """One column or its first cells, empty where a row is too short for it."""
        column = self.columns[place]
        return [row[column] if column < len(row) else "" for row in self.rows[:first]]


class SheetTable:
    """The blocks of one sheet, side by side."""

    parted = False
    wordless = frozenset[int]()

    def __init__(self, blocks: list[_Block], above: list[list[str]], beside: list[list[str]]) -> None:
        """Headings of all blocks, in their order, the rows above the first of them, and those of sheets of words."""
        self.above: Sequence[Sequence[str]] = above
        self.beside: Sequence[Sequence[str]] = beside
        self.headings = checked_headings(heading for block in blocks for heading in block.headings)
        self.units = dict(enumerate(checked_headings(unit for block in blocks for unit in block.units)))
        self._places = [(block, place) for block in blocks for place in range(len(block.columns))]
        self._rows = max(len(block.rows) for block in blocks)
        self._joined = any(block.joined for block in blocks)
        self.dated = dated_columns(list(map(_time, block.cells(place, FIRST_ROWS))) for block, place in self._places)
        self._elapsed = Elapsed()

    def has_samples(self, place: int) -> bool:  # noqa: ARG002 - the shape of a table
        """Any column may."""
        return True

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Columns]:
        """The asked-for columns."""
        self._require_one_point(numbers)
        columns = {place: self._numbers(place) for place in numbers}
        words = {place: self._texts(place) for place in texts}
        for first in range(0, self._rows, ROWS_AT_ONCE):
            rows = slice(first, first + ROWS_AT_ONCE)
            yield Columns(
                rows=min(ROWS_AT_ONCE, self._rows - first),
                numbers={place: values[rows] for place, values in columns.items()},
                texts={place: cells[rows] for place, cells in words.items()},
                joined=self._joined,
            )

    def _require_one_point(self, numbers: Sequence[int]) -> None:
        """Refuse numbers kept as text whose commas may group thousands, or beside which others have points."""
        places = (self._places[place] for place in numbers if place not in self.dated)
        texts = {cell for block, column in places for cell in block.cells(column) if isinstance(cell, str)}
        commas = set(filter(has_comma, texts))
        if not commas:
            return
        if any("." in text and NUMBER.fullmatch(text) for text in texts):
            raise unreadable(MIXED)
        if not any(map(has_decimal_comma, commas)):
            raise unreadable(UNCLEAR_COMMA)

    def _numbers(self, place: int) -> FloatArray:
        block, column = self._places[place]
        values = np.full(self._rows, np.nan)
        read = self._microseconds if place in self.dated else _number
        values[: len(block.rows)] = [read(cell) for cell in block.cells(column)]
        return values

    def _microseconds(self, cell: Any) -> float:  # noqa: ANN401 - any cell
        return self._elapsed.microseconds(_time(cell) or _text(cell))

    def _texts(self, place: int) -> list[str]:
        block, column = self._places[place]
        return [_text(cell) for cell in block.cells(column)] + [""] * (self._rows - len(block.rows))


def _blocks(sheet: CalamineSheet) -> tuple[list[_Block], list[list[str]]]:
    """Rows below the headings they belong to, and those above all; rows without a number are words between them."""
    blocks: list[_Block] = []
    first: list[list[str]] = []
    above: list[Row] = [[], [], []]
    empty: list[Row] = []
    for row in sheet.iter_rows():
        if blocks and _holds_nothing(row):
            empty.append(row)
            continue
        if _has_number(row):
            block = _begun(above, row)
            if block is not None and sum(_says_number(row[column]) for column in block.named) > 1:
                if blocks and blocks[-1].goes_on(block):
                    blocks[-1].joined = True
                else:
                    blocks.append(block)
                empty = []
            if blocks:
                blocks[-1].rows += [*empty, row]
                empty = []
        if not blocks and len(first) < LOOK:
            first.append(stated(map(_stated, row)))
        if blocks or not _holds_nothing(row):
            above = [*above[1:], row]
    return blocks, first


def _begun(rows: Sequence[Row], numbers: Row) -> _Block | None:
    """The block whose headings are the row before its numbers, or the one above that where it is a row of units.

    A column without a heading belongs to it if something stands in its first row: what tells impacts apart, perhaps.
    """
    top, above, before = rows
    has_units = bool(_named_columns(above)) and are_units(list(map(_word, above)), list(map(_word, before)))
    upper, named, units = (top, above, before) if has_units else (above, before, [])
    if len(_named_columns(named)) < 2:
        return None
    headings = joined([] if _has_number(upper) else list(map(_word, upper)), list(map(_word, named)))
    named_columns = _named_columns(headings)
    filled = (column for column, cell in enumerate(numbers) if cell is not None and cell != "")
    columns = sorted({*named_columns, *filled})
    headings += [""] * (columns[-1] + 1 - len(headings))
    said = [_word(units[column]) if column < len(units) else "" for column in columns]
    return _Block(columns, [headings[column].strip() for column in columns], said)


def _stated(cell: Any) -> str:  # noqa: ANN401 - any cell
    return number_text(float(cell)) if _is_number(cell) else _time(cell)


def _word(cell: Any) -> str:  # noqa: ANN401 - any cell
    return cell if isinstance(cell, str) else ""


def _time(cell: Any) -> str:  # noqa: ANN401 - any cell
    """A cell that may be a time, as text; a date that has none is midnight's, as a workbook keeps it."""
    if isinstance(cell, dt.date) and not isinstance(cell, dt.datetime):
        return f"{cell.isoformat()}T00:00:00"
    if isinstance(cell, dt.timedelta):
        return elapsed_text(cell)
    return cell.isoformat() if isinstance(cell, dt.datetime | dt.time) else _word(cell)


def _holds_nothing(row: Row) -> bool:
    """A row of lost samples, if more samples follow: the end of a block, if they do not."""
    return all(cell is None or (isinstance(cell, str) and not said(cell)) for cell in row)


def _named_columns(row: Sequence[Any]) -> list[int]:
    """The columns of a row that may be headings: words only."""
    if _has_number(row):
        return []
    return [column for column, cell in enumerate(row) if isinstance(cell, str) and cell.strip()]


def _has_number(row: Sequence[Any]) -> bool:
    """Whether a row holds a number, or more than one that is kept as text."""
    return any(map(_is_number, row)) or sum(map(_says_number, row)) > 1


def _says_number(cell: Any) -> bool:  # noqa: ANN401 - any cell
    return _is_number(cell) or (isinstance(cell, str) and (NUMBER.fullmatch(cell) is not None or has_comma(cell)))


def _is_number(cell: Any) -> bool:  # noqa: ANN401 - any cell
    return isinstance(cell, int | float) and not isinstance(cell, bool)


def _number(cell: Any) -> float:  # noqa: ANN401 - any cell
    if _is_number(cell):
        return float(cell)
    if isinstance(cell, str) and _says_number(cell):
        return float(cell.replace(",", "."))
    return float("nan" if cell is None or (isinstance(cell, str) and is_no_number(cell)) else "inf")


def _text(cell: Any) -> str:  # noqa: ANN401 - any cell
    if isinstance(cell, dt.date | dt.time):
        return cell.isoformat()
    if isinstance(cell, dt.timedelta):
        return elapsed_text(cell)
    if isinstance(cell, float):
        return number_text(cell)
    return checked_text(str(cell))
