"""Times of samples that are written as times of day, or elapsed: `2026-10-03T14:05:22.113Z`, `0 days 00:00:00.113`.

Of a date that does not begin with its year nobody needs to know the day from the month: samples are of one day, or of
one and the next.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import timedelta

from headimpact_service.ingest.cells import is_no_number, said
from headimpact_service.ingest.times import nanoseconds

FIRST_ROWS = 8
"""Rows by which a column is told: where one has a whole second and nothing behind it, the next has not."""
_CLOCK = re.compile(
    r"(?:(?P<date>[0-9]{1,4}[-./][0-9]{1,2}[-./][0-9]{1,4})[ ,T]+|(?P<days>-?[0-9]{1,4}) days? \+?)?"
    r"(?:(?P<hours>[0-9]{1,2}):)?(?P<minutes>[0-9]{1,2}):(?P<seconds>[0-9]{2})"
    r"(?:[.,](?P<parts>[0-9]{1,9})|:(?P<thousandths>[0-9]{3}))?(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?",
    re.ASCII,
)
"""A time of day, with a date or without, or one that has passed, with its days; without hours, minutes and seconds as a
spreadsheet shows them."""
_FRACTION = re.compile(r":[0-9]{2}(?:[.,][0-9]|:[0-9]{3})", re.ASCII)
DAY_S = 86_400
NIGHT_S = 23 * 3600
"""What a clock without a date falls by at midnight, at least."""
MAX_DAYS = 4000
"""Of one file: eleven years of them."""


def dated_columns(columns: Iterable[Sequence[str]]) -> frozenset[int]:
    """Those of a table's columns that are dated, by the cells of its first rows."""
    return frozenset(place for place, cells in enumerate(columns) if are_dated(cells))


def are_dated(cells: Iterable[str]) -> bool:
    """Whether a column begins with a time, and has some with parts of a second: whole seconds are no samples'.

    Nor is a time of day that stays, as many exports say in each row when the impact was.
    """
    told = [text for cell in cells if (text := said(cell))]
    if not told or not any(map(_FRACTION.search, told)):
        return False
    return nanoseconds(told[0]) is not None or (len(set(told)) > 1 and Elapsed().nanoseconds(told[0]) is not None)


class Elapsed:
    """The dated columns of one table as microseconds since the first time that is read.

    Since 1970 they would be exact to a quarter of a microsecond only, and not to the nanosecond.
    """

    def __init__(self) -> None:
        """Nothing is read yet."""
        self._first: int | None = None
        self._days: dict[str, int] = {}
        self._midnights = 0
        self._last_s = 0

    def microseconds(self, cell: str) -> float:
        """The time in a cell; NaN where there is none, infinite where something else stands."""
        when = self.nanoseconds(cell.strip())
        if when is None:
            return float("nan" if is_no_number(cell) else "inf")
        if self._first is None:
            self._first = when
        return (when - self._first) / 1000.0

    def nanoseconds(self, text: str) -> int | None:
        """The time of a text from some origin, the same for all of one way to write; None for what is no time."""
        when = nanoseconds(text)
        return self._on_a_clock(text) if when is None else when

    def _on_a_clock(self, text: str) -> int | None:
        """Dates count as the days that follow each other, in the order in which they come."""
        found = _CLOCK.fullmatch(text)
        seconds = None if found is None else _seconds(found)
        if found is None or seconds is None:
            return None
        if len(self._days) > MAX_DAYS:
            return None
        parts = found["parts"] or found["thousandths"] or ""
        return (self._day(found, seconds) * DAY_S + seconds) * 10**9 + int(parts.ljust(9, "0"))

    def _day(self, found: re.Match[str], seconds: int) -> int:
        """Which day a time is of: the one that is written or, without any, the one that midnights have led to."""
        if found["days"] is not None:
            return int(found["days"])
        if found["date"] is not None:
            return self._days.setdefault(found["date"], len(self._days))
        step, self._last_s = seconds - self._last_s, seconds
        self._midnights += (step < -NIGHT_S) - (step > NIGHT_S)
        return self._midnights


def elapsed_text(time: timedelta) -> str:
    """A time that has passed, as :class:`Elapsed` reads it."""
    minutes, seconds = divmod(time.seconds, 60)
    return f"{time.days} days {minutes // 60:02}:{minutes % 60:02}:{seconds:02}.{time.microseconds:06}"


def _seconds(found: re.Match[str]) -> int | None:
    """Whole seconds since midnight, or since the hour where none is written; None where no clock shows that."""
    hours, minutes, seconds = (int(found[name] or 0) for name in ("hours", "minutes", "seconds"))
    whole = found["date"] or found["days"] or found["half"]
    if minutes > 59 or seconds > 59 or hours > 23 or (found["hours"] is None and whole):
        return None
    if found["half"] is not None:
        if not 1 <= hours <= 12:
            return None
        hours = hours % 12 + (12 if found["half"] in "Pp" else 0)
    return 3600 * hours + 60 * minutes + seconds
