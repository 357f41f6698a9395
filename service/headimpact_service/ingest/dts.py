"""DTS / TDAS CSV: some twenty rows of ``key,value…`` with a value for each channel, then a column for each channel.

The columns stand in the order of the rows above them. A column of times before them is not needed: the header says the
rate, and how much lies before the trigger; where it stands, it must agree. What the header says of filtering counts,
not the last letter of the channel's code.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from headimpact.quality import QualityNote
from headimpact_service.errors import Problem
from headimpact_service.ingest.cells import is_written_number
from headimpact_service.ingest.curves import Curve
from headimpact_service.ingest.decimal_commas import MIXED, has_comma, has_decimal_comma
from headimpact_service.ingest.dts_header import (
    A_NUMBER,
    MAX_HEADER_ROWS,
    Header,
    key_of,
    read_header,
    without_empty_end,
)
from headimpact_service.ingest.dts_rate import sample_rate, with_mapped_rate
from headimpact_service.ingest.file_faults import file_fault, unit_unknown
from headimpact_service.ingest.head_channels import HeadChannel, head_impacts
from headimpact_service.ingest.impact_json import MAX_SAMPLES
from headimpact_service.ingest.iso_codes import HeadCode, head_code
from headimpact_service.ingest.iso_mme_files import NO_VALUE, decoded
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.source import Source
from headimpact_service.ingest.spelling import unit_spelled
from headimpact_service.ingest.stamps import follows
from headimpact_service.ingest.table import Columns, FloatArray
from headimpact_service.ingest.tabular import read_table
from headimpact_service.ingest.text_facts import UTF_16, unreadable

PRESET = "dts"
MAX_FILE = 64 * 1024 * 1024
MAX_CHANNELS = 1024
MAX_LINE = 256 * 1024

_UNITS_PER_S = (1.0, 1e3, 1e6)
"""What a column of times may count: seconds, or parts of them."""


def is_dts(head: bytes) -> bool:
    """Whether a text file begins with the rows of a DTS header: the channels' codes, and their units or a rate."""
    rows = [line.split(_delimiter(line)) for line in decoded_head(head)[:MAX_HEADER_ROWS]]
    told = {name for row in rows if (name := key_of(row[0])) is not None and len(row) > 1}
    return not told.isdisjoint({"rate", "rate_khz", "unit"}) and "code" in told


def decoded_head(head: bytes) -> list[str]:
    """The whole lines of a file's beginning, in any of the encodings that laboratories use."""
    text = head.decode("utf-16", "ignore") if head.startswith(UTF_16) else head.decode("latin-1")
    return [line.strip() for line in text.split("\n")]


def read_dts(source: Source, options: ImportOptions) -> Iterator[ImpactRecord | Problem]:
    """The head impacts of a file: one for each test object and position whose head has channels.

    With a mapping, its columns are found by the channels' codes or names, and the header gives rate and trigger.
    """
    options = with_mapped_rate(options)
    rows = _rows(source)
    header, first = read_header(rows)
    data = _Data(header, rows[first:], sample_rate(header, options))
    if options.mapping is not None:
        yield from _mapped(data, options)
        return
    channels = [channel for index in range(data.channels) if (channel := data.channel(index)) is not None]
    if not channels:
        raise Problem(
            "unreadable-file",
            "No channel of the file has the ISO code of a head's centre of gravity: send a mapping from the channels' "
            "codes or names to signals.",
        )
    metadata = {"format": "dts", "preset": PRESET, **header.metadata}
    found = head_impacts(
        channels, options, preset=PRESET, metadata=metadata, trigger_known=data.points_before is not None
    )
    for count, item in enumerate(found, start=1):
        if count > options.max_impacts:
            raise Problem("import-too-large", f"An import may hold at most {options.max_impacts} impacts.")
        yield item


def _rows(source: Source) -> list[list[str]]:
    lines = decoded(source.read(MAX_FILE)).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if any(len(line) > MAX_LINE or "\0" in line for line in lines):
        raise Problem("unreadable-file", f"A line may have at most {MAX_LINE} characters, and no NUL among them.")
    if len(lines) > MAX_HEADER_ROWS + MAX_SAMPLES + 100:
        raise file_fault(f"A file may hold at most {MAX_SAMPLES} samples.", "sample-count")
    wanted = next(
        (line for line in lines[:MAX_HEADER_ROWS] if key_of(re.split(r"[,;\t]", line)[0]) == "code"), lines[0]
    )
    delimiter = _delimiter(wanted)
    try:
        found = list(csv.reader(lines, delimiter=delimiter, strict=True))
    except csv.Error:
        raise Problem("unreadable-file", "The file's quotes do not match.") from None
    return _with_decimal_points([[cell.strip() for cell in row] for row in found if any(cell.strip() for cell in row)])


