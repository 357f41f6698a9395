"""One impact of a table: its rows, laid out by the mapping, into a record."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np

from headimpact.cut_offs import PAPER
from headimpact.quality import QualityNote, check_reported_resultant
from headimpact.recording import Mounting, Recording, Signal, SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.cells import said
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.file_names import NOT_NAMED, NamedFacts
from headimpact_service.ingest.formula_cells import unguarded, unguarded_name
from headimpact_service.ingest.impact_json import MAX_NAME, MAX_SAMPLES
from headimpact_service.ingest.impact_reading import low_pass, mounting
from headimpact_service.ingest.labels import (
    NOTHING_SAID,
    Reading,
    checked_name,
    context_of,
    moment,
    reading_of,
)
from headimpact_service.ingest.layout import Clock, SignalLayout
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.row_labels import RowLabels
from headimpact_service.ingest.samples import Samples
from headimpact_service.ingest.stamps import DRIFT, agree, before_zero_ms, follows
from headimpact_service.ingest.table import FloatArray
from headimpact_service.ingest.tracks import TimeBase, Track, time_bases
from headimpact_service.ingest.windows import Rows, numbers_of


@dataclass(frozen=True, slots=True)
class Plan:
    """How one table is read: its mapping, where that came from, and what the sender overrides."""

    mapping: Mapping
    preset: str | None
    required: frozenset[str]
    options: ImportOptions
    format: str
    named: NamedFacts = NOT_NAMED


class TableImpact:
    """One impact of a table."""

    def __init__(self, plan: Plan, samples: Samples, number: int) -> None:
        """Take an impact's rows; nothing is read yet."""
        self.plan, self.samples, self.layout = plan, samples, samples.layout
        self.mapping, self.options = plan.mapping, plan.options
        window = samples.window
        self.rows = window.impacts[number]
        first = self.rows.start if isinstance(self.rows, slice) else self.rows[0]  # of no rows, too
        self.row = window.first + first
        """Which row of the table is its first."""
        self.cell = first if window.columns.lengths is None else number
        alike = samples.are_alike(self.rows)
        self.labels = RowLabels(self.layout, samples.texts, self.rows, self.cell, self.row, alike)
        self.notes: list[QualityNote] = []

    def record(self) -> ImpactRecord:
        """The impact, with what the sender gave beside the file in place of what the file says."""
        options, named = self.options, self.plan.named
        self.labels.require_one_impact(options.time_zone)
        unscorable = self._text(self.layout.unscorable)
        recording = self._recording(scorable=unscorable is None)
        return ImpactRecord(
            recording=recording,
            external_id=self._name("external_id", self.layout.external_id) or named.external_id,
            athlete_external_id=options.athlete or self._name("athlete", self.layout.athlete),
            occurred_at=options.occurred_at or self._occurred_at() or named.occurred_at,
            device_serial=options.device or self._name("device", self.layout.device) or named.device,
            context=self._context(),
            metadata=self._metadata(),
            notes=tuple(self.notes),
            unscorable=() if unscorable is None else (unscorable,),
            left_out=tuple(
                (name, axis) for name, _ in recording.signals() for axis in self.layout.signals[name].left_out
            ),
            needs_device_mounting=self._location == "sensor" and recording.mounting is None,
        )

    def sent_name(self) -> str | None:
        """What the file calls the impact."""
        try:
            return self._name("external_id", self.layout.external_id) or self.plan.named.external_id
        except Problem:
            return None

    @cached_property
    def reading(self) -> Reading:
        """What the impact's rows say of how to read it."""
        return self._reading((field, self.labels.said(column)) for field, column in self.layout.reading.items())

    def _reading_at(self, cell: int) -> Reading:
        """The same of one part of an impact."""
        columns = self.layout.reading.items()
        return self._reading((field, said(self.samples.texts[column][cell])) for field, column in columns)

    def _reading(self, cells: Iterable[tuple[str, str]]) -> Reading:
        if not self.layout.reading:
            return NOTHING_SAID
        return reading_of(tuple((field, text) for field, text in cells if text))

    def _recording(self, *, scorable: bool) -> Recording:
        mapping, options, reading = self.mapping, self.options, self.reading
        fill_gaps = options.fill_gaps or reading.fill_gaps or bool(mapping.fill_gaps)
        self._require_counted(allow_gaps=fill_gaps)
        self._require_one_time()
        tracks = self._tracks()
        # The signals before the drop say when the record began, those after it when what is kept begins.
        kept = [self._without_first(track) for track in tracks]
        for whole, track in zip(tracks, kept, strict=True):
            self._require_times(whole)
            if scorable and not fill_gaps:
                self._require_samples(track)
        signals: dict[str, Any] = {
            track.name: self._signal(track, base) for track, base in zip(kept, time_bases(kept), strict=True)
        }
        chosen = reading.filter or mapping.filter
        return Recording(
            axes=options.axes or reading.axes or mapping.axes or "anatomical",
            mounting=self._mounting(),
            constrained_plane=reading.constrained_plane or mapping.constrained_plane,
            low_pass=options.low_pass or (PAPER if chosen is None else low_pass(chosen)),
            pre_trigger_ms=self._pre_trigger_ms(tracks, kept),
            fill_gaps=fill_gaps,
            **signals,
        )

    def _mounting(self) -> Mounting | None:
        """The mounting that the row or the layout brings; None where none is needed, or the device's is."""
        if self.reading.mounting is not None:
            if self.reading.location == "head_cg":
                detail = "A mounting is for signals of the sensor: the row says that they are the head's."
                raise file_fault(detail, "mounting-not-needed", parameter="location")
            return mounting(self.reading.mounting, "/mounting")
        if self._location != "sensor" or self.mapping.mounting is None:
            return None
        return mounting(self.mapping.mounting, "/mounting")

    @property
    def _location(self) -> str | None:
        """Where the signals were measured, as the row says or else the mapping."""
        return self.reading.location or self.mapping.location

    def _tracks(self) -> list[Track]:
        """The rows of each signal: all of the impact's, unless these are parted by time base."""
        if self.layout.time_base is None:
            whole = [self._track(name, self.rows, self.reading) for name in self._present()]
            self._note_end(whole)
            return whole
        tracks: list[Track] = []
        for rows in self._parts(self.layout.time_base):
            reading = self._reading_at(rows.start if isinstance(rows, slice) else rows[0])
            tracks += [
                self._track(name, rows, reading)
                for name, values in self.samples.signals.items()
                if not np.isnan(values[rows]).all()
            ]
        if len({track.name for track in tracks}) < len(tracks):
            raise file_fault("A signal's samples stand in one part of its impact only.", "time-base")
        if not tracks:
            raise file_fault("The impact has no samples.", "no-signal")
        return tracks

    def _note_end(self, tracks: list[Track]) -> None:
        """Say so where an array of impacts goes on behind the last sample of all signals of this one."""
        if not self.samples.has_ends:
            return
        count = len(numbers_of(self.rows))
        left_out = count - max(len(numbers_of(track.rows)) for track in tracks)
        if left_out > 0:
            detail = f"The last {left_out} of the impact's {count} rows hold no sample: its record ends before."
            self.notes.append(QualityNote("sample_count_mismatch", "note", detail))

    def _present(self) -> list[SignalName]:
        """The signals of the impact: one without any sample is not there."""
        signals = self.samples.signals
        if self.samples.is_whole:
            return list(signals)
        return [name for name, values in signals.items() if not np.isnan(values[self.rows]).all()] or list(signals)

    def _parts(self, column: int) -> Iterator[Rows]:
        """Rows of the impact that follow each other with one value in the column."""
        cells = self.samples.texts[column]
        if self.samples.window.columns.lengths is not None:
            yield self.rows
            return
        rows = numbers_of(self.rows)
        texts = cells[self.rows] if isinstance(self.rows, slice) else [cells[row] for row in rows]
        for _, run in groupby(zip(rows, texts, strict=True), key=lambda pair: pair[1].strip()):
            part = [row for row, _ in run]
            yield slice(part[0], part[-1] + 1) if part[-1] - part[0] + 1 == len(part) else part

    def _track(self, name: SignalName, rows: Rows, reading: Reading) -> Track:
        signal = self.layout.signals[name]
        clock = signal.clock or self.layout.clock
        if self.layout.ends_alone(name) or self.samples.has_ends:
            rows = self._until_empty(signal, None if signal.clock is None else signal.clock.column, rows)
        rate = self._said_rate(signal, reading)
        if clock is None or (rate is not None and self._stands_still(clock, rows)):
            return self._counted(Track(name, rows, rate or self.mapping.sample_rate_hz, None, 1.0))
        stamps = self._stamps(clock.column, rows)
        if rate is not None and (signal.clock is not None or not signal.is_apart):
            _require_on_time(stamps * clock.milliseconds, rate)
        return Track(name, rows, rate, stamps, clock.milliseconds)

    def _said_rate(self, signal: SignalLayout, reading: Reading) -> float | None:
        """The rate that the sender, the impact's row or the mapping says; 422 where they differ.

        A signal that has a rate of its own, and no times, does not go by those that the others share.
        """
        asked = self.mapping.sample_rate_hz if "sample_rate_hz" in self.plan.required else None
        beside, own = self.options.sample_rate_hz, signal.sample_rate_hz if signal.clock is None else None
        _require_one_rate([beside, own] if own else [beside, reading.sample_rate_hz, asked])
        return own or beside or reading.sample_rate_hz or signal.sample_rate_hz or asked

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
        key = (column, rows.start, rows.stop) if isinstance(rows, slice) else (column, rows[0], rows[-1])
        return self._kept_stamps.setdefault(key, self.samples.numbers[column][rows])

    @cached_property
    def _kept_stamps(self) -> dict[tuple[int, int, int], FloatArray]:
        return {}

    def _until_empty(self, signal: SignalLayout, clock: int | None, rows: Rows) -> Rows:
        """A signal's rows without those behind its end, which the columns of a longer one go on beside."""
        columns = signal.columns if clock is None else [clock, *signal.columns]
        there = np.logical_or.reduce([~np.isnan(self.samples.numbers[column][rows]) for column in columns])
        count = int(np.flatnonzero(there)[-1]) + 1 if there.any() else 0
        return slice(rows.start, rows.start + count) if isinstance(rows, slice) else rows[:count]

    def _require_counted(self, *, allow_gaps: bool) -> None:
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

    def _require_one_time(self) -> None:
        """Refuse two columns of times that say different things."""
        clock = self.layout.clock
        for other in self.layout.other_clocks:
            assert clock is not None
            one, two = (self.samples.numbers[found.column][self.rows] * found.milliseconds for found in (clock, other))
            if not agree(one, two):
                raise file_fault(
                    f"Columns {clock.column + 1} and {other.column + 1} both give the times and do not agree: say in a "
                    "mapping which to take.",
                    "times-differ",
                )

    def _require_times(self, track: Track) -> None:
        """Refuse a missing time."""
        clock = self.layout.signals[track.name].clock or self.layout.clock
        if clock is not None and track.rate is None:
            self._require_finite([clock.column], track)

    def _require_samples(self, track: Track) -> None:
        """Refuse a missing sample."""
        self._require_finite(self.layout.signals[track.name].columns, track)

    def _require_finite(self, columns: list[int], track: Track) -> None:
        self.samples.require_finite(columns, track.rows, self.row)

    def _without_first(self, track: Track) -> Track:
        """A track without the samples that the layout calls corrupt, which is noted once."""
        dropped = self.mapping.drop_rows or 0
        if not dropped:
            return track
        if not any(note.code == "edge_glitch" for note in self.notes):
            detail = f"The first {dropped} of the file's samples were left out, as its layout says."
            self.notes.append(QualityNote("edge_glitch", "note", detail))
        rows = track.rows
        kept: Rows = slice(rows.start + dropped, rows.stop) if isinstance(rows, slice) else rows[dropped:]
        stamps = None if track.stamps is None else track.stamps[dropped:]
        return Track(track.name, kept, track.rate, stamps, track.milliseconds)

    def _pre_trigger_ms(self, tracks: list[Track], kept: list[Track]) -> float | None:
        """The time before the trigger: as said for this impact or by the sender, by the stamps, or by the layout."""
        if "pre_trigger_ms" in self.layout.reading:  # an empty cell says that it is not known
            told = self.reading.pre_trigger_ms
            return self.mapping.pre_trigger_ms if told is None else told
        stated = self.mapping.pre_trigger_ms
        if stated is not None:
            stated = max(0.0, round(stated - self._dropped_ms(tracks, kept), 9))
        self._require_longer(kept, stated)
        spans = [span for track in kept if (span := track.span_ms) is not None]
        if not spans or "pre_trigger_ms" in self.plan.required or self.mapping.zero == "record_start":
            return stated
        before = before_zero_ms(spans)
        if before is None and self.mapping.zero == "trigger":
            if min(spans)[0] != 0.0:
                detail = "The record's times must include zero, which its layout says is the trigger."
                raise file_fault(detail, "time-zero")
            return 0.0
        return stated if before is None else before

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

    def _signal(self, track: Track, base: TimeBase) -> Signal:
        layout = self.layout.signals[track.name]
        # A copy, so that one impact that is kept does not keep the whole table.
        values = self.samples.signals[track.name][track.rows].copy()
        if values.shape[0] > MAX_SAMPLES:
            raise file_fault(f"An impact may have at most {MAX_SAMPLES} samples.", "sample-count")
        if layout.resultant is not None:
            reported = self.samples.numbers[layout.resultant][track.rows]
            self.notes += check_reported_resultant(track.name, layout.unit, reported, values)
        return Signal(values, layout.unit, *base, layout.full_scale)

    def _text(self, column: int | None) -> str | None:
        if column is None:
            return None
        text = self.labels.said(column)
        return (unguarded(text) if self.plan.format == "csv" else unguarded_name(text)) or None

    def _name(self, field: str, column: int | None) -> str | None:
        return checked_name(self._text(column), field)

    def _context(self) -> dict[str, Any]:
        cells = ((field, self._text(column)) for field, column in self.layout.context.items())
        texts = tuple((field, text) for field, text in cells if text is not None)
        return dict(context_of(texts)) if texts else {}

    def _occurred_at(self) -> datetime | None:
        columns = self.layout.occurred_at
        if not columns or self.options.occurred_at is not None:
            return None
        return moment([self._text(column) for column in columns], self.options.time_zone)

    def _metadata(self) -> dict[str, Any]:
        told = {"format": self.plan.format, "preset": self.plan.preset, "file": self.options.filename}
        keys = [self._text(column) for column in self.layout.keys if column != self.layout.external_id]
        return {name: value for name, value in told.items() if value is not None} | self._told_apart(keys)

    def _told_apart(self, keys: list[str | None]) -> dict[str, Any]:
        """What the file itself calls the impact, where that is no name outside it."""
        known = [key for key in keys if key is not None]
        return {"impact": " ".join(known)[:MAX_NAME]} if known else {}


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


def _require_on_time(stamps_ms: FloatArray, rate: float) -> None:
    """Refuse times that are not those of a rate."""
    if not follows(stamps_ms[np.isfinite(stamps_ms)], rate):
        raise file_fault(
            f"The impact's times do not go on at {rate:g} samples per second: they leave out samples, begin anew or "
            "are of another rate. Leave out the rate or, if the times are wrong, the times (time: null in a mapping).",
            "rate-differs",
            parameter="sample_rate_hz",
        )
