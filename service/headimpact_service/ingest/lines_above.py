"""What rows above a table's headings state of its samples: it must not be gainsaid by how they are read."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from headimpact_service.ingest.cells import number_said
from headimpact_service.ingest.spelling import compact, words_of
from headimpact_service.ingest.time_headings import hertz_of_rates, period_of_samples

Rows = Sequence[Sequence[str]]

_WITH_VALUE = re.compile(r"([^:=]+)[:=](.+)", re.DOTALL)
"""A row's name with what it says in one cell: `Sample rate (Hz): 2000`."""
_NUMBER = re.compile(r"([+-]?[0-9.,]+(?:[eE][+-]?[0-9]+)?)\s*([A-Za-zµ/]*)")
"""A number, and its unit if that stands behind it."""
_UNIT = re.compile(r"[(\[]?([A-Za-zµ/]{1,20})[)\]]?")
"""A unit in a cell of its own."""
_THOUSANDS = re.compile(r"[1-9][0-9]{0,2},[0-9]{3}")
"""Of samples per second, of which nobody has so few to three digits."""
_COMMENT = "#%;/*! "
"""What lines of comment begin with."""
_ABOUT_AXES = frozenset({"axes", "axis", "coordinate", "coordinates", "orientation", "convention", "frame", "polarity"})
_SAE = re.compile(r"saej?211(1|iso6487)?")


def rates_stated(rows: Rows) -> Iterator[tuple[str, float]]:
    """The sample rates that rows state, and the rows' names: a number in its cell or in the one behind it [Hz]."""
    for name, cells in _facts(rows):
        found = next((place for place, cell in enumerate(cells) if _NUMBER.fullmatch(cell)), None)
        if found is None or (read := _NUMBER.fullmatch(cells[found])) is None:
            continue
        behind = _UNIT.fullmatch(cells[found + 1]) if len(cells) > found + 1 else None
        beside = read[2] or (behind[1] if behind else None)
        hertz, period_ms = hertz_of_rates(name, beside, fs_is_rate=True), period_of_samples(name, beside)
        text = read[1].replace(",", "") if hertz is not None and _THOUSANDS.fullmatch(read[1]) else read[1]
        number = number_said(text)
        if number is None:
            continue
        if hertz is not None:
            yield name, number * hertz
        elif period_ms is not None and number > 0.0:
            yield name, 1000.0 / (number * period_ms)


def axes_stated(rows: Rows) -> str | None:
    """What rows call the axes where they state those of SAE J211."""
    for name, cells in _facts(rows):
        if not _ABOUT_AXES.isdisjoint(words_of(name)):
            found = next((cell for cell in cells if _SAE.fullmatch(compact(cell))), None)
            if found is not None:
                return found
    return None


def _facts(rows: Rows) -> Iterator[tuple[str, list[str]]]:
    """Rows as a name and what is said for it."""
    for row in rows:
        name, *cells = [cell.strip() for cell in row] or [""]
        if with_value := _WITH_VALUE.fullmatch(name):
            name, cells = with_value[1].strip(), [with_value[2].strip(), *cells]
        yield name.lstrip(_COMMENT).rstrip(":= "), cells
