"""NHTSA crash tests: a zip of curves (``.001``, ``.002``, …) and the EV5 file that says what they are."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from headimpact.cut_offs import PAPER
from headimpact.quality import QualityNote, check_reported_resultant
from headimpact.recording import AXES, SIGNALS, SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.curves import Curve, check_cut, check_twice, head_recording
from headimpact_service.ingest.file_faults import file_fault, unit_unknown
from headimpact_service.ingest.impact_json import MAX_SAMPLES
from headimpact_service.ingest.impact_reading import low_pass
from headimpact_service.ingest.nhtsa_header import (
    DOUBTFUL,
    INVALID,
    RESULTANT,
    SOUND,
    Channel,
    CrashTest,
    Occupant,
    read_header,
)
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.overrides import with_options
from headimpact_service.ingest.presets import preset_named
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.stamps import DRIFT, nominal_rate
from headimpact_service.ingest.table import FloatArray
from headimpact_service.ingest.zip_guard import GuardedZip

PRESET = "nhtsa"
_CURVE = re.compile(r"\.([0-9]{3,4})$")
_NUMBERS = re.compile(rb"[0-9eE+.\s-]*")
MAX_CURVE = 4 * 1024 * 1024


def is_nhtsa(names: list[str]) -> bool:
    """Whether an archive's files are those of a crash test."""
    return any(name.lower().endswith(".ev5") for name in names)


def read_nhtsa(archive: GuardedZip, options: ImportOptions) -> Iterator[ImpactRecord | Problem]:
    """The head impacts of the crash tests in an archive: one for each occupant whose head has channels."""
    if options.mapping is not None or options.preset not in {None, PRESET}:
        raise Problem("unreadable-file", "A crash test is read by the preset nhtsa and takes no mapping.")
    found = 0
    for header in sorted(name for name in archive.names if name.lower().endswith(".ev5")):
        test = read_header(archive.read(header))
        curves = _curves(archive.names, header)
        for occupant in sorted({channel.occupant for channel in test.channels if channel.axis != RESULTANT}):
            found += 1
            if found > options.max_impacts:
                raise Problem("import-too-large", f"An import may hold at most {options.max_impacts} impacts.")
            try:
                yield with_options(_Head(archive, curves, test, occupant).record(), options)
            except Problem as problem:
                yield problem
    if not found:
        raise Problem("unreadable-file", "The crash test has no channel at a head's centre of gravity (HDCG).")


def _curves(names: list[str], header: str) -> dict[int, str]:
    """The curve files of an EV5 file, by number: beside it, else below its folder or that folder's parent.

    Of several tests in one folder, and of curves that are not beside it, those of its own name.
    """
    of = PurePosixPath(header)
    curves = [path for path in map(PurePosixPath, names) if _CURVE.search(path.name) is not None]
    own = [path for path in curves if path.stem.lower() == of.stem.lower()]
    beside = [path for path in curves if path.parent == of.parent]
    if len({path.stem.lower() for path in beside}) > 1:
        beside = [path for path in beside if path in own]
    below = [path for path in own if of.parent in path.parents]
    near = [path for path in own if of.parent.parent in path.parents]
    return {int(path.suffix[1:]): str(path) for path in beside or below or near}


