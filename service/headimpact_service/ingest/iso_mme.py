"""ISO-MME (ISO/TS 13499): a folder as zip, ``<test>.mme``, ``Channel/<test>.chn`` and a file for each channel."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from headimpact.quality import QualityNote
from headimpact_service.errors import Problem
from headimpact_service.ingest.curves import Curve
from headimpact_service.ingest.file_faults import file_fault, unit_unknown
from headimpact_service.ingest.head_channels import HeadChannel, head_impacts
from headimpact_service.ingest.iso_codes import HeadCode, head_code, is_time
from headimpact_service.ingest.iso_mme_files import Header, listed_channels, read_channel, read_header
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.spelling import compact, unit_spelled
from headimpact_service.ingest.stamps import nominal_rate
from headimpact_service.ingest.table import FloatArray
from headimpact_service.ingest.times import TimeError, instant
from headimpact_service.ingest.zip_guard import GuardedZip

PRESET = "iso_mme"
MAX_CHANNELS = 2000
SHORTEST_CODE = 10
"""Characters of what may be a channel's code; a file that says less is what the list calls it."""
MAX_NAMED = 10
"""Absent channels that a note names; of more it says how many."""

_NUMBERED = re.compile(r"\.([0-9]{3,4})$")
_ENDINGS = (".mme", ".chn")
# What a header's status says of the data (ISO/TS 13499, RED A), by the word that tells.
_INVALID = re.compile(r"fail|meaningless|no data|invalid|not valid|not ok")
_SOUND = re.compile(r"ok|good|valid|(linearised|linearized|scaled|calculated|computed|as measured)( data)?")
_TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "usec": 1e-6}
_METADATA = {
    "test_number": "test number",
    "laboratory": "laboratory name",
    "test_type": "test type",
    "test_date": "test date",
    "time_of_test": "time of test",
}


def is_iso_mme(names: list[str]) -> bool:
    """Whether an archive's files are those of an ISO-MME set."""
    return any(name.lower().endswith(_ENDINGS) for name in names)


def read_iso_mme(archive: GuardedZip, options: ImportOptions) -> Iterator[ImpactRecord | Problem]:
    """The head impacts of the tests in an archive: one for each test object and position whose head has channels."""
    if options.mapping is not None or options.preset not in {None, PRESET}:
        raise Problem("unreadable-file", "An ISO-MME set is read by the preset iso_mme and takes no mapping.")
    count = 0
    for folder in _folders(archive.names):
        test = _Test(archive, folder, options)
        for item in test.impacts():
            count += 1
            if count > options.max_impacts:
                raise Problem("import-too-large", f"An import may hold at most {options.max_impacts} impacts.")
            yield item
    if count == 0:
        raise Problem("unreadable-file", "The ISO-MME set has no channel at a head's centre of gravity.")


def _folders(names: list[str]) -> list[PurePosixPath]:
    """The folders of the tests: those of the ``.mme`` files, or above the ``.chn`` files where there is none."""
    paths = [PurePosixPath(name) for name in names]
    found = {path.parent for path in paths if path.suffix.lower() == ".mme"}
    if not found:
        lists = (path.parent for path in paths if path.suffix.lower() == ".chn")
        found = {folder.parent if folder.name.lower() == "channel" else folder for folder in lists}
    return sorted(found)


