"""Whose an impact is, from which device and when, where rows above the headings say it, or columns that have no field.

They are read where they can be read surely, and left alone otherwise: nobody has said that they are meant so.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from headimpact_service.ingest.cells import said
from headimpact_service.ingest.date_order import year_first
from headimpact_service.ingest.headings import Headings
from headimpact_service.ingest.lines_above import Rows, facts_stated
from headimpact_service.ingest.spelling import compact
from headimpact_service.ingest.times import TimeError, instant

_EVENTS = ("eventtime", "impacttime", "hittime", "eventtimestamp", "impacttimestamp")
_STAMPS = ("timestamp", "datetime")
_EVENT_DATES, _EVENT_TIMES = ("date", "eventdate", "impactdate"), ("time", "eventtime", "impacttime", "timeofday")
_ATHLETES = ("athleteid", "playerid", "subjectid", "athlete", "player", "playername", "athletename")
_DEVICES = ("deviceid", "deviceserial", "deviceserialnumber", "serialnumber", "sensorid", "mouthguardid")
"""Of rows above a table; a lone `device` there may as well be its make, and a lone date that of an export."""
_SEVERAL = re.compile(r"[;|].*[:=]")
_NOBODY = ""
"""What stands beside the values of a row that says more than one thing."""


@dataclass(frozen=True, slots=True)
class FactsAbove:
    """What rows above the headings say of the impacts below."""

    athlete: str | None = None
    device: str | None = None
    occurred_at: datetime | None = None


NOTHING_ABOVE = FactsAbove()


def facts_above(rows: Rows, time_zone: str | None) -> FactsAbove:
    """The facts of rows that are a name and one value; of a name that says two, none."""
    told: dict[str, set[str]] = {}
    for name, cells in facts_stated(rows):
        values = list(filter(None, map(said, cells)))
        several = len(values) > 1 or any(map(_SEVERAL.search, values))
        told.setdefault(compact(name), set()).update([*values, _NOBODY] if several else values)
    when = _first(told, ("occurredat", *_EVENTS))
    return FactsAbove(
        athlete=_first(told, _ATHLETES),
        device=_first(told, _DEVICES),
        occurred_at=None if when is None else moment_said([when], time_zone),
    )


def _first(told: Mapping[str, set[str]], names: Sequence[str]) -> str | None:
    """What the first of some names says that says one thing."""
    return next((next(iter(told[name])) for name in names if len(told.get(name, ())) == 1), None)


def event_columns(headings: Headings, passed: Collection[int]) -> tuple[tuple[int, ...], ...]:
    """The columns that may say when an impact was: those of a time with its date, and a date's with a time's."""
    places = {compact(heading): column for column, heading in enumerate(headings.written) if column not in passed}
    return tuple(dict.fromkeys(_events(places)))


def _events(places: Mapping[str, int]) -> Iterator[tuple[int, ...]]:
    yield from ((places[name],) for name in (*_EVENTS, *_STAMPS) if name in places)
    for date in _EVENT_DATES:
        yield from ((places[date], places[time]) for time in _EVENT_TIMES if date in places and time in places)


def moment_said(parts: Sequence[str], time_zone: str | None) -> datetime | None:
    """The instant of one text, or of a date's and a time's; None where they are none, or nobody's clock."""
    try:
        return instant(year_first("T".join(parts), None), time_zone)
    except TimeError:
        return None
