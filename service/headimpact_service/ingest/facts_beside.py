"""Whose an impact is, from which device and when, where rows above the headings say it, or columns that have no field.

They are read where they can be read surely, and left alone otherwise: nobody has said that they are meant so.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from headimpact_service.ingest.cells import said
from headimpact_service.ingest.date_order import year_first
from headimpact_service.ingest.headings import Headings
from headimpact_service.ingest.lines_above import Rows, facts_stated
from headimpact_service.ingest.spelling import compact
from headimpact_service.ingest.times import TimeError, instant

Field = Literal["athlete", "device", "occurred_at"]
_EVENTS = ("eventtime", "impacttime", "hittime", "eventtimestamp", "impacttimestamp", "timestamp", "datetime")
_EVENT_DATES, _EVENT_TIMES = ("date", "eventdate", "impactdate"), ("time", "eventtime", "impacttime", "timeofday")
_ABOVE: Mapping[Field, tuple[str, ...]] = {
    "athlete": ("athlete", "athleteid", "player", "playerid", "subjectid", "playername", "athletename"),
    "device": ("deviceid", "deviceserial", "deviceserialnumber", "serialnumber", "sensorid", "mouthguardid"),
    "occurred_at": ("occurredat", *_EVENTS),
}
"""Rows' names; a lone `device` above a table may as well be its make."""


@dataclass(frozen=True, slots=True)
class FactsAbove:
    """What rows above the headings say of the impacts below."""

    athlete: str | None = None
    device: str | None = None
    occurred_at: datetime | None = None


NOTHING_ABOVE = FactsAbove()


def facts_above(rows: Rows, time_zone: str | None) -> FactsAbove:
    """The facts of rows: of each the first that is named so and says something."""
    told: dict[str, str] = {}
    for name, cells in facts_stated(rows):
        text = next(filter(None, map(said, cells)), "")
        if text:
            told.setdefault(compact(name), text)
    dates = ([told.get(date, ""), told.get(time, "")] for date in _EVENT_DATES for time in _EVENT_TIMES)
    whole = [[told[name]] for name in _ABOVE["occurred_at"] if name in told]
    moments = (moment_said(parts, time_zone) for parts in (*whole, *filter(all, dates)))
    return FactsAbove(
        athlete=next((told[name] for name in _ABOVE["athlete"] if name in told), None),
        device=next((told[name] for name in _ABOVE["device"] if name in told), None),
        occurred_at=next(filter(None, moments), None),
    )


def event_columns(headings: Headings, passed: Collection[int]) -> tuple[tuple[int, ...], ...]:
    """The columns that may say when an impact was: those of a time with its date, and a date's with a time's."""
    places = {compact(heading): column for column, heading in enumerate(headings.written) if column not in passed}
    return tuple(dict.fromkeys(_events(places)))


def _events(places: Mapping[str, int]) -> Iterator[tuple[int, ...]]:
    yield from ((places[name],) for name in _EVENTS if name in places)
    for date in _EVENT_DATES:
        yield from ((places[date], places[time]) for time in _EVENT_TIMES if date in places and time in places)


def moment_said(parts: Sequence[str], time_zone: str | None) -> datetime | None:
    """The instant of one text, or of a date's and a time's; None where they are none, or nobody's clock."""
    try:
        return instant(year_first("T".join(parts), None), time_zone)
    except TimeError:
        return None
