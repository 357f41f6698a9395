"""One impact of a table: its rows, laid out by the mapping, into a record."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np

from headimpact.cut_offs import PAPER
from headimpact.quality import QualityNote, check_reported_peak, check_reported_resultant
from headimpact.recording import Mounting, Recording, Signal, SignalName
from headimpact_service.ingest.cells import said
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.impact_facts import ImpactFacts
from headimpact_service.ingest.impact_json import MAX_SAMPLES
from headimpact_service.ingest.impact_reading import low_pass, mounting
from headimpact_service.ingest.impact_times import ImpactTimes
from headimpact_service.ingest.labels import (
    NOTHING_SAID,
    Reading,
    reading_of,
    says_rate,
)
from headimpact_service.ingest.plan import Plan
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.row_labels import RowLabels
from headimpact_service.ingest.samples import Samples
from headimpact_service.ingest.supplied import peak_said
from headimpact_service.ingest.table import FloatArray
from headimpact_service.ingest.tracks import TimeBase, Track, time_bases
from headimpact_service.ingest.windows import Rows, numbers_of


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
        self.facts = ImpactFacts(plan, self.layout, self.labels, parted=window.columns.lengths is not None)
        self.times = ImpactTimes(plan, samples, self.rows, self.row)
        self.notes: list[QualityNote] = list(samples.layout.notes)

    def record(self) -> ImpactRecord:
        """The impact, with what the sender gave beside the file in place of what the file says."""
        self.labels.require_one_impact(self.options.time_zone)
        self.facts.require_conventions()
        unscorable = self.facts.unscorable
        recording = self._recording(scorable=unscorable is None)
        athlete_id, athlete = self.facts.athlete()
        return ImpactRecord(
            recording=recording,
            external_id=self.facts.external_id(),
            athlete_id=athlete_id,
            athlete_external_id=athlete,
            occurred_at=self.facts.occurred_at(),
            device_serial=self.facts.device(),
            context=self.facts.context(),
            metadata=self.facts.metadata(),
            notes=tuple(self.notes),
            unscorable=() if unscorable is None else (unscorable,),
            left_out=tuple(
                (name, axis) for name, _ in recording.signals() for axis in self.layout.signals[name].left_out
            ),
            needs_device_mounting=self._location == "sensor" and recording.mounting is None,
        )

    @cached_property
    def reading(self) -> Reading:
        """What the impact's rows say of how to read it."""
        return self._reading([(field, self.labels.said(column)) for field, column in self.layout.reading.items()])

    def _reading_at(self, cell: int) -> Reading:
        """The same of one part of an impact."""
        columns = self.layout.reading.items()
        return self._reading([(field, said(self.samples.texts[column][cell])) for field, column in columns])

    def _reading(self, cells: Sequence[tuple[str, str]]) -> Reading:
        """What cells say; a rate beside the file stands in the place of one that is none."""
        given = self.options.sample_rate_hz is not None
        told = tuple(
            (field, text)
            for field, text in cells
            if text and not (given and field == "sample_rate_hz" and not says_rate(text))
        )
        return reading_of(told) if told else NOTHING_SAID

    def _recording(self, *, scorable: bool) -> Recording:
        mapping, options, reading = self.mapping, self.options, self.reading
        fill_gaps = options.fill_gaps or reading.fill_gaps or bool(mapping.fill_gaps)
        self.times.require_counted(allow_gaps=fill_gaps)
        self.notes += self.times.other_origins()
        tracks = self._tracks(fill_gaps=fill_gaps)
        for track in tracks:
            self.times.require_going_on(track, self.labels.parting)
        self.times.require_no_other(tracks, self.labels)
        # The signals before the drop say when the record began, those after it when what is kept begins.
        kept = [self._without_first(track) for track in tracks]
        for whole, track in zip(tracks, kept, strict=True):
            self.times.require_times(whole)
            if scorable and not fill_gaps:
                self.samples.require_finite(self.layout.signals[track.name].columns, track.rows, self.row)
        bases = time_bases(kept)
        signals: dict[str, Any] = {
            track.name: self._signal(track, base) for track, base in zip(kept, bases, strict=True)
        }
        pre_trigger_ms = self.times.pre_trigger_ms(tracks, kept, reading)
        if all(stamps is None for _, stamps in bases):  # else they are held against it as any stamps are
            self.notes += self.times.other_trigger(kept, pre_trigger_ms)
        chosen = reading.filter or mapping.filter
        return Recording(
            axes=options.axes or reading.axes or mapping.axes or "anatomical",
            mounting=self._mounting(),
            constrained_plane=reading.constrained_plane or mapping.constrained_plane,
            low_pass=options.low_pass or (PAPER if chosen is None else low_pass(chosen)),
            pre_trigger_ms=pre_trigger_ms,
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

    def _tracks(self, *, fill_gaps: bool) -> list[Track]:
        """The rows of each signal: all of the impact's, unless these are parted by time base."""
        if self.layout.time_base is None:
            whole = [self.times.track(name, self.rows, self.reading, fill_gaps=fill_gaps) for name in self._present()]
            self._note_end(whole)
            return whole
        tracks: list[Track] = []
        for rows in self._parts(self.layout.time_base):
            reading = self._reading_at(rows.start if isinstance(rows, slice) else rows[0])
            tracks += [
                self.times.track(name, rows, reading, fill_gaps=fill_gaps)
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
        return replace(track, rows=kept, stamps=stamps)

    def _signal(self, track: Track, base: TimeBase) -> Signal:
        layout = self.layout.signals[track.name]
        # A copy, so that one impact that is kept does not keep the whole table.
        values = self.samples.signals[track.name][track.rows].copy()
        if values.shape[0] > MAX_SAMPLES:
            raise file_fault(f"An impact may have at most {MAX_SAMPLES} samples.", "sample-count")
        self._compare(track, values)
        return Signal(values, layout.unit, *base, layout.full_scale)

    def _compare(self, track: Track, values: FloatArray) -> None:
        """The device's own resultants and peaks against those of its samples."""
        layout = self.layout.signals[track.name]
        for one in layout.resultants:
            reported = self.samples.numbers[one.column][track.rows] * one.factor
            reported[np.isinf(reported)] = np.nan  # a cell that is no number
            self.notes += check_reported_resultant(track.name, layout.unit, reported, values)
        for one in layout.peaks:
            peak = peak_said(self.labels.all_said(one.column))
            if peak is not None:
                self.notes += check_reported_peak(track.name, layout.unit, peak * one.factor, values)