class _Test:
    """One test: its headers, its list of channels, and the files of these."""

    def __init__(self, archive: GuardedZip, folder: PurePosixPath, options: ImportOptions) -> None:
        self.archive, self.folder, self.options = archive, folder, options
        self.info = self._read_header(".mme", [folder])
        inside = [path for path in map(PurePosixPath, archive.names) if path.parent == folder]
        channels = [p for p in map(PurePosixPath, archive.names) if _is_channel_folder(p.parent, folder)] or inside
        self.files = {int(m[1]): str(p) for p in channels if (m := _NUMBERED.search(p.name)) is not None}
        if len(self.files) > MAX_CHANNELS:
            raise Problem("unreadable-file", f"A set may have at most {MAX_CHANNELS} channels.")
        self.listed = listed_channels(self._read_header(".chn", [path.parent for path in channels] or [folder]))
        self.read: dict[int, tuple[Header, FloatArray]] = {}
        self.begin: set[bool] = set()  # whether the head's channels say when they begin

    def impacts(self) -> Iterator[ImpactRecord | Problem]:
        """The heads of this test."""
        metadata = {"format": "iso_mme", "preset": PRESET, **self._metadata()}
        channels = [c for number in sorted(self.files) if (c := self._channel(number)) is not None]
        occurred_at = self._occurred_at()
        options = self.options
        known = self._trigger_is_known()
        for item in head_impacts(
            channels, options, preset=PRESET, metadata=metadata, notes=self._absent(), trigger_known=known
        ):
            if isinstance(item, Problem) or occurred_at is None or options.occurred_at is not None:
                yield item
            else:
                yield replace(item, occurred_at=occurred_at)

    def _read_header(self, ending: str, folders: list[PurePosixPath]) -> Header:
        for name in self.archive.names:
            path = PurePosixPath(name)
            if path.suffix.lower() == ending and path.parent in folders:
                return read_header(self.archive.read(name))
        return Header({})

    def _channel(self, number: int) -> HeadChannel | None:
        """The channel of a file, if it is one of a head's; a file that the list calls something else is not opened."""
        if number in self.listed and head_code(self.listed[number]) is None:
            return None
        header, _ = self._file(number)
        said = header.text("channel code") or ""
        code = head_code(said if len(said) >= SHORTEST_CODE else self.listed.get(number, said))
        if code is None:
            return None
        self.begin.add(header.number("time of first sample") is not None or self._refers(header))
        status = " ".join((header.text("data status") or "ok").casefold().split())
        invalid = _INVALID.search(status) is not None
        return HeadChannel(
            code=code,
            named=_named(code, number),
            read=partial(self._curve, code, number),
            filtering=code.filtering,
            invalid=status if invalid else None,
            doubt=None if invalid or _SOUND.fullmatch(status) else status,
            points=header.number("number of samples"),
        )

    def _file(self, number: int) -> tuple[Header, FloatArray]:
        if number not in self.read:
            named = f"channel {number:03d}"
            self.read[number] = read_channel(self.archive.read(self.files[number]), named)
        return self.read[number]

    def _curve(self, code: HeadCode, number: int) -> Curve:
        header, values = self._file(number)
        unit = unit_spelled(code.signal, header.text("unit"))
        if unit is None:
            raise unit_unknown(_named(code, number), code.signal)
        stamps, rate = self._stamps(header, values.size, _named(code, number))
        full_scale = header.number("channel amplitude class")
        return Curve(code.axis, unit, values, stamps, rate, full_scale if full_scale and full_scale > 0 else None)

    def _stamps(self, header: Header, count: int, named: str) -> tuple[FloatArray, float | None]:
        """The channel's times [s] and their rate: implicit in its header, or those of the channel that it refers to."""
        for key in ("sampling interval", "time of first sample"):
            if header.text(key) is not None and header.number(key) is None:
                raise file_fault(f"The {key} of {named} is no number of seconds.", "time-form")
        step, told = self._step(header, named), header.number("time of first sample")
        explicit = (header.text("reference channel") or "").casefold() == "explicit"
        if explicit or step is None or (told is None and self._refers(header)):
            stamps = self._reference(header, count, named)
        else:
            stamps = (told or 0.0) + step * np.arange(count, dtype=np.float64)
        if not (np.diff(stamps) > 0).all():
            raise file_fault(f"The times of {named} must increase.", "time-not-increasing")
        return stamps, nominal_rate(stamps)

    def _step(self, header: Header, named: str) -> float | None:
        """The sampling interval that the header says or, where it says none, the sender [s]."""
        step = header.number("sampling interval")
        if step is not None and not (step == 0.0 and self._refers(header)):
            if not 0.0 < step < 1.0:
                raise file_fault(f"The sampling interval of {named} is {step:g}: it is one in seconds.", "time-form")
            return step
        return None if self.options.sample_rate_hz is None else 1.0 / self.options.sample_rate_hz

    def _refers(self, header: Header) -> bool:
        """Whether a header names a channel of times."""
        return is_time((header.text("reference channel name") or "").partition("/")[0].strip())

    def _trigger_is_known(self) -> bool:
        """Whether the head's channels say when they begin: all of them or none; 422 for some."""
        if len(self.begin) > 1:
            detail = "Some of the head's channels say the time of their first sample, some do not."
            raise file_fault(detail, "time-missing")
        return self.begin != {False}

    def _reference(self, header: Header, count: int, named: str) -> FloatArray:
        wanted = (header.text("reference channel name") or "").partition("/")[0].strip().upper()
        for number in sorted(self.files):
            if wanted and is_time(wanted) and self.listed.get(number, wanted).upper() == wanted:
                found, stamps = self._file(number)
                if (found.text("channel code") or wanted).upper() == wanted:
                    return _in_seconds(found, stamps, count, named)
        raise file_fault(
            f"The times of {named} are neither in its header nor in a channel of the set that it names.", "time-missing"
        )

    def _absent(self) -> list[QualityNote]:
        """What the list names and the set does not hold."""
        absent = {number: code for number, code in self.listed.items() if number not in self.files}
        if not absent:
            return []
        heads = [number for number, code in absent.items() if head_code(code) is not None]
        named = [
            f"{absent[number]} (channel {number:03d})" for number in [*heads, *(n for n in absent if n not in heads)]
        ]
        more = f" and {len(named) - MAX_NAMED} more" if len(named) > MAX_NAMED else ""
        detail = f"The set lists {', '.join(named[:MAX_NAMED])}{more} but does not hold them."
        if heads:
            return [QualityNote("channel_missing", "warning", detail)]
        return [QualityNote("channel_missing", "note", f"{detail} None is of the head's centre of gravity.")]

    def _metadata(self) -> dict[str, Any]:
        told = {name: self.info.text(key) for name, key in _METADATA.items()}
        return {name: value for name, value in told.items() if value is not None}

    def _occurred_at(self) -> datetime | None:
        """When the test was, where the sender says in which zone its laboratory's clock runs."""
        date, time = self.info.text("test date"), self.info.text("time of test")
        if date is None or time is None or self.options.time_zone is None:
            return None
        try:
            return instant(f"{date}T{time}", self.options.time_zone)
        except TimeError:
            return None


def _is_channel_folder(folder: PurePosixPath, test: PurePosixPath) -> bool:
    return folder.name.lower() == "channel" and folder.parent == test


def _named(code: HeadCode, number: int) -> str:
    return f"{code.code} (channel {number:03d})"


def _in_seconds(header: Header, stamps: FloatArray, count: int, named: str) -> FloatArray:
    factor = _TIME_UNITS.get(compact(header.text("unit") or ""))
    if factor is None:
        raise file_fault(f"The unit of the times of {named} is neither s, ms nor µs.", "unit-missing")
    if stamps.size != count or not np.isfinite(stamps).all():
        raise file_fault(f"The times of {named} must be as many as its samples: {count}.", "stamp-count")
    return stamps * factor
