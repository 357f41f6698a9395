"""The rows above the samples of a DTS / TDAS CSV: ``key,value…``, with a value for each channel or one for all."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from headimpact_service.errors import Problem
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.iso_mme_files import NUMBER
from headimpact_service.ingest.spelling import compact

MAX_HEADER_ROWS = 200

# Keys without case, spaces and signs; of several names of the channels, the first kind that there is.
_KEYS = {
    "rate": re.compile(r"(sample|sampling)(rate|frequency)(hz|sps|samplessec|samplespersecond)?"),
    "rate_khz": re.compile(r"(sample|sampling)(rate|frequency)khz"),
    "code": re.compile(r"iso(channel)?code"),
    "unit": re.compile(r"engineeringunits?|eu|units?"),
    "filter": re.compile(r"softwarefilter[a-z]*"),
    "after": re.compile(r"(numberof)?post(zero|trig(ger)?)(data)?(p|pts|points|samples)?"),
    "points": re.compile(r"(number(of)?|total(number)?(of)?)(data)?(pts|points|samples)(total)?"),
    "description": re.compile(r"channeldescriptions?|sensordescriptions?"),
    "name": re.compile(r"channelnames?"),
    "other name": re.compile(r"descriptions?|locations?"),
}
_NAMES = ("description", "name", "other name")
_BEFORE = re.compile(r"(?:numberof)?pre(?:zero|trig(?:ger)?)(?:data|time)?([a-z]*)")
_POINTS = frozenset({"", "p", "pt", "pts", "point", "points", "sample", "samples"})
_SECONDS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "msecs", "millisecond", "milliseconds"), 1e-3),
}
"""What one unit of the time before the trigger is [s]."""
A_NUMBER = re.compile(NUMBER, re.ASCII)


@dataclass(frozen=True, slots=True)
class Header:
    """Cells by what they say, and the headings right above the samples.

    `before_s` is what one unit of the record before the trigger is [s], None for points.
    """

    fields: dict[str, list[str]]
    metadata: dict[str, str]
    before_s: float | None
    headings: Sequence[str] = ()

    def of_channel(self, key: str, index: int) -> str:
        """The channel's cell; a row with a single cell speaks for all channels."""
        cells = self.fields.get(key, [])
        if len(cells) == 1:
            return cells[0]
        return cells[index] if index < len(cells) else ""

    @property
    def names(self) -> list[str]:
        """What the channels are called: a row with a name for each, or for the only one."""
        rows = [self.fields[key] for key in _NAMES if key in self.fields]
        return max(rows, key=len, default=[])

    @property
    def rate_hz(self) -> float | None:
        """The sample rate that all channels share."""
        kilo = self.number("rate_khz", "The sample rate")
        return self.number("rate", "The sample rate") if kilo is None else 1000.0 * kilo

    def number(self, key: str, what: str) -> float | None:
        """A number that all channels share."""
        cells = set(filter(None, self.fields.get(key, [])))
        if not cells:
            return None
        numbers = {float(cell) for cell in cells if A_NUMBER.fullmatch(cell)}
        if len(numbers) != 1 or not all(A_NUMBER.fullmatch(cell) for cell in cells):
            raise file_fault(f"{what} must be one number for all channels.", "rates-differ")
        return numbers.pop()

    def points_before(self, rate_hz: float) -> float | None:
        """How many samples lie before the trigger, as far as the header says."""
        if not self.of_channel("before", 0):
            return None
        told = self.number("before", "The length of the record before the trigger")
        if told is None or self.before_s is not None:
            return None if told is None or self.before_s is None else told * self.before_s * rate_hz
        if told != round(told):
            raise file_fault(
                f"The header says that {told:g} points lie before the trigger: it counts them.", "time-zero"
            )
        return told


def read_header(rows: Sequence[Sequence[str]]) -> tuple[Header, int]:
    """The rows that begin with words, and the first that does not."""
    fields: dict[str, list[str]] = {}
    metadata: dict[str, str] = {}
    before_s: float | None = None
    for number, row in enumerate(rows[:MAX_HEADER_ROWS]):
        if A_NUMBER.fullmatch(row[0] or next(filter(None, row))) is not None:
            return Header(fields, metadata, before_s, rows[number - 1] if number else ()), number
        name = key_of(row[0])
        if name == "before" and name not in fields:
            before_s = _SECONDS.get(_unit_before(row[0]) or "")
        if name is not None:
            fields.setdefault(name, without_empty_end(row[1:]))
        elif compact(row[0]).startswith("test") and len(row) > 1 and row[1]:
            metadata.setdefault("_".join(re.findall(r"[a-z]+", row[0].lower()))[:40], row[1][:200])
    raise Problem("unreadable-file", f"The first {MAX_HEADER_ROWS} rows of the file hold no sample.")


def key_of(cell: str) -> str | None:
    """What a row says, by its first cell."""
    if _unit_before(cell) is not None:
        return "before"
    plain = compact(cell.strip().strip('"'))
    return next((name for name, spelling in _KEYS.items() if spelling.fullmatch(plain)), None)


def _unit_before(cell: str) -> str | None:
    """In what a row counts the record before the trigger; None where it does not, or in a unit that is not known."""
    found = _BEFORE.fullmatch(compact(cell.strip().strip('"')))
    return found[1] if found is not None and (found[1] in _POINTS or found[1] in _SECONDS) else None


def without_empty_end(cells: Sequence[str]) -> list[str]:
    """A row's cells without the empty ones behind them."""
    kept = list(cells)
    while kept and not kept[-1]:
        kept.pop()
    return kept
