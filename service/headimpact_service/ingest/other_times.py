"""Columns beside those that are read whose headings speak of times or of rates: the signals must not gainsay them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass

from headimpact_service.ingest.cells import number_said
from headimpact_service.ingest.headings import Headings
from headimpact_service.ingest.mapping import DATES_IN, TIME_UNITS
from headimpact_service.ingest.spelling import compact
from headimpact_service.ingest.time_headings import hertz_of_rates, may_be_times, unit_of_times


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
    """A column of samples per second, or of so many, that no signal is read by."""

    column: int
    heading: str
    hertz: float


@dataclass(frozen=True, slots=True)
class OtherTimes:
    """The columns of times and of rates that are not read."""

    clocks: tuple[OtherClock, ...] = ()
    rates: tuple[OtherRate, ...] = ()
    stated: tuple[tuple[str, float], ...] = ()
    """What rows above the headings are called that state a sample rate, and the rate [Hz]."""


NO_OTHERS = OtherTimes()


def stated_above(rows: Sequence[Sequence[str]]) -> Iterator[tuple[str, float]]:
    """The sample rates that rows above the headings state: a name, and a number in the cell behind it."""
    for row in rows:
        name, *cells = [cell.strip() for cell in row] or [""]
        hertz = hertz_of_rates(name, None, fs_is_rate=True)
        said = next((number for cell in cells if (number := number_said(cell)) is not None), None)
        if hertz is not None and said is not None:
            yield name, said * hertz


def other_times(
    headings: Headings, read: Collection[int], has_samples: Callable[[int], bool], times: Collection[int]
) -> OtherTimes:
    """The columns of times and of rates beside those that are read.

    Parameters
    ----------
    headings
        The table's headings.
    read
        The columns that are read.
    has_samples
        Whether a column may hold a number for each sample.
    times
        The columns whose headings are words for the samples' times.
    """
    fs_is_rate = any(compact(heading) == "fs" for heading in headings.written)
    clocks: list[OtherClock] = []
    rates: list[OtherRate] = []
    for column, heading in enumerate(headings.written):
        if column in read:
            continue
        is_dated = column in headings.dated
        if (is_dated or may_be_times(heading)) and has_samples(column):
            unit = DATES_IN if is_dated else unit_of_times(heading, headings.units.get(column))
            clocks.append(OtherClock(column, heading, None if unit is None else TIME_UNITS[unit], column in times))
        elif (hertz := hertz_of_rates(heading, headings.units.get(column), fs_is_rate=fs_is_rate)) is not None:
            rates.append(OtherRate(column, heading, hertz))
    return OtherTimes(tuple(clocks), tuple(rates))
