"""When the samples of one impact of a table were taken: by the rates and the stamps that say so."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property

import numpy as np

from headimpact.quality import QualityNote, words
from headimpact.recording import SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.cells import number_said
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.labels import Reading
from headimpact_service.ingest.layout import Clock, SignalLayout
from headimpact_service.ingest.mapping import TIME_UNITS
from headimpact_service.ingest.plan import Plan
from headimpact_service.ingest.row_labels import RowLabels
from headimpact_service.ingest.samples import Samples
from headimpact_service.ingest.stamps import DRIFT, agree, before_zero_ms, follows, go_on_alike, rounded_to, with_gaps
from headimpact_service.ingest.table import FloatArray
from headimpact_service.ingest.time_headings import LEAST_HZ
from headimpact_service.ingest.tracks import Track
from headimpact_service.ingest.windows import Rows, numbers_of

OTHER_CLOCK = 0.02
"""Relative: how far the rate of times that are not read may be from a signal's, being another clock's."""
MIN_STAMPS = 3
MOST_ROUNDING = 0.1
"""Of a rate: times that are rounded by more say none."""


class ImpactTimes:
    """The times of one impact."""

    def __init__(self, plan: Plan, samples: Samples, rows: Rows, row: int) -> None:
        """Take the impact's rows, of which the first is `row` of the table; nothing is read yet."""
        self.plan, self.mapping, self.options = plan, plan.mapping, plan.options
        self.samples, self.layout, self.rows, self.row = samples, samples.layout, rows, row
        self._kept_stamps: dict[tuple[int, ...], FloatArray] = {}

    def track(self, name: SignalName, rows: Rows, reading: Reading, *, fill_gaps: bool) -> Track:
        """A signal's rows with the rate or the stamps that count for them; with gaps if these are to be filled."""
        signal = self.layout.signals[name]
        clock = signal.clock or self.clock
        if self.layout.ends_alone(name) or self.samples.has_ends:
            rows = self._until_empty(signal, None if signal.clock is None else signal.clock.column, rows)
        rate = self._said_rate(name, signal, reading)
        if clock is None or (rate is not None and self._stands_still(clock, rows)):
            return self._counted(Track(name, rows, rate or self.mapping.sample_rate_hz, None, 1.0))
        stamps = self._stamps(clock.column, rows)
        if rate is not None and (signal.clock is not None or not signal.is_apart):
            stamps_ms = stamps * clock.milliseconds
            if not follows(_there(stamps_ms), rate):
                placed = with_gaps(stamps_ms, rate) if fill_gaps else None
                if placed is None:
                    raise _off_time(rate)
                return Track(name, rows, None, placed, 1.0, clock.dated)
        return Track(name, rows, rate, stamps, clock.milliseconds, clock.dated)

    def _said_rate(self, name: SignalName, signal: SignalLayout, reading: Reading) -> float | None:
        """The rate that the sender, the impact's row or the mapping says; 422 where they differ.

        A signal that has a rate of its own, and no times, does not go by those that the others share.
        """
        asked = self.mapping.sample_rate_hz if "sample_rate_hz" in self.plan.required else None
        beside, own = self.options.sample_rate_hz, signal.sample_rate_hz if signal.clock is None else None
        if own and self._is_of_the_others(name):
            return own
        _require_one_rate([beside, own] if own else [beside, reading.sample_rate_hz, asked])
        return own or beside or reading.sample_rate_hz or signal.sample_rate_hz or asked

    def _is_of_the_others(self, name: SignalName) -> bool:
        """Whether a rate beside the file is that of other signals: the sender's mapping names this one's."""
        sent = None if self.options.mapping is None else self.options.mapping.columns_of(name)
        others = (one for other, one in self.layout.signals.items() if other != name)
        return sent is not None and sent.sample_rate_hz is not None and any(not one.is_apart for one in others)

    def _stands_still(self, clock: Clock, rows: Rows) -> bool:
        """Whether a column of times says when the impact was, and not its samples."""
        stamps = self._stamps(clock.column, rows)
        return stamps.size > 1 and bool((stamps == stamps[0]).all())

    def _counted(self, track: Track) -> Track:
        """A track of a rate, on stamps where the file's own numbers leave out samples."""
        column = self.layout.sample_number
        if column is None or track.rate is None or (np.diff(self.samples.numbers[column][track.rows]) == 1).all():
            return track
        return Track(track.name, track.rows, None, self._stamps(column, track.rows), 1000.0 / track.rate)

    def _stamps(self, column: int, rows: Rows) -> FloatArray:
        """The stamps of rows; signals that share both share the array."""
        ends = (rows.start, rows.stop) if isinstance(rows, slice) else (*rows[:1], *rows[-1:])
        key = (column, *ends)
        return self._kept_stamps.setdefault(key, self.samples.numbers[column][rows])

    def _until_empty(self, signal: SignalLayout, clock: int | None, rows: Rows) -> Rows:
        """A signal's rows without those behind its end, which the columns of a longer one go on beside."""
        columns = signal.columns if clock is None else [clock, *signal.columns]
        there = np.logical_or.reduce([~np.isnan(self.samples.numbers[column][rows]) for column in columns])
        count = int(np.flatnonzero(there)[-1]) + 1 if there.any() else 0
        return slice(rows.start, rows.start + count) if isinstance(rows, slice) else rows[:count]

    def require_counted(self, *, allow_gaps: bool) -> None:
        """Refuse samples that the file's own numbers say are out of order, or missing unless gaps are to be filled."""
        column = self.layout.sample_number
        if column is None:
            return
        numbers = self.samples.numbers[column][self.rows]
        self.samples.require_finite([column], self.rows, self.row)
        steps = np.diff(numbers)
        stray = np.flatnonzero(steps <= 0 if allow_gaps else steps != 1)
        if stray.size:
            before, after = numbers[stray[0] : stray[0] + 2].tolist()
            raise file_fault(
                f"Sample {after:g} follows sample {before:g} in the impact that begins in row "
                f"{self.row + 1} below the headings: some are missing or out of order.",
                "sample-order",
            )

    @cached_property
    def clock(self) -> Clock | None:
        """The column of times that the signals share: of several one that counts from the trigger, else the first."""
        first = self.layout.clock
        return next(filter(self._has_trigger, self._clocks), first) if len(self._clocks) > 1 else first

    @cached_property
    def _clocks(self) -> list[Clock]:
        """The columns of times that the signals may share: also one of another name that counts from the trigger."""
        first = self.layout.clock
        if first is None:
            return []
        others = [
            Clock(one.column, one.milliseconds)
            for one in self.layout.others.clocks
            if one.may_count and one.milliseconds is not None
        ]
        alike = [one for one in others if go_on_alike(self._times_ms(first), self._times_ms(one))]
        return [*self.layout.clocks, *filter(self._has_trigger, alike)]

    def other_origins(self) -> Iterator[QualityNote]:
        """A note on columns of times that go on alike from another origin; 422 where they contradict each other.

        Times from the record's start, or from any other instant, say nothing against those from the trigger.
        """
        if self.clock is None:
            return
        for other in self._clocks:
            if other is self.clock:
                continue
            one, two = self._times_ms(self.clock), self._times_ms(other)
            if not agree(one, two):
                columns = f"Columns {self.clock.column + 1} and {other.column + 1}"
                if not go_on_alike(one, two):
                    raise _contradiction(f"{columns} both give the times and do not agree")
                apart = f"{columns} go on alike from {_origin(self.clock, one)} and from {_origin(other, two)}"
                if self.mapping.zero == "trigger" or self._has_trigger(other):
                    raise _contradiction(f"{apart}, so that the trigger is not clear")
                yield QualityNote("time_origin_mismatch", "note", f"{apart}: column {self.clock.column + 1} was read.")

    def _times_ms(self, clock: Clock) -> FloatArray:
        with np.errstate(over="ignore", invalid="ignore"):  # numbers that are beyond all times
            return self.samples.numbers[clock.column][self.rows] * clock.milliseconds

    def _has_trigger(self, clock: Clock) -> bool:
        """Whether a column of times goes from below zero to zero or above."""
        there = _there(self._times_ms(clock))
        return not clock.dated and there.size > 0 and before_zero_ms([(there[0], there[-1])]) is not None

    def require_no_other(self, tracks: list[Track], labels: RowLabels) -> None:
        """Refuse times and rates beside those that are read at which no signal is: one signal's may be among them."""
        rates = [rate for track in tracks if (rate := track.samples_per_s) is not None]
        for other_rate in self.layout.others.rates:
            distinct = labels.all_said(other_rate.column)  # a rate is the same in all rows
            said = number_said(distinct[0]) if len(distinct) == 1 else None
            if said is None or (not other_rate.sure and other_rate.rate_of(said) < LEAST_HZ):
                continue
            if not _is_among(other_rate.rate_of(said), rates, OTHER_CLOCK):
                raise _other(other_rate.heading, other_rate.rate_of(said))
        for name, stated in self.layout.others.stated:
            if not _is_among(stated, rates, OTHER_CLOCK):
                raise _other(name, stated, what="line")
        for other in self.layout.others.clocks:
            self._require_among(other.column, other.milliseconds, other.heading, rates)
        shared = self.clock
        if shared is not None and all(signal.is_apart for signal in self.layout.signals.values()):
            self._require_among(shared.column, shared.milliseconds, "of the shared times", rates)

    def _require_among(self, column: int, milliseconds: float | None, heading: str, rates: list[float]) -> None:
        """Refuse times of a rate that no signal has; what does not go on from row to row is no time of samples.

        Times in no known unit may be in any, and what counts the rows one by one is none.
        """
        stamps = _there(self.samples.numbers[column][self.rows])
        steps = np.diff(stamps)
        if stamps.size < MIN_STAMPS or not (steps > 0.0).all() or (milliseconds is None and (steps == 1.0).all()):
            return
        units = TIME_UNITS.values() if milliseconds is None else [milliseconds]
        with np.errstate(over="ignore", invalid="ignore"):  # numbers that are beyond all times
            said = [_rate_and_rounding(stamps * unit) for unit in units]
        if not any(_is_among(rate, rates, OTHER_CLOCK + rounding) for rate, rounding in said):
            raise _other(heading, said[0][0])

    def require_going_on(self, track: Track, parting: Callable[[], str]) -> None:
        """Refuse times that begin anew: the rows are of several impacts; `parting` says what may tell them apart."""
        stamps = track.stamps
        if stamps is None or track.rate is not None or self.samples.window.columns.lengths is not None:
            return
        with np.errstate(invalid="ignore"):  # from infinite to infinite
            steps = np.diff(stamps)
        falls = np.flatnonzero((steps < 0) & np.isfinite(steps))
        if falls.size and stamps[falls[0] + 1] <= stamps[0] + np.nanmedian(np.abs(steps)):
            raise file_fault(
                f"The times of the {words(track.name)} begin anew at sample {falls[0] + 1} of the impact that begins "
                f"in row {self.row + 1} below the headings: if they are several impacts, tell them apart by a column "
                f"impact_id or a mapping's group_by{parting()}.",
                "several-impacts",
            )

    def require_times(self, track: Track) -> None:
        """Refuse a missing time."""
        clock = self.layout.signals[track.name].clock or self.clock
        if clock is not None and track.rate is None:
            needed = "a time with its date" if clock.dated else "a finite number"
            self.samples.require_finite([clock.column], track.rows, self.row, needed)

    def pre_trigger_ms(self, tracks: list[Track], kept: list[Track], reading: Reading) -> float | None:
        """The time before the trigger: as said for this impact or by the sender, by the stamps, or by the layout."""
        if "pre_trigger_ms" in self.layout.reading:  # an empty cell says that it is not known
            told = reading.pre_trigger_ms
            return self.mapping.pre_trigger_ms if told is None else told
        stated = self.mapping.pre_trigger_ms
        if stated is not None:
            stated = max(0.0, round(stated - self._dropped_ms(tracks, kept), 9))
        self._require_longer(kept, stated)
        spans = [span for track in kept if (span := track.from_zero_ms) is not None]
        if not spans or "pre_trigger_ms" in self.plan.required or self.mapping.zero == "record_start":
            return stated
        before = before_zero_ms(spans)
        if before is None and self.mapping.zero == "trigger":
            if min(spans)[0] != 0.0:
                detail = "The record's times must include zero, which its layout says is the trigger."
                raise file_fault(detail, "time-zero")
            return 0.0
        return stated if before is None else before

    def other_trigger(self, tracks: list[Track], said_ms: float | None) -> Iterator[QualityNote]:
        """A note on times that go through zero at another time than the trigger is said to be."""
        spans = [span for track in tracks if (span := track.from_zero_ms) is not None]
        before_ms = before_zero_ms(spans) if spans and self.mapping.zero != "record_start" else None
        steps = [1000.0 / rate for track in tracks if (rate := track.samples_per_s)]
        if said_ms is not None and before_ms is not None and abs(said_ms - before_ms) > max(steps, default=0.0):
            detail = (
                f"The times begin {before_ms:g} ms before zero, and the trigger is said to be {said_ms:g} ms after "
                "the first sample, which was taken."
            )
            yield QualityNote("time_origin_mismatch", "note", detail)

    def _require_longer(self, tracks: list[Track], before_ms: float | None) -> None:
        """Refuse a record that is over before its trigger: it is not of this layout."""
        lengths = [1000.0 * len(numbers_of(track.rows)) / track.rate for track in tracks if track.rate is not None]
        if before_ms is not None and lengths and len(lengths) == len(tracks) and max(lengths) < before_ms:
            raise file_fault(
                f"The record of {max(lengths):g} ms is over before its trigger, which its layout puts at "
                f"{before_ms:g} ms.",
                "time-zero",
            )

    def _dropped_ms(self, tracks: list[Track], kept: list[Track]) -> float:
        """How much later than the file's record the one that is kept begins."""
        if not self.mapping.drop_rows:
            return 0.0
        before, after = ([span[0] for t in of if (span := t.span_ms) is not None] for of in (tracks, kept))
        if before and after:
            return min(after) - min(before)
        return min((1000.0 * self.mapping.drop_rows / track.rate for track in kept if track.rate), default=0.0)