def _with_decimal_points(rows: list[list[str]]) -> list[list[str]]:
    """The rows of a file, which may have decimal commas; 422 where its samples have points too."""
    commas = {cell for row in rows for cell in row if "," in cell and has_comma(cell)}
    if not any(map(has_decimal_comma, commas)):
        return rows
    samples = (cell for row in rows if is_written_number(row[0]) for cell in row if is_written_number(cell))
    if len({mark for cell in samples for mark in ".," if mark in cell}) > 1:
        raise unreadable(MIXED)
    return [[cell.replace(",", ".") if cell in commas else cell for cell in row] for row in rows]


def _delimiter(line: str) -> str:
    return max(",;\t", key=line.count)


class _Data:
    """The samples, by channel."""

    def __init__(self, header: Header, rows: Sequence[Sequence[str]], rate: float) -> None:
        """Look at the header only; columns are read as they are asked for."""
        self.header, self.rate = header, rate
        codes = header.fields.get("code", [])
        names = header.names
        self.channels = max(len(codes), len(names), len(header.fields.get("unit", [])))
        if not 1 <= self.channels <= MAX_CHANNELS:
            raise Problem("unreadable-file", f"A file may have 1 to {MAX_CHANNELS} channels.")
        self.rows = [without_empty_end(row) for row in rows]
        self.first = self._first_column()
        headings = [cell for cell in header.headings if cell in codes]
        if sorted(headings) == sorted(filter(None, codes)) and headings != list(filter(None, codes)):
            raise file_fault(
                "The headings above the samples stand in another order than the channels' codes: which is right?",
                "heading-order",
            )
        self.points_before = self._points_before()

    def _first_column(self) -> int:
        """The column of the first channel: one stands before it where the rows are one cell longer."""
        width = max((len(row) for row in self.rows), default=0)
        if width not in {self.channels, self.channels + 1}:
            raise Problem(
                "unreadable-file",
                f"The rows of samples must have {self.channels} cells, one for each channel, or one more for the time.",
            )
        return width - self.channels

    def _points_before(self) -> float | None:
        """How many samples lie before the trigger: as the header says, else by the times, which must agree with it."""
        told, first_s = self.header.points_before(self.rate), self._first_time_s()
        if first_s is None or first_s >= 0.0:  # times may count from the record's start
            return told
        by_times = -first_s * self.rate
        if told is None:
            return by_times
        if abs(told - by_times) > 1.0:
            raise file_fault(
                f"The header says that {told:g} samples lie before the trigger, the times say {by_times:g}.",
                "time-zero",
            )
        return told

    def _first_time_s(self) -> float | None:
        """When the record begins, by its column of times [s]; None without one, or where samples are only numbered."""
        if not self.first:
            return None
        cells = [row[0] if row else "" for row in self.rows]
        if not all(map(A_NUMBER.fullmatch, cells)) or len(cells) < 3:
            raise file_fault(
                "A cell of the column before the channels, which gives the times, is no number.", "time-form"
            )
        times = np.array([float(cell) for cell in cells])
        for unit in _UNITS_PER_S:
            if follows(times * (1000.0 / unit), self.rate, drift=0.0):
                return float(times[0]) / unit
        if (np.diff(times) == 1.0).all():
            return None
        step = float(np.median(np.diff(times)))
        raise file_fault(
            f"The column before the channels steps by {step:g}, evenly or not, where {self.rate:g} samples per "
            "second are said: which of them is right?",
            "rates-differ",
        )

    def channel(self, index: int) -> HeadChannel | None:
        """The channel of a column, if it is one of a head's."""
        code = head_code(self.header.of_channel("code", index)) if "code" in self.header.fields else None
        if code is None:
            return None
        read = partial(self._curve, code, index)
        return HeadChannel(code, self.named(index), read, self._filtering(index, code), points=self.points(index))

    def points(self, index: int) -> float | None:
        """How many samples the header says that a channel has: in all, or before and after the trigger."""
        said = [self.header.of_channel(key, index) for key in ("points", "after")]
        points, after = (float(cell) if A_NUMBER.fullmatch(cell) else None for cell in said)
        before = self.header.points_before(self.rate)
        if points is not None or before is None or after is None:
            return points
        # some count the trigger's own sample with those after it, some with neither
        return before + after + (len(self.rows) == before + after + 1)

    def named(self, index: int) -> str:
        """The channel as messages name it."""
        return f"{self.header.of_channel('code', index)[:40]} (channel {index + 1})"

    def _filtering(self, index: int, code: HeadCode) -> str:
        said = self.header.of_channel("filter", index)
        return said[:40].lower() if said else code.filtering

    def _curve(self, code: HeadCode, index: int) -> Curve:
        unit = unit_spelled(code.signal, self.header.of_channel("unit", index))
        if unit is None:
            raise unit_unknown(self.named(index), code.signal)
        values = self.values(index)
        stamps: FloatArray = (np.arange(values.size, dtype=np.float64) - (self.points_before or 0.0)) / self.rate
        return Curve(code.axis, unit, values, stamps, self.rate)

    def values(self, index: int) -> FloatArray:
        """The samples of a channel; NaN where a cell is empty or says that there is no value."""
        column = index + self.first
        cells = [row[column] if column < len(row) else "" for row in self.rows]
        if not 3 <= len(cells) <= MAX_SAMPLES:
            raise file_fault(f"The file must hold 3 to {MAX_SAMPLES} samples.", "sample-count")
        return np.array([self._value(cell, index, sample) for sample, cell in enumerate(cells)])

    def _value(self, cell: str, index: int, sample: int) -> float:
        if A_NUMBER.fullmatch(cell) is not None:
            return float(cell)
        if not cell or cell.upper() in {NO_VALUE, "NAN"}:
            return float("nan")
        raise file_fault(f"{self.named(index)} holds what is no number at sample {sample}.", "missing-sample")


