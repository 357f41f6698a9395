"""Which of the rows at a table's top are its headings, and which below them are units."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass

from headimpact_service.ingest.cells import is_written_number
from headimpact_service.ingest.spelling import compact, known_units
from headimpact_service.ingest.text_facts import DELIMITERS

LOOK = 60
"""Lines among which a table begins."""
MAX_UNIT = 16


@dataclass(frozen=True, slots=True)
class Top:
    """The line of headings, and whether one of units follows it."""

    heading: int
    has_units: bool


def are_units(headings: Sequence[str], cells: Sequence[str]) -> bool:
    """Whether a row below headings says their units: most of what it says is one, and at least two are."""
    if len(cells) > len(headings) and any(cell.strip() for cell in cells[len(headings) :]):
        return False
    told = [cell for cell in cells if compact(cell)]
    known = sum(compact(cell) in known_units() for cell in told)
    return known >= 2 and 2 * known >= len(told) and all(len(cell.strip()) <= MAX_UNIT for cell in told)


def top_of(lines: Sequence[str], *, search: bool) -> Top:
    """Where the headings stand among the first lines of a text, of which the first is none of its comments.

    That first line, unless words stand above a table of other width: a laboratory's or a program's own lines, which
    `search` passes over.
    """
    found = _first_numbers(lines)
    if found is None:
        return Top(0, has_units=False)
    numbers, delimiter = found
    rows = [_cells(line, delimiter) for line in lines[: numbers + 1]]
    heading = _heading(rows) if search else 0
    below = heading + 1
    return Top(heading, below < numbers and are_units(rows[heading], rows[below]))


def _first_numbers(lines: Sequence[str]) -> tuple[int, str] | None:
    """The first line behind another that holds two numbers or more, and what parts them; None in case of doubt."""
    for place, line in enumerate(lines):
        if '"' in line and line.count('"') % 2:
            return None  # a cell in quotes goes on in the next line
        counts = {delimiter: sum(map(is_written_number, _cells(line, delimiter))) for delimiter in DELIMITERS}
        best = max(counts, key=lambda delimiter: counts[delimiter])
        if place and counts[best] >= 2 and 2 * counts[best] >= len(_filled(_cells(line, best))):
            return place, best
    return None


def _heading(rows: Sequence[Sequence[str]]) -> int:
    """The first row of words that is as wide as the numbers below it and mostly filled; else the first of all."""
    width = len(rows[-1])
    for place, row in enumerate(rows[:-1]):
        filled = _filled(row)
        if (
            len(row) == width
            and 2 * len(filled) >= width
            and len(filled) > 1
            and not any(map(is_written_number, filled))
        ):
            return place
    return 0


def _filled(cells: Sequence[str]) -> list[str]:
    return [cell for cell in cells if cell.strip()]


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line.rstrip("\r\n")], delimiter=delimiter), [])
    except csv.Error:
        return [line]