def _rate_and_rounding(stamps_ms: FloatArray) -> tuple[float, float]:
    """Samples per second of times on average, and how far their rounding may take it off, relative; less than all."""
    span = float(stamps_ms[-1] - stamps_ms[0])
    return 1000.0 * (stamps_ms.size - 1) / span, min(rounded_to(stamps_ms) / span, MOST_ROUNDING)


def _is_among(said: float, rates: list[float], apart: float) -> bool:
    return any(abs(said - rate) <= apart * rate for rate in rates)


def _other(heading: str, rate: float, what: str = "column") -> Problem:
    return file_fault(
        f"The {what} {heading} says {rate:.5g} samples per second, at which no signal is read. If it is one sensor's, "
        "say so in a mapping: each sensor's times, as "
        '{"linear_acceleration": {"time": {"column": ..., "unit": ...}}, "angular_velocity": {"time": {"column": ..., '
        '"unit": ...}}}, or that one\'s rate, as {"angular_velocity": {"sample_rate_hz": ...}}. If it is of something '
        'else, name the times that count in the mapping, as {"time": {"column": ..., "unit": ...}}, or say '
        '{"time": null} in it where a rate counts.',
        "rate-differs",
        parameter="sample_rate_hz",
    )


def _there(stamps: FloatArray) -> FloatArray:
    return stamps[np.isfinite(stamps)]


def _origin(clock: Clock, times_ms: FloatArray) -> str:
    """Where a column of times begins, for people."""
    return "a date" if clock.dated else f"{_there(times_ms)[0]:g} ms"


def _contradiction(what: str) -> Problem:
    return file_fault(f"{what}: say in a mapping which to take.", "times-differ")


def _require_one_rate(said: Iterable[float | None]) -> None:
    """Refuse rates of one signal that differ by more than what clocks drift."""
    given = [rate for rate in said if rate is not None]
    if given and max(given) - min(given) > DRIFT * min(given):
        raise file_fault(
            f"The impact is said to have {min(given):g} samples per second and {max(given):g}: leave out the rate that "
            "is wrong.",
            "rate-differs",
            parameter="sample_rate_hz",
        )


def _off_time(rate: float) -> Problem:
    """The 422 for times that are not those of a rate."""
    return file_fault(
        f"The impact's times do not go on at {rate:g} samples per second: they leave out samples, begin anew or "
        "are of another rate. Leave out the rate or, if the times are wrong, the times (time: null in a mapping).",
        "rate-differs",
        parameter="sample_rate_hz",
    )
