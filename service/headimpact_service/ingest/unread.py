"""Columns that no layout reads, but that may tell that the rows of a table are several impacts.

They are looked at where nothing else would: a table without a column that tells impacts apart, and without times, which
would begin anew with each. A mapping's empty ``group_by`` says that all rows are one impact.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise

from headimpact_service.ingest.cells import said
from headimpact_service.ingest.impact_json import MIN_RATE_HZ
from headimpact_service.ingest.times import TimeError, instant

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|#")
_NAMES = frozenset(
    {
        *("impact", "event", "hit", "trial", "test", "run", "shot", "drop", "session", "record", "recording"),
        *("id", "uuid", "guid", "name", "file", "filename", "serial"),
        *("player", "athlete", "subject", "wearer", "user", "participant", "team", "sensor", "device"),
    }
)
_MEASURED = frozenset(
    {
        *("temp", "temperature", "battery", "voltage", "volt", "charge", "current", "pressure", "humidity", "force"),
        *("flag", "trigger", "triggered", "status", "threshold", "quality", "valid", "proximity", "distance", "light"),
    }
)
"""Words of what changes within an impact, whatever it is of: a sensor's temperature, an event's flag."""
_TIMES = frozenset({"time", "date", "timestamp", "datetime", "clock"})
_COUNTERS = frozenset({"sample", "samples", "index", "idx", "frame", "row", "point", "scan", "counter"})
_TIME_OF_DAY = re.compile(r"[0-2]?[0-9]:[0-5][0-9]:[0-5][0-9](\.[0-9]{1,9})?")
_WHOLE = re.compile(r"[+-]?[0-9]{1,15}(\.0*)?")
_WITH_PARTS = re.compile(r"[+-]?[0-9]*\.[0-9]*[1-9][0-9]*([eE][+-]?[0-9]+)?")
ROUNDED_TO_S = 1.0
"""Times of samples may be written to the second."""
STAY = 10
"""A time that cannot be read and stays for so many rows on average is none of the samples'."""


@dataclass(frozen=True, slots=True)
class Unread:
    """Columns by what their headings say: names of something, times, and numbers of samples."""

    names: tuple[int, ...] = ()
    times: tuple[int, ...] = ()
    counters: tuple[int, ...] = ()

    @property
    def columns(self) -> tuple[int, ...]:
        """All of them."""
        return (*self.names, *self.times, *self.counters)


NOTHING_UNREAD = Unread()


def unread_columns(headings: Sequence[str], read: Collection[int]) -> Unread:
    """The columns beside those that are read whose headings speak of impacts, of times or of samples."""
    names, times, counters = [], [], []
    for column, heading in enumerate(headings):
        words = {word.lower() for word in _WORD.findall(heading)}
        if column in read:
            continue
        if words & _COUNTERS:
            counters.append(column)
        elif words & _TIMES:
            times.append(column)
        elif words & _NAMES and not words & _MEASURED:
            names.append(column)
    return Unread(tuple(names), tuple(times), tuple(counters))


def begins_anew(cells: Sequence[str]) -> bool:
    """Whether numbers of samples go back to one that was before."""
    told = [float(cell) for cell in map(said, cells) if _WHOLE.fullmatch(cell)]
    return any(after <= before for before, after in pairwise(told)) and len(set(told)) > 1


def are_several(cells: Sequence[str]) -> bool:
    """Whether a column names more than one thing: not one that is measured, nor one that numbers its rows."""
    told = [cell for cell in map(said, cells) if cell]
    distinct = set(told)
    return 1 < len(distinct) < len(told) and not any(map(_WITH_PARTS.fullmatch, distinct))


def lie_apart(cells: Sequence[str], time_zone: str | None) -> bool:
    """Whether times are further apart than the samples of one impact are."""
    told = dict.fromkeys(filter(None, map(said, cells)))
    moments = [when for text in told if (when := moment_of(text, time_zone)) is not None]
    if len(moments) < len(told):
        return len(told) > 2 and len(told) * STAY <= len(cells)
    return bool(moments) and span_s(moments) > len(cells) / MIN_RATE_HZ + ROUNDED_TO_S


def span_s(moments: Sequence[datetime]) -> float:
    """From the first to the last [s]."""
    return (max(moments) - min(moments)).total_seconds()


def moment_of(text: str, time_zone: str | None) -> datetime | None:
    """A date with its time, in any zone, or a time of any day; None for anything else."""
    whole = f"2000-01-01T{text.zfill(8)}" if _TIME_OF_DAY.fullmatch(text) else text.replace("/", "-")
    try:
        return instant(whole, time_zone or "UTC")
    except TimeError:
        return None