class _Head:
    """One occupant's head in one test."""

    def __init__(self, archive: GuardedZip, curves: dict[int, str], test: CrashTest, occupant: Occupant) -> None:
        self.archive, self.curves, self.test, self.occupant = archive, curves, test, occupant
        self.notes: list[QualityNote] = []
        self.unscorable: list[str] = []
        self.read: list[Channel] = []

    def record(self) -> ImpactRecord:
        """The head's record, in the laboratory's axes and unfiltered unless the sender asks otherwise."""
        signals = {name: curves for name in SIGNALS if (curves := self._curves_of(self._channels(name)))}
        if not signals:
            raise file_fault(
                "No head channel of this occupant has its three curves in the archive: add them to the zip.",
                "no-signal",
            )
        mapping = preset_named(PRESET).mapping
        recording = head_recording(
            signals,
            axes=mapping.axes or "anatomical",
            low_pass=PAPER if mapping.filter is None else low_pass(mapping.filter),
        )
        for name, signal in recording.signals():
            self.notes += check_cut(name, signals[name], signal.values)
            self._compare_resultant(name, signal.unit, signal.values)
        return ImpactRecord(
            recording=recording,
            metadata=self._metadata(),
            notes=tuple(self.notes),
            unscorable=tuple(self.unscorable),
        )

    def _channels(self, signal: SignalName) -> list[Channel]:
        """One channel for each axis: a valid one before an invalid, the primary before a redundant sensor."""
        mine = [c for c in self.test.channels if c.occupant == self.occupant and c.signal == signal]
        best: dict[str, Channel] = {}
        for channel in sorted(mine, key=lambda c: (not c.valid, not c.primary, c.curve)):
            best.setdefault(channel.axis, channel)
        return [best[axis] for axis in AXES if axis in best]

    def _compare_resultant(self, signal: SignalName, unit: str, values: FloatArray) -> None:
        """The resultant that the laboratory supplies, where it lets it stand, against that of the samples."""
        for channel in self.test.channels:
            is_its = (channel.occupant, channel.signal, channel.axis) == (self.occupant, signal, RESULTANT)
            if is_its and channel.valid and channel.unit == unit and channel.curve in self.curves:
                with suppress(Problem):  # the samples are whole without it
                    reported = _columns(self.archive.read(self.curves[channel.curve]), channel)[1]
                    if len(reported) == len(values):
                        self.notes += check_reported_resultant(signal, unit, reported, values)

    def _curves_of(self, channels: list[Channel]) -> list[Curve]:
        """The signal's three curves, or none where one is absent; what its laboratory marked invalid is held."""
        for channel in channels:
            if channel.status in INVALID:
                reason = f"Its laboratory marked {channel.named} as not valid ({INVALID[channel.status]})."
                self.unscorable.append(reason)
            elif channel.status not in SOUND:
                said = DOUBTFUL.get(channel.status, f"status {channel.status}, which is not known")
                self._note("questionable_data", f"Its laboratory says of {channel.named}: {said}.", channel)
        absent = [channel for channel in channels if channel.curve not in self.curves]
        for channel in absent:
            self._note("channel_missing", f"The file of {channel.named} is not in the archive.", channel)
        if absent or len(channels) < len(AXES):
            return []
        self.read += channels
        curves = [self._curve(channel) for channel in channels]
        for channel, curve in zip(channels, curves, strict=True):
            self._say_twice(channel, curve)
        return curves

    def _say_twice(self, read: Channel, curve: Curve) -> None:
        """Whether the occupant has another channel that is the same by its row, and is not by its curve."""
        for other in self.test.channels:
            if other.curve != read.curve and other.curve in self.curves and _sameness(other) == _sameness(read):
                with suppress(Problem):  # what cannot be read contradicts nothing
                    stamps, values = _columns(self.archive.read(self.curves[other.curve]), other)
                    second = Curve(other.axis, other.unit or "an unknown unit", values, stamps, None)
                    self.notes += check_twice(read.signal, (read.named, curve), (other.named, second))

    def _curve(self, channel: Channel) -> Curve:
        data = self.archive.read(self.curves[channel.curve])
        stamps, values = _columns(data, channel)
        if channel.points is not None and channel.points != values.size:
            detail = f"The file of {channel.named} has {values.size} samples where its EV5 row says {channel.points}."
            self._note("sample_count_mismatch", detail, channel)
        rate = nominal_rate(stamps)
        if rate is None:
            raise file_fault(f"The times of {channel.named} must increase in equal steps.", "time-not-increasing")
        self._compare_times(channel, float(stamps[0]), rate)
        if channel.unit is None:
            raise unit_unknown(channel.named, channel.signal)
        return Curve(channel.axis, channel.unit, values, stamps, rate, channel.full_scale)

    def _compare_times(self, channel: Channel, first_s: float, rate: float) -> None:
        """What the EV5 says of a curve's step and begin, against the curve's own times, which count."""
        if channel.step_us is None:
            return
        said = channel.step_us * 1e-6
        begins = None if channel.first is None else channel.first * said
        if abs(said * rate - 1.0) > DRIFT:
            what = f"a step of {channel.step_us:g} us where the curve's times step by {1e6 / rate:g} us"
        elif begins is not None and abs(begins - first_s) * rate > 1.0:
            what = f"a begin at {1e3 * begins:g} ms where the curve's times begin at {1e3 * first_s:g} ms"
        else:
            return
        self._note("questionable_data", f"The EV5 row of {channel.named} says {what}; the curve's own count.", channel)

    def _note(self, code: str, detail: str, channel: Channel) -> None:
        self.notes.append(QualityNote(code, "warning", detail, channel.signal, channel.axis))

    def _metadata(self) -> dict[str, Any]:
        metadata: dict[str, Any] = {
            "format": "nhtsa",
            "preset": PRESET,
            "vehicle": self.occupant.vehicle,
            "occupant": self.occupant.seat,
            "curves": {f"{c.signal}_{c.axis}": c.curve for c in self.read},
        }
        if self.test.number is not None:
            metadata["test_number"] = self.test.number
        if self.occupant in self.test.laboratory:
            metadata["laboratory"] = self.test.laboratory[self.occupant]
        return metadata


def _sameness(channel: Channel) -> tuple[Occupant, SignalName, str, bool, bool]:
    return channel.occupant, channel.signal, channel.axis, channel.valid, channel.primary


def _columns(data: bytes, channel: Channel) -> tuple[FloatArray, FloatArray]:
    """Stamps and values: two numbers a line."""
    if len(data) > MAX_CURVE or _NUMBERS.fullmatch(data) is None:
        raise file_fault(f"The file of {channel.named} must hold a time and a value a line.", "missing-sample")
    try:
        numbers = np.array(list(map(float, data.split())), dtype=np.float64)
    except ValueError:
        raise file_fault(f"The file of {channel.named} holds what is no number.", "missing-sample") from None
    if numbers.size % 2 or not np.isfinite(numbers).all():
        raise file_fault(f"The file of {channel.named} must hold a time and a value a line.", "missing-sample")
    if not 6 <= numbers.size <= 2 * MAX_SAMPLES:
        raise file_fault(f"The file of {channel.named} must hold 3 to {MAX_SAMPLES} samples.", "sample-count")
    return numbers[0::2].copy(), numbers[1::2].copy()
