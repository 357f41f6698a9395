"""Channels with ISO codes into impacts: one for each head that has any, whatever file format they came in."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from headimpact.cut_offs import PAPER
from headimpact.quality import QualityNote, check_reported_resultant, words
from headimpact.recording import AXES, SIGNALS, TO_CRITERIA_UNIT, SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.curves import Curve, check_cut, check_twice, head_recording
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.filling import how_filled
from headimpact_service.ingest.impact_reading import low_pass
from headimpact_service.ingest.iso_codes import RESULTANT, HeadCode
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.overrides import with_options
from headimpact_service.ingest.presets import preset_named
from headimpact_service.ingest.record import ImpactRecord


@dataclass(frozen=True, slots=True)
class HeadChannel:
    """One channel of a head.

    `invalid` says why its laboratory does not let its data stand, `doubt` why it has doubts, `filtering` what was
    filtered before, `points` how many samples it should have; `read` gives them.
    """

    code: HeadCode
    named: str
    read: Callable[[], Curve]
    filtering: str
    invalid: str | None = None
    doubt: str | None = None
    points: float | None = None


def head_impacts(
    channels: Sequence[HeadChannel],
    options: ImportOptions,
    *,
    preset: str,
    metadata: dict[str, Any],
    notes: Sequence[QualityNote] = (),
    trigger_known: bool = True,
) -> Iterator[ImpactRecord | Problem]:
    """The impacts of one test, by test object and position."""
    for head in sorted({channel.code.head for channel in channels}):
        mine = [channel for channel in channels if channel.code.head == head]
        reading = _Head(mine, options, preset, trigger_known=trigger_known)
        try:
            yield with_options(reading.record(metadata | _place(head), notes), options)
        except Problem as problem:
            yield problem


def _place(head: str) -> dict[str, str]:
    return {"test_object": head[0], "position": head[1]}


class _Head:
    """One head's channels."""

    def __init__(
        self, channels: Sequence[HeadChannel], options: ImportOptions, preset: str, *, trigger_known: bool
    ) -> None:
        self.channels, self.options, self.preset, self.trigger_known = channels, options, preset, trigger_known
        self.notes: list[QualityNote] = []
        self.reasons: list[str] = []
        self.used: list[HeadChannel] = []

    def record(self, metadata: dict[str, Any], notes: Sequence[QualityNote]) -> ImpactRecord:
        """The head's record; with no signal that has its three axes, one that must not be scored."""
        found = {name: curves for name in SIGNALS if (curves := self._curves(name))}
        if not found:
            raise file_fault("The head has a resultant only: its three axes are needed.", "no-signal")
        whole = {name: curves for name, curves in found.items() if len(curves) == len(AXES)}
        for name in found:
            if name not in whole:
                self._say_incomplete(name, found[name], alone=not whole)
        mapping = preset_named(self.preset).mapping
        recording = head_recording(
            whole or found,
            axes=mapping.axes or "sae_j211",
            low_pass=PAPER if mapping.filter is None else low_pass(mapping.filter),
            trigger_known=self.trigger_known,
            fill_gaps=self.options.fill_gaps,
        )
        for name, signal in recording.signals():
            self.notes += check_cut(name, found[name], signal.values)
            self._require_whole(name, found[name])
            self._compare_resultant(name, signal.unit, signal.values)
        return ImpactRecord(
            recording=recording,
            metadata=metadata | self._used(),
            notes=(*notes, *self.notes),
            unscorable=tuple(self.reasons),
        )

    def _curves(self, signal: SignalName) -> list[Curve]:
        """The signal's curves, one an axis, as far as they are there."""
        curves = []
        for channel in self._chosen(signal):
            curve = channel.read()
            self.used.append(channel)
            curves.append(curve)
            self._say_status(channel, curve)
            self._say_twice(channel, curve)
        return curves

    def _say_twice(self, read: HeadChannel, curve: Curve) -> None:
        """Whether the head has another channel that by its code is the same, and is not: the same filter and state."""
        for other in self.channels:
            if other is not read and _sameness(other) == _sameness(read):
                with suppress(Problem):  # what cannot be read contradicts nothing
                    self.notes += check_twice(read.code.signal, (read.named, curve), (other.named, other.read()))

    def _say_status(self, channel: HeadChannel, curve: Curve) -> None:
        """What its laboratory says of a channel, and whether it is as long as it should be."""
        if channel.invalid is not None:
            self.reasons.append(f"Its laboratory marked {channel.named} as not valid ({channel.invalid}).")
        if channel.doubt is not None:
            self._note("questionable_data", f"Its laboratory says of {channel.named}: {channel.doubt}.", channel)
        if channel.points is not None and channel.points != curve.values.size:
            detail = f"{channel.named} has {curve.values.size} samples where its header says {channel.points:g}."
            self._note("sample_count_mismatch", detail, channel)

    def _chosen(self, signal: SignalName) -> list[HeadChannel]:
        """One channel an axis: of one filter and place where one has all three, the weakest; a valid one before others.

        What is said to be at the centre of gravity goes before what is only said to be the head's.
        """
        mine = [c for c in self.channels if c.code.signal == signal and c.code.axis != RESULTANT]
        axes_of: dict[tuple[int, bool], set[str]] = {}
        for channel in mine:
            axes_of.setdefault(_kind(channel), set()).add(channel.code.axis)
        best: dict[str, HeadChannel] = {}
        for channel in sorted(mine, key=lambda c: (len(axes_of[_kind(c)]) < 3, _rank(c))):
            best.setdefault(channel.code.axis, channel)
        return [best[axis] for axis in AXES if axis in best]

    def _say_incomplete(self, signal: SignalName, curves: Sequence[Curve], *, alone: bool) -> None:
        present = ", ".join(curve.axis for curve in curves)
        absent = ", ".join(axis for axis in AXES if axis not in {curve.axis for curve in curves})
        detail = f"The head's {words(signal)} has {present} but not {absent}"
        if alone:
            self.reasons.append(f"{detail}: no signal has its three axes.")
        else:
            self.notes.append(QualityNote("channel_missing", "warning", f"{detail}: it was left out.", signal))

    def _require_whole(self, signal: SignalName, curves: Sequence[Curve]) -> None:
        """Refuse a sample that the laboratory has no value for, where the record is to be scored and as it is."""
        if self.options.fill_gaps or self.reasons:
            return
        for curve in curves:
            missing = np.flatnonzero(np.isnan(curve.values))
            if missing.size:
                helps = how_filled(curve.values, int(missing[0]))
                detail = f"The {words(signal)} {curve.axis} has no value at sample {missing[0]}{helps}."
                raise file_fault(detail, "missing-sample")

    def _compare_resultant(self, signal: SignalName, unit: str, values: np.ndarray[Any, np.dtype[np.float64]]) -> None:
        """The resultants that the file supplies and lets stand, of axes filtered as they are, against the samples'."""
        strengths = {channel.code.strength for channel in self.used if channel.code.signal == signal}
        for channel in self.channels:
            of_signal = channel.code.signal == signal and channel.code.axis == RESULTANT
            if not of_signal or channel.invalid is not None or strengths != {channel.code.strength}:
                continue
            curve = channel.read()
            if curve.values.size == values.shape[0]:
                reported = curve.values * (TO_CRITERIA_UNIT[curve.unit] / TO_CRITERIA_UNIT[unit])
                self.notes += check_reported_resultant(signal, unit, reported, values)

    def _note(self, code: str, detail: str, channel: HeadChannel) -> None:
        self.notes.append(QualityNote(code, "warning", detail, channel.code.signal, channel.code.axis))

    def _used(self) -> dict[str, Any]:
        names = {f"{c.code.signal}_{c.code.axis}": c.code.code for c in self.used}
        filters = {f"{c.code.signal}_{c.code.axis}": c.filtering for c in self.used}
        return {"channels": names, "filtered_before": filters}


def _sameness(channel: HeadChannel) -> tuple[SignalName, str, int, bool]:
    return channel.code.signal, channel.code.axis, channel.code.strength, channel.invalid is not None


def _kind(channel: HeadChannel) -> tuple[int, bool]:
    """Its filter, the weakest first, and its place, the one that is said outright first."""
    return channel.code.strength, not channel.code.is_explicit


def _rank(channel: HeadChannel) -> tuple[bool, tuple[int, bool], str]:
    return channel.invalid is not None, _kind(channel), channel.code.code