class _Channels:
    """The channels as a table, for a mapping that names them."""

    parted = False
    dated = frozenset[int]()
    wordless = frozenset[int]()
    above: Sequence[Sequence[str]] = ()
    beside: Sequence[Sequence[str]] = ()

    def __init__(self, data: _Data) -> None:
        """Headings are the channels' codes or, where they have none, their names."""
        self._data = data
        self.headings = tuple(self._heading(index) for index in range(data.channels))
        self.units: Mapping[int, str] = {i: data.header.of_channel("unit", i) for i in range(data.channels)}

    def _heading(self, index: int) -> str:
        header, names = self._data.header, self._data.header.names
        return header.of_channel("code", index) or (names[index] if index < len(names) else f"channel {index + 1}")

    def has_samples(self, place: int) -> bool:  # noqa: ARG002 - the shape of a table
        """Every channel does."""
        return True

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Columns]:
        """All rows at once: a file holds one record."""
        rows = len(self._data.rows)
        words = {index: [""] * rows for index in texts}
        yield Columns(rows=rows, numbers={index: self._data.values(index) for index in numbers}, texts=words)


def _mapped(data: _Data, options: ImportOptions) -> Iterator[ImpactRecord | Problem]:
    asked = options.mapping
    assert asked is not None
    known: dict[str, Any] = {"sample_rate_hz": data.rate, "axes": "sae_j211"}
    if data.points_before is not None:
        known["pre_trigger_ms"] = round(data.points_before / data.rate * 1000.0, 9)
    given = {name: value for name, value in known.items() if name not in asked.model_fields_set}
    mapping = asked.model_copy(update=given)
    notes = tuple(_of_other_length(data))
    for item in read_table(_Channels(data), replace(options, preset=None, mapping=mapping), format_name="dts"):
        yield replace(item, notes=(*notes, *item.notes)) if isinstance(item, ImpactRecord) else item


def _of_other_length(data: _Data) -> Iterator[QualityNote]:
    """A note if the file has not the samples that its header says, of whatever channels."""
    said = {points for index in range(data.channels) if (points := data.points(index)) is not None}
    if said and said != {float(len(data.rows))}:
        detail = f"The file has {len(data.rows)} samples where its header says {max(said):g}."
        yield QualityNote("sample_count_mismatch", "warning", detail)
