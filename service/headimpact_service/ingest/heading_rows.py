"""Which of the rows at a table's top are its headings, which above them go on in these, and which below are units."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate, islice

from headimpact.recording import AXES, SIGNALS
from headimpact_service.ingest.cells import is_written_number
from headimpact_service.ingest.scaled_units import known_units
from headimpact_service.ingest.spelling import compact, unit_ending
from headimpact_service.ingest.text_facts import DELIMITERS

LOOK = 60
"""Lines among which a table begins."""
MAX_UNIT = 16
MAX_CELLS, MAX_CELL = 8, 300
"""Of a row above the headings this much is looked at."""
_AXIS = re.compile(r"[\s_-]*axis", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Top:
    """The line of headings, and whether one of units follows it."""

    heading: int
    has_units: bool


def stated(cells: Iterable[str]) -> list[str]:
    """The first cells of a row above the headings, or of what else is said of a table, cut to a bound."""
    return [cell[:MAX_CELL] for cell in islice(cells, MAX_CELLS)]


def are_units(headings: Sequence[str], cells: Sequence[str]) -> bool:
    """Whether a row below headings says their units: most of what it says is one, and at least two are."""
    if len(cells) > len(headings) and any(cell.strip() for cell in cells[len(headings) :]):
        return False
    told = [cell for cell in cells if compact(cell)]
    known = sum(compact(cell) in known_units() for cell in told)
    return known >= 2 and 2 * known >= len(told) and all(len(cell.strip()) <= MAX_UNIT for cell in told)


def joined(upper: Sequence[str], headings: Sequence[str]) -> list[str]:
    """The headings with what stands once above several of them, as merged cells are saved.

    A quantity stands above its axes, with its unit or beside another quantity's; any other row above headings is none
    of theirs.
    """
    above = [cell.strip() for cell in [*upper, *[""] * len(headings)][: len(headings)]]
    over: list[str] = list(accumulate(above, _or_before))
    axes = [place for place, heading in enumerate(headings) if over[place] and _is_axis(heading)]
    quantities = {over[place] for place in axes}
    if len(axes) < len(AXES) or (len(quantities) < 2 and not all(map(_ends_in_unit, quantities))):
        return list(headings)
    alone = (_with_own(own, heading.strip()) for own, heading in zip(above, headings, strict=True))
    return [f"{over[at]} {_AXIS.sub('', headings[at])}" if at in axes else whole for at, whole in enumerate(alone)]


def _or_before(before: str, cell: str) -> str:
    return cell or before


def _is_axis(heading: str) -> bool:
    """Whether a heading is an axis and nothing else, but for its unit."""
    name = compact(heading)
    return name[:1] in AXES and name[1:].removeprefix("axis") in {"", *known_units()}


def _ends_in_unit(heading: str) -> bool:
    return any(unit_ending(signal, heading) for signal in SIGNALS)


def _with_own(above: str, heading: str) -> str:
    """A heading with the cell right above it, where it says nothing itself, or a unit only."""
    if compact(heading) not in {"", *known_units()}:
        return heading
    return above if compact(above).endswith(compact(heading)) else f"{above} {heading}".strip()


def top_of(lines: Sequence[str], *, search: bool) -> Top:
    """Where the headings stand among the first lines of a text, of which the first is none of its comments.

    That first line, unless words stand above a table of other width: a laboratory's or a program's own lines, which
    `search` passes over.
    """
    found = _first_numbers(lines)
    if found is None:
        return Top(0, has_units=False)
    numbers, delimiter = found
    rows = [cells_of(line, delimiter) for line in lines[: numbers + 1]]
    heading = _heading(rows) if search else 0
    below = heading + 1
    return Top(heading, below < numbers and are_units(rows[heading], rows[below]))


def _first_numbers(lines: Sequence[str]) -> tuple[int, str] | None:
    """The first line behind another that holds two numbers or more, and what parts them; None in case of doubt."""
    for place, line in enumerate(lines):
        if '"' in line and line.count('"') % 2:
            return None  # a cell in quotes goes on in the next line
        counts = {delimiter: sum(map(is_written_number, cells_of(line, delimiter))) for delimiter in DELIMITERS}
        best = max(counts, key=lambda delimiter: counts[delimiter])
        if place and counts[best] >= 2 and 2 * counts[best] >= len(_filled(cells_of(line, best))):
            return place, best
    return None


def _heading(rows: Sequence[Sequence[str]]) -> int:
    """The first row of words that is as wide as the numbers below it and mostly filled; else the first of all.

    Where axes stand below quantities, each as often as it has axes, the axes' row.
    """
    width = len(rows[-1])
    wide = [place for place, row in enumerate(rows[:-1]) if _may_be_headings(row, width)]
    if not wide:
        return 0
    first = wide[0]
    if first + 1 in wide and joined(rows[first], rows[first + 1]) != list(rows[first + 1]):
        return first + 1
    return first


def _may_be_headings(row: Sequence[str], width: int) -> bool:
    filled = _filled(row)
    words = not any(map(is_written_number, filled))
    return len(row) == width and 2 * len(filled) >= width and len(filled) > 1 and words


def _filled(cells: Sequence[str]) -> list[str]:
    return [cell for cell in cells if cell.strip()]


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of a line that stands alone."""
    try:
        return next(csv.reader([line.rstrip("\r\n")], delimiter=delimiter), [])
    except csv.Error:
        return [line]
