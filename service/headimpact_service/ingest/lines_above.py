"""What rows above a table's headings state of its samples: it must not be gainsaid by how they are read."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from headimpact_service.ingest.cells import number_said
from headimpact_service.ingest.mapping import TIME_UNITS
from headimpact_service.ingest.spelling import compact, unit_spelled, words_of
from headimpact_service.ingest.time_headings import LEAST_HZ, hertz_of_rates, period_of_samples, speaks_of_samples

Rows = Sequence[Sequence[str]]

_WITH_VALUE = re.compile(r"([^:=]+)[:=](.+)", re.DOTALL)
"""A row's name with what it says in one cell: `Sample rate (Hz): 2000`."""
_NUMBER = re.compile(r"([+-]?[0-9.,]++(?:[eE][+-]?[0-9]+)?)\s*([A-Za-zµ/]*)")
"""A number, and its unit if that stands behind it."""
_UNIT = re.compile(r"[(\[]?([A-Za-zµ/]{1,20})[)\]]?")
"""A unit in a cell of its own."""
_THOUSANDS = re.compile(r"[1-9][0-9]{0,2}[.,][0-9]{3}")
"""Of samples per second, of which nobody has so few to three digits."""
_PARTS = re.compile("[.,]")
_FEW, _THREE = re.compile("[1-9][0-9]{0,2}"), re.compile("[0-9]{3}([^0-9]|$)")
"""The parts of a number whose thousands a comma between cells has parted."""
_NO_LONGER = frozenset({"decimated", "downsampled", "resampled", "interpolated", "e"})
"""Words of what the samples' rate is no longer, or of an example (`e.g.`)."""
_COMMENT = "#%;/*! "
"""What lines of comment begin with."""
_ABOUT_AXES = frozenset(
    {
        *("axes", "axis", "coordinate", "coordinates", "orientation", "convention", "frame", "polarity", "sign"),
        *("achsen", "achse", "vorzeichen", "koordinatensystem", "koordinaten", "axe", "repere", "ejes", "assi"),
    }
)
_SAE = re.compile(r"saej?(211|1733)|j(211|1733)|iso6487|^sae$")
_TURNED = re.compile(
    r"\bz(\W{0,3}axis)?\W{1,3}((is|points) )?(down(wards?)?|unten)\b"
    r"|\by(\W{0,3}axis)?\W{1,3}((is|points) )?(to the )?(right|rechts)\b",
    re.IGNORECASE,
)
"""Of SAE's axes, y points to the right and z down."""
_EITHER = frozenset({"or", "anatomical", "not", "no"})
_STEPS = frozenset({"period", "deltax", "xdelta", "deltat", "xincrement", "wfincrement"})
"""What programs call the time between two samples."""
_IN_WORDS = re.compile(
    r"(?<![0-9.,])(?P<number>[0-9][0-9.,]*+(?:[eE][+-]?[0-9]+)?)\s*"
    r"(?:(?P<hertz>k?hz)|(?P<samples>k?sa?/s|k?sps|samples?\s*(?:/|per)\s*s(?:ec(?:onds?)?)?)|(?P<period>[mµu]?s(?:ec)?))\b",
    re.IGNORECASE,
)
_CLAUSES = re.compile(r"[;()]|[,.]\s|\band\b")
"""What parts a sentence about filtering from one about sampling."""


def rates_stated(rows: Rows, *, sentences: bool) -> Iterator[tuple[str, float]]:
    """The sample rates that rows state, and the rows' names: a number in its cell, or one within a sentence [Hz]."""
    for name, cells in facts_stated(rows):
        if not _NO_LONGER.isdisjoint(words_of(" ".join([name, *cells]))):
            continue
        found = _rate_in_cells(name, cells)
        if found is None and sentences:
            found = _rate_in_words(" ".join([name, *cells])) or _rate_in_words("; ".join([name, *cells]))
        if found is not None and found >= LEAST_HZ:
            yield name, found


