"""Columns of text: cells that are looked up when they are asked for, as most of them never are.

What a table says of an impact stands in each of its rows and is read from the first.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, chain
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

NOTHING = frozenset({"", "-", ".", "na", "n/a", "#n/a", "nan", "nat", "null", "missing"})
"""What stands in a cell that holds nothing, as spreadsheets, R, pandas and Julia write it; in small letters.

Not `none`: that is a filter.
"""
_WRITTEN_NUMBER = re.compile(r"[+-]?([0-9]++([.,][0-9]*+)?|[.,][0-9]++)([eE][+-]?[0-9]+)?", re.ASCII)

NUMBER = re.compile(r"\s*[+-]?([0-9]++(\.[0-9]*+)?|\.[0-9]++)([eE][+-]?[0-9]+)?\s*", re.ASCII)
"""With a decimal point. float() also takes 1_000, digits of other scripts, and nan; samples hold none of them."""


def said(cell: str) -> str:
    """A cell without the blanks around it; empty where it holds nothing."""
    text = cell.strip()
    return "" if text.lower() in NOTHING else text


def is_no_number(cell: str) -> bool:
    """Whether a cell among numbers holds nothing, rather than something that is none."""
    return said(cell).lower() in {"", "none"}


def is_written_number(cell: str) -> bool:
    """Whether a cell is a number, with a decimal point or a decimal comma."""
    return _WRITTEN_NUMBER.fullmatch(cell.strip()) is not None


def number_said(cell: str) -> float | None:
    """The number in a cell; None where it is none."""
    return float(cell.strip().replace(",", ".")) if is_written_number(cell) else None


def numbers_said(cells: Iterable[str]) -> list[float]:
    """The numbers in cells, without those that are none."""
    return [float(cell.replace(",", ".")) for cell in map(said, cells) if is_written_number(cell)]


def number_text(value: float) -> str:
    """A number that is a name, in as few digits as tell it from others: 20.1, and 20 for 20.0."""
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)


class Words(Sequence[str]):
    """Cells as places in a list of the words that occur."""

    def __init__(self, places: NDArray[Any], known: Sequence[str]) -> None:
        """`known[places[row]]` is the cell of a row."""
        self.places, self.known = places, known

    def __len__(self) -> int:
        """Rows."""
        return int(self.places.size)

    @overload
    def __getitem__(self, row: int) -> str: ...
    @overload
    def __getitem__(self, row: slice) -> Sequence[str]: ...
    def __getitem__(self, row: int | slice) -> str | Sequence[str]:
        """A cell, or some rows."""
        return Words(self.places[row], self.known) if isinstance(row, slice) else self.known[self.places[row]]

    def __iter__(self) -> Iterator[str]:
        """Cell by cell."""
        return map(self.known.__getitem__, self.places.tolist())

    @classmethod
    def of(cls, cells: Sequence[str]) -> Words:
        """Any cells, as words."""
        if isinstance(cells, cls):
            return cells
        known = {text: place for place, text in enumerate(dict.fromkeys(cells))}
        return cls(np.fromiter(map(known.__getitem__, cells), np.int32, len(cells)), list(known))


class LineCells(Sequence[str]):
    """One column of lines whose cells no separator and no quote stands in."""

    def __init__(self, lines: Sequence[str], delimiter: str, column: int) -> None:
        """Nothing is split yet."""
        self._lines, self._delimiter, self.column = lines, delimiter, column

    def __len__(self) -> int:
        """Rows."""
        return len(self._lines)

    def mark_where_beginnings_differ(self, changed: NDArray[np.bool_]) -> None:
        """Mark the rows that differ from the one above in this column or in any before it."""
        beginning = None
        for row, line in enumerate(self._lines):
            if beginning is None or not line.startswith(beginning):
                changed[row] |= beginning is not None
                behind = line.split(self._delimiter, self.column + 1)[self.column + 1 :]
                beginning = line[: len(line) - len("".join(behind))]

    @overload
    def __getitem__(self, row: int) -> str: ...
    @overload
    def __getitem__(self, row: slice) -> Sequence[str]: ...
    def __getitem__(self, row: int | slice) -> str | Sequence[str]:
        """A cell, or some rows."""
        if isinstance(row, slice):
            return LineCells(self._lines[row], self._delimiter, self.column)
        return self._lines[row].split(self._delimiter, self.column + 1)[self.column].rstrip("\r\n")

    def __iter__(self) -> Iterator[str]:
        """Cell by cell; only the last of a line has its end."""
        delimiter, column = self._delimiter, self.column
        if self._lines and self._lines[0].count(delimiter) == column:
            return (line.rsplit(delimiter, 1)[-1].rstrip("\r\n") for line in self._lines)
        return iter([line.split(delimiter, column + 1)[column] for line in self._lines])


class Stacked(Sequence[str]):
    """Columns of several blocks, end to end."""

    def __init__(self, parts: Sequence[Sequence[str]]) -> None:
        """The blocks' columns in order."""
        self.parts = parts
        self._starts = [0, *accumulate(map(len, parts))]

    def __len__(self) -> int:
        """Rows."""
        return self._starts[-1]

    @overload
    def __getitem__(self, row: int) -> str: ...
    @overload
    def __getitem__(self, row: slice) -> Sequence[str]: ...
    def __getitem__(self, row: int | slice) -> str | Sequence[str]:
        """A cell, or some rows that follow each other."""
        if isinstance(row, int):
            part = bisect_right(self._starts, row) - 1
            return self.parts[part][row - self._starts[part]]
        start, stop, _ = row.indices(len(self))
        pairs = zip(self.parts, self._starts, strict=False)
        return Stacked([part[max(start - at, 0) : max(stop - at, 0)] for part, at in pairs if at < stop])

    def __iter__(self) -> Iterator[str]:
        """Cell by cell."""
        return chain.from_iterable(self.parts)
