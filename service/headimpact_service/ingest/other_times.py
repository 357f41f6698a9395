"""Columns beside those that are read whose headings speak of times or of rates: the signals must not gainsay them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from math import inf

from headimpact_service.ingest.headings import Headings
from headimpact_service.ingest.mapping import DATES_IN, TIME_UNITS
from headimpact_service.ingest.spelling import compact
from headimpact_service.ingest.table import Table
from headimpact_service.ingest.time_headings import (
    hertz_of_rates,
    may_be_times,
    names_samples,
    names_trigger,
    period_of_samples,
    unit_of_times,
)


@dataclass(frozen=True, slots=True)
class OtherClock:
    """A column of stamps that no signal is read by; `milliseconds` are those of one unit of them, if it is known.

    One whose heading is a word for the samples' times `may_count`, if it goes on as they do.
    """

    column: int
    heading: str
    milliseconds: float | None
    may_count: bool


@dataclass(frozen=True, slots=True)
class OtherRate:
    """A column of samples per second, or of so many, that no signal is read by, or of their period."""

    column: int
    heading: str
    hertz: float
    period_ms: float | None = None
    sure: bool = True
    """Whether its heading speaks of samples: else only what no other rate is, some hundred hertz, is one of theirs."""

    def rate_of(self, said: float) -> float:
        """The rate that a number in it says [Hz]; none of a period says infinitely many."""
        if self.period_ms is None:
            return said * self.hertz
        return 1000.0 / (said * self.period_ms) if said > 0.0 else inf


@dataclass(frozen=True, slots=True)
class OtherTimes:
    """The columns of times and of rates that are not read."""

    clocks: tuple[OtherClock, ...] = ()
    rates: tuple[OtherRate, ...] = ()
    stated: tuple[tuple[str, float], ...] = ()
    """What rows above the headings are called that state a sample rate, and the rate [Hz]."""


NO_OTHERS = OtherTimes()


def other_times(headings: Headings, read: Collection[int], table: Table, times: Collection[int]) -> OtherTimes:
    """The columns of times and of rates beside those that are read.

    Parameters
    ----------
    headings
        The table's headings.
    read
        The columns that are read.
    table
        The table, which knows what its columns may hold.
    times
        The columns whose headings are words for the samples' times.
    """
    fs_is_rate = any(compact(heading) == "fs" for heading in headings.written)
    clocks: list[OtherClock] = []
    rates: list[OtherRate] = []
    for column, heading in enumerate(headings.written):
        if column in read:
            continue
        beside, is_dated = headings.units.get(column), column in headings.dated
        period_ms = period_of_samples(heading, beside)
        hertz = hertz_of_rates(heading, beside, fs_is_rate=fs_is_rate)
        if (period_ms is not None or hertz is not None) and column not in table.wordless:
            sure = period_ms is not None or names_samples(heading)
            rates.append(OtherRate(column, heading, hertz or 1.0, period_ms, sure))
        elif (is_dated or may_be_times(heading)) and table.has_samples(column):
            may_count = column in times or names_trigger(heading)
            unit = DATES_IN if is_dated else unit_of_times(heading, beside)
            clocks.append(OtherClock(column, heading, None if unit is None else TIME_UNITS[unit], may_count))
    return OtherTimes(tuple(clocks), tuple(rates))
