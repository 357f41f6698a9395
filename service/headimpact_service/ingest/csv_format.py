"""CSV: separated text with a line of headings.

Comma, semicolon or tab, one of them for the whole file; UTF-8 with or without its mark, UTF-16 with it, else Latin-1;
decimal points, or decimal commas where they cannot be anything else. What is not a number stays a fault of its own
impact; what makes the rows uncertain (a row longer or shorter than the headings, a comma that may group thousands, a
line without end) is a fault of the file.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain, islice, zip_longest
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from headimpact_service.errors import Problem
from headimpact_service.ingest.blank_lines import BlankLines
from headimpact_service.ingest.cells import NUMBER, LineCells, is_no_number
from headimpact_service.ingest.dated import FIRST_ROWS, Elapsed, dated_columns
from headimpact_service.ingest.decimal_commas import (
    GROUPED,
    MIXED,
    UNCLEAR_COMMA,
    UNCLEAR_POINT,
    groups_thousands,
    has_comma,
    has_decimal_comma,
    may_group_by_point,
)
from headimpact_service.ingest.heading_rows import LOOK, cells_of, joined, stated, top_of
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.presets import preset_named
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.source import Source
from headimpact_service.ingest.table import Columns, FloatArray
from headimpact_service.ingest.tabular import read_table
from headimpact_service.ingest.text_facts import MAX_LINE, delimiter_of, text_facts, unreadable

if TYPE_CHECKING:
    from _csv import Reader

MAX_COLUMNS = 1024
ROWS_AT_ONCE = 4096
_SEPARATOR = re.compile(r"sep=.\s*", re.IGNORECASE)
Block = tuple[FloatArray, Sequence[Sequence[str]]]


def read_csv(source: Source, options: ImportOptions) -> Iterator[ImpactRecord | Problem]:
    """The impacts of a CSV file."""
    with source.open() as stream:
        yield from read_table(CsvTable(stream, skip_rows=_skip_rows(options)), options, format_name="csv")


def _skip_rows(options: ImportOptions) -> int:
    """Lines above the headings: they must be known before the headings can be looked at."""
    if options.mapping is not None and options.mapping.skip_rows is not None:
        return options.mapping.skip_rows
    return 0 if options.preset is None else preset_named(options.preset).mapping.skip_rows or 0


class CsvTable:
    """The headings of a CSV file, and its columns when they are asked for."""

    parted = False
    wordless = frozenset[int]()
    beside: Sequence[Sequence[str]] = ()

    def __init__(self, stream: BinaryIO, *, skip_rows: int = 0) -> None:
        """Look through the file, then read as far as the headings; 422 where there are none."""
        text = text_facts(stream)
        stream.seek(0)
        self._lines = _lines(stream, text.encoding)
        self._quoted = text.quoted
        self._line = 0
        self._begun, self._empty_rows = False, 0
        self._joined = False
        self._blank_lines = BlankLines()
        self._ends: list[int] = []  # the line that each row of a block ends in
        self._passed: list[str] = []  # the first lines that are skipped, or comments
        above, heading, has_units = self._find_headings(skip_rows)
        self._delimiter = delimiter_of(heading)
        self._decimal_mark = ""
        self._decimal_commas = text.has_decimal_commas(self._delimiter)
        self._decimal_points = text.has_decimal_points(self._delimiter)
        reader = csv.reader(chain([heading], self._lines), delimiter=self._delimiter, strict=True)
        headings = self._rows(reader, 1)[0]
        rows = [cells_of(line, self._delimiter) for line in (*self._passed, *above)]
        self.above = [stated(row) for row in rows]
        self.headings: tuple[str, ...] = tuple(joined(rows[-1] if above else [], headings))
        self._repeated = [heading.strip() for heading in headings]
        self.units: Mapping[int, str] = self._read_units(reader) if has_units else {}
        self._simply_quoted = _simply_quoted(self._delimiter)
        self.dated, self._elapsed = self._find_dated(), Elapsed()
        if len(self.headings) > MAX_COLUMNS:
            raise unreadable(f"A file may have at most {MAX_COLUMNS} columns.")

    def has_samples(self, place: int) -> bool:  # noqa: ARG002 - the shape of a table
        """Any column may."""
        return True

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Columns]:
        """The columns, block by block, so that only numbers are kept of the numbers."""
        for samples, cells in self._blocks(numbers, texts):
            columns = np.ascontiguousarray(samples.T)
            yield Columns(
                rows=len(samples),
                numbers=dict(zip(numbers, columns, strict=True)),
                texts=dict(zip(texts, cells, strict=True)),
                joined=self._joined,
                spaced_apart=self._blank_lines.part_rows,
            )

    def _find_headings(self, skip_rows: int) -> tuple[list[str], str, bool]:
        """The lines above the headings, these, and whether units follow them."""
        first = self._first_line(skip_rows)
        ahead = [first, *islice(self._lines, LOOK)]
        top = top_of(ahead, search=not skip_rows)
        self._lines = chain(ahead[top.heading + 1 :], self._lines)
        self._line += top.heading
        return ahead[: top.heading], self._whole(ahead[top.heading]), top.has_units

    def _whole(self, line: str) -> str:
        """A line with those on which a quoted cell of it goes on."""
        while line.count('"') % 2 and len(line) <= MAX_LINE and (more := next(self._lines, None)) is not None:
            self._line += 1
            line += more
        return line

    def _read_units(self, reader: Reader) -> dict[int, str]:
        """The row of units below the headings."""
        self._line += 1
        return dict(enumerate(self._rows(reader, 1)[0]))

    def _find_dated(self) -> frozenset[int]:
        """The columns of dates with times of day, by the rows that come next."""
        ahead = list(islice(self._lines, FIRST_ROWS))
        self._lines = chain(ahead, self._lines)
        try:
            return dated_columns(zip_longest(*csv.reader(ahead, delimiter=self._delimiter), fillvalue=""))
        except csv.Error:  # said with its line where the rows are read
            return frozenset()

    def _first_line(self, skip_rows: int) -> str:
        """The first line that is neither skipped, empty, a comment nor a spreadsheet's `sep=;`."""
        for number, line in enumerate(self._lines):
            if number >= skip_rows and line.strip() and not line.startswith("#") and not _SEPARATOR.fullmatch(line):
                self._line = number
                return line
            if number < LOOK:
                self._passed.append(line)
        raise unreadable("The file has no line of headings.")

    def _blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """Some thousand rows at a time: the number columns as one array, the text columns as lists."""
        self._line += 1
        while lines := list(islice(self._lines, ROWS_AT_ONCE)):
            plain = None if self._empty_rows else self._fast(lines, numbers, texts)
            yield plain or self._careful(self._parsed(lines), numbers, texts)
            self._begun = True
            self._line += len(lines)

    def _parsed(self, lines: list[str]) -> list[list[str]]:
        """The cells of some lines, and of the further lines on which a quoted cell of theirs goes on."""
        reader = csv.reader(chain(lines, self._lines), delimiter=self._delimiter, strict=True)
        rows = self._rows(reader, len(lines))
        self._line += reader.line_num - len(lines)
        return rows

    def _fast(self, lines: list[str], numbers: Sequence[int], texts: Sequence[int]) -> Block | None:
        """A block in which a line is a row, by NumPy's own reader; None where a line is not as plain as that."""
        if self._decimal_commas or not self._decimal_points:
            return None
        if self._quoted:
            lines = [self._simply_quoted.sub(r"\1", line) if '"' in line else line for line in lines]
            if any('"' in line for line in lines):
                return None
        cuts = {line.count(self._delimiter) for line in lines}
        if cuts != {len(self.headings) - 1}:
            return None
        try:
            samples = np.loadtxt(
                lines,
                delimiter=self._delimiter,
                usecols=list(numbers),
                ndmin=2,
                comments=None,
                converters=dict.fromkeys(self.dated, self._elapsed.microseconds),
            )
        except ValueError:
            return None
        if len(samples) != len(lines):
            return None
        self._blank_lines.rows(len(lines))
        return samples, [LineCells(lines, self._delimiter, index) for index in texts]

    def _careful(self, rows: list[list[str]], numbers: Sequence[int], texts: Sequence[int]) -> Block:
        """A block cell by cell, saying what is wrong with it."""
        full = [fitted for place, row in enumerate(rows) for fitted in self._fitted(row, place, numbers)]
        samples = np.array([[self._value(row[index], index) for index in numbers] for row in full], dtype=np.float64)
        return samples.reshape(len(full), len(numbers)), [[row[index] for row in full] for index in texts]

    def _rows(self, reader: Reader, count: int) -> list[list[str]]:
        rows: list[list[str]] = []
        self._ends = []
        try:
            for row in islice(reader, count):
                rows.append(row)
                self._ends.append(self._line + reader.line_num)
        except csv.Error as error:
            line = self._line + reader.line_num
            if "field limit" in str(error):
                raise unreadable(f"Line {line} has a cell of more than {csv.field_size_limit()} characters.") from None
            raise unreadable(f"The quotes around line {line} do not match.") from None
        return rows

    def _fitted(self, row: list[str], place: int, numbers: Sequence[int]) -> Iterator[list[str]]:
        """A row as long as the headings, behind the rows of empty cells that it ends; those at the table's end go.

        Spreadsheets add empty cells at the end, and rows of nothing else; between samples they are lost samples. Files
        that were joined have their headings again.
        """
        width = len(self.headings)
        if not any(cell.strip() for cell in row):
            if len(row) > 1:
                self._empty_rows += self._begun
            else:
                self._blank_lines.blank()
            return
        if len(row) < width and row[0].lstrip().startswith("#"):
            return
        if len(row) < width or any(cell.strip() for cell in row[width:]):
            raise unreadable(
                f"The row in line {self._ends[place]} has {len(row)} cells where the headings have {width}."
            )
        if [cell.strip() for cell in row[:width]] == self._repeated:
            self._joined = True
            return
        if len(numbers) > 2 and all(_is_word(row[index]) for index in numbers):
            raise unreadable(
                f"Line {self._ends[place]} holds words in every column of numbers: they are no units that are known, "
                "and another table is a file of its own."
            )
        yield from ([""] * width for _ in range(self._empty_rows))
        self._begun, self._empty_rows = True, 0
        self._blank_lines.rows()
        yield row[:width]

    def _value(self, cell: str, column: int) -> float:
        return self._elapsed.microseconds(cell) if column in self.dated else self._number(cell)

    def _number(self, cell: str) -> float:
        """The number in a cell; NaN where there is none, infinite where something else stands."""
        comma = NUMBER.fullmatch(cell) is None
        if comma and not has_comma(cell):
            if groups_thousands(cell):
                raise unreadable(GROUPED)
            return float("nan" if is_no_number(cell) else "inf")
        if comma and not self._decimal_commas:
            if has_decimal_comma(cell):
                return self._unclear(UNCLEAR_COMMA)
            raise unreadable(UNCLEAR_COMMA)
        if comma or "." in cell:
            return self._of_mark(cell, "," if comma else ".")
        return float(cell)

    def _of_mark(self, cell: str, mark: str) -> float:
        """A number with a decimal mark, of which a file has one."""
        if self._decimal_commas:
            self._decimal_mark = self._decimal_mark or mark
            if mark != self._decimal_mark:
                return self._unclear(MIXED)
        elif not self._decimal_points:
            if may_group_by_point(cell):
                raise unreadable(UNCLEAR_POINT)
            self._decimal_points = True
        return float(cell.replace(",", "."))

    def _unclear(self, detail: str) -> float:
        """Refuse the file; between commas, where it takes quotes to write one, only the cell is none of a number."""
        if self._delimiter != ",":
            raise unreadable(detail)
        return float("inf")


def _is_word(cell: str) -> bool:
    """Whether a cell holds something, and no number however that is written."""
    return not (is_no_number(cell) or NUMBER.fullmatch(cell) or has_comma(cell))


def _lines(stream: BinaryIO, encoding: str) -> Iterator[str]:
    """The lines with their ends as they stand; the stream stays its owner's to close."""
    text = io.TextIOWrapper(stream, encoding=encoding, newline="")
    try:
        yield from text
    finally:
        with suppress(ValueError):  # the owner has closed it before
            text.detach()


def _simply_quoted(delimiter: str) -> re.Pattern[str]:
    """A cell in quotes that hold neither separators nor quotes: it is what stands between them."""
    return re.compile(rf'(?:^|(?<={delimiter}))"([^"{delimiter}\r\n]*)"(?=[{delimiter}\r\n]|$)')
