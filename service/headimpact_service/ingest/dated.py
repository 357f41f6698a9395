"""Times of samples that are written as dates with times of day: `2026-10-03T14:05:22.113Z`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from headimpact_service.ingest.cells import is_no_number, said
from headimpact_service.ingest.times import nanoseconds

FIRST_ROWS = 8
"""Rows by which a column is told: where one has a whole second and nothing behind it, the next has not."""


def dated_columns(columns: Iterable[Sequence[str]]) -> frozenset[int]:
    """Those of a table's columns that are dated, by the cells of its first rows."""
    return frozenset(place for place, cells in enumerate(columns) if are_dated(cells))


def are_dated(cells: Iterable[str]) -> bool:
    """Whether a column begins with a time, and has some with parts of a second: whole seconds are no samples'."""
    told = [text for cell in cells if (text := said(cell))]
    return bool(told) and nanoseconds(told[0]) is not None and any("." in text for text in filter(nanoseconds, told))


class Elapsed:
    """The dated columns of one table as microseconds since the first time that is read.

    Since 1970 they would be exact to a quarter of a microsecond only, and not to the nanosecond.
    """

    def __init__(self) -> None:
        """Nothing is read yet."""
        self._first: int | None = None

    def microseconds(self, cell: str) -> float:
        """The time in a cell; NaN where there is none, infinite where something else stands."""
        when = nanoseconds(cell.strip())
        if when is None:
            return float("nan" if is_no_number(cell) else "inf")
        if self._first is None:
            self._first = when
        return (when - self._first) / 1000.0