def _rate_in_cells(name: str, cells: Sequence[str]) -> float | None:
    """The rate of a row whose name is that of a rate or of a period, with its unit behind either."""
    found = next((place for place, cell in enumerate(cells) if _NUMBER.fullmatch(cell)), None)
    if found is None:
        return None
    cells = _whole(cells, found)
    read = _NUMBER.fullmatch(cells[found])
    if read is None:
        return None
    behind = _UNIT.fullmatch(cells[found + 1]) if len(cells) > found + 1 else None
    beside = read[2] or (behind[1] if behind else None)
    hertz, period_ms = hertz_of_rates(name, beside, fs_is_rate=True), period_of_samples(name, beside)
    if hertz == 1.0 and beside in {"k", "K"}:
        hertz = 1000.0
    if period_ms is None and compact(name) in _STEPS and (unit := unit_spelled("time", beside)) is not None:
        period_ms = TIME_UNITS[unit]
    return _rate(_number(read[1], hertz), hertz, period_ms)


def _whole(cells: Sequence[str], place: int) -> Sequence[str]:
    """Cells, with a number put together that a comma between its thousands has parted."""
    if len(cells) > place + 1 and _FEW.fullmatch(cells[place]) and _THREE.match(cells[place + 1]):
        return [*cells[:place], cells[place] + cells[place + 1], *cells[place + 2 :]]
    return cells


def _rate_in_words(text: str) -> float | None:
    """The rate in a sentence about sampling: `Data were sampled at 2000 Hz`, `Sampling interval 0.5 ms`."""
    told = (_rate_in_clause(clause) for clause in _CLAUSES.split(text))
    return next((rate for rate in told if rate is not None), None)


def _rate_in_clause(text: str) -> float | None:
    found = _IN_WORDS.search(text)
    if found is None or not (found["samples"] or speaks_of_samples(text)):
        return None
    unit = unit_spelled("time", found["period"])
    of_rate = 1000.0 if (found["hertz"] or found["samples"] or "").lower().startswith("k") else 1.0
    hertz = of_rate if unit is None else None
    return _rate(_number(found["number"], hertz), hertz, None if unit is None else TIME_UNITS[unit])


def _number(text: str, hertz: float | None) -> float | None:
    """A number as it is written; in hertz, of which nobody has so few, points and commas that part thousands go."""
    number = number_said(text)
    few = number is None or number < LEAST_HZ
    return number_said(_PARTS.sub("", text)) if hertz == 1.0 and few and _THOUSANDS.fullmatch(text) else number


def _rate(number: float | None, hertz: float | None, period_ms: float | None) -> float | None:
    if number is None or number <= 0.0:
        return None
    if hertz is not None:
        return number * hertz
    return None if period_ms is None else 1000.0 / (number * period_ms)


def axes_stated(rows: Rows) -> str | None:
    """What rows call the axes where they state those of SAE J211."""
    for name, cells in facts_stated(rows):
        if speaks_of_axes(name) and (found := next((cell for cell in cells if are_sae(cell)), None)) is not None:
            return found
        if (turned := _TURNED.search(" ".join([name, *cells]))) is not None:
            return turned[0]
    return None


def speaks_of_axes(heading: str) -> bool:
    """Whether a row's name or a heading is about the directions of the axes."""
    return not _ABOUT_AXES.isdisjoint(words_of(heading))


def are_sae(text: str) -> bool:
    """Whether a text says that axes are those of SAE J211, by its name; `SAE J211 or anatomical` says neither."""
    return _SAE.search(compact(text)) is not None and _EITHER.isdisjoint(words_of(text))


def facts_stated(rows: Rows) -> Iterator[tuple[str, list[str]]]:
    """Rows as a name and what is said for it."""
    for row in rows:
        name, *cells = [cell.strip() for cell in row] or [""]
        if with_value := _WITH_VALUE.fullmatch(name):
            name, cells = with_value[1].strip(), [with_value[2].strip(), *cells]
        yield name.lstrip(_COMMENT).rstrip(":= "), cells
