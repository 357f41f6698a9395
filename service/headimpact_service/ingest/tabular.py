"""A table and a mapping into impacts."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from headimpact.filtering import PAPER
from headimpact.quality import QualityNote
from headimpact.recording import AxesName, Recording, Signal, SignalName
from headimpact_service.errors import PayloadError, Problem
from headimpact_service.ingest.headings import Headings
from headimpact_service.ingest.impact_json import MAX_NAME, MAX_SAMPLES, PRINTABLE
from headimpact_service.ingest.impact_reading import low_pass, mounting
from headimpact_service.ingest.layout import Layout, SignalLayout, lay_out
from headimpact_service.ingest.mapping import Mapping, merge
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.presets import Preset, preset_named, recognise
from headimpact_service.ingest.record import ImpactRecord, RefusedImpact
from headimpact_service.ingest.stamps import nominal_rate
from headimpact_service.ingest.table import Columns, FloatArray, Table
from headimpact_service.ingest.times import TimeError, instant
from headimpact_service.ingest.windows import Rows, Window, windows

_PRINTABLE = re.compile(PRINTABLE)


@dataclass(frozen=True, slots=True)
class Plan:
    """How one table is read: its mapping, where that came from, and what the sender overrides."""

    mapping: Mapping
    preset: str | None
    required: frozenset[str]
    options: ImportOptions
    format: str


def read_table(table: Table, options: ImportOptions, *, format_name: str) -> Iterator[ImpactRecord | Problem]:
    """The impacts of a table in the order in which they begin.

    Raises
    ------
    Problem
        The table as a whole cannot be read. A fault of one impact is yielded in its place instead.
    """
    headings = Headings(table.headings, table.units)
    plan = _plan(headings, options, format_name)
    layout = lay_out(plan.mapping, headings, plan.required)
    _require_rate(layout, plan)
    blocks = table.blocks(layout.numbers, layout.texts)
    max_single = MAX_SAMPLES + (plan.mapping.drop_rows or 0)
    count = 0
    for window in windows(blocks, layout.keys, parted=table.parted, max_single=max_single):
        count += len(window.impacts)
        if count > options.max_impacts:
            raise Problem("import-too-large", f"An import may hold at most {options.max_impacts} impacts.")
        yield from _read_window(plan, layout, window)
    if count == 0:
        raise Problem("unreadable-file", "The file has headings but no samples.")


def _read_window(plan: Plan, layout: Layout, window: Window) -> Iterator[ImpactRecord | Problem]:
    samples = _Samples(layout, window)
    for number in range(len(window.impacts)):
        impact = _Impact(plan, samples, number)
        try:
            yield impact.record()
        except Problem as problem:
            yield RefusedImpact(problem, impact.sent_name())


def _plan(headings: Headings, options: ImportOptions, format_name: str) -> Plan:
    preset = _preset(headings, options)
    asked = options.mapping
    required = frozenset() if asked is None else frozenset(_names_columns(asked))
    base = Mapping.model_construct() if preset is None else preset.mapping_for(headings)
    return Plan(merge(base, asked), None if preset is None else preset.name, required, options, format_name)


def _preset(headings: Headings, options: ImportOptions) -> Preset | None:
    """The preset that is named, or else recognised; a mapping that names the columns of a signal stands alone."""
    if options.preset is not None:
        preset = preset_named(options.preset)
        if preset.format != "table":
            raise Problem("unreadable-file", f"The preset {preset.name} reads another kind of file than this table.")
        return preset
    if options.mapping is not None and _names_signals(options.mapping):
        return None
    return recognise(headings)


def _names_signals(mapping: Mapping) -> bool:
    signals = (mapping.linear_acceleration, mapping.angular_velocity, mapping.angular_acceleration)
    return any(s is not None and (s.x or s.y or s.z) for s in signals)


def _names_columns(mapping: Mapping) -> Iterator[str]:
    """The fields of a sent mapping whose columns must be there: a signal of which only the unit is given need not."""
    for name in mapping.model_fields_set:
        value = getattr(mapping, name)
        if value is None or (hasattr(value, "unit") and not (value.x or value.y or value.z)):
            continue
        yield name


def _require_rate(layout: Layout, plan: Plan) -> None:
    if layout.time is None and plan.mapping.sample_rate_hz is None and plan.options.sample_rate_hz is None:
        fault = PayloadError(
            detail="The file has no column of times that is known: give its sample rate.",
            code="rate-missing",
            parameter="sample_rate_hz",
        )
        raise Problem("unreadable-file", fault.detail, errors=[fault])


class _Samples:
    """A window's columns, put together into signals once for all its impacts."""

    def __init__(self, layout: Layout, window: Window) -> None:
        columns = window.columns
        self.layout, self.window, self.texts = layout, window, columns.texts
        self.signals = {name: _assembled(signal, columns) for name, signal in layout.signals.items()}
        self.stamps = None if layout.time is None else columns.numbers[layout.time]
        self._numbers = columns.numbers
        self._finite = all(bool(np.isfinite(numbers).all()) for numbers in columns.numbers.values())

    def require_finite(self, rows: Rows, first: int) -> None:
        """Refuse an impact in which a cell is not a finite number."""
        if self._finite:
            return
        for column, numbers in self._numbers.items():
            faulty = np.flatnonzero(~np.isfinite(numbers[rows]))
            if faulty.size:
                raise _fault(
                    f"A cell of column {column + 1} is not a finite number, at sample {faulty[0]} of the impact that "
                    f"begins in row {first + 1} below the headings.",
                    "missing-sample",
                )


def _assembled(signal: SignalLayout, columns: Columns) -> FloatArray:
    """A signal's three columns with their signs; one that a constrained plane leaves out is zero."""
    values = np.zeros((columns.rows, 3))
    for axis, component in enumerate(signal.components):
        if component.column is not None:
            np.multiply(columns.numbers[component.column], component.sign, out=values[:, axis])
    return values


class _Impact:
    """One impact of a table."""

    def __init__(self, plan: Plan, samples: _Samples, number: int) -> None:
        self.plan, self.samples, self.layout = plan, samples, samples.layout
        self.mapping, self.options = plan.mapping, plan.options
        window = samples.window
        self.rows = window.impacts[number]
        self.first = self.rows.start if isinstance(self.rows, slice) else self.rows[0]
        self.cell = self.first if window.columns.lengths is None else number
        self.notes: list[QualityNote] = []
        self._drop()

    def record(self) -> ImpactRecord:
        """The impact, with what the sender gave beside the file in place of what the file says."""
        options = self.options
        sensor = self.mapping.location == "sensor"
        return ImpactRecord(
            recording=self._recording(),
            external_id=self._name("external_id", self.layout.external_id),
            athlete_external_id=options.athlete or self._name("athlete", self.layout.athlete),
            occurred_at=options.occurred_at or self._occurred_at(),
            device_serial=options.device or self._name("device", self.layout.device),
            context=self._context(),
            metadata=self._metadata(),
            notes=tuple(self.notes),
            needs_device_mounting=sensor and self.mapping.mounting is None,
        )

    def sent_name(self) -> str | None:
        """What the file calls the impact."""
        try:
            return self._name("external_id", self.layout.external_id)
        except Problem:
            return None

    def _drop(self) -> None:
        """Leave out the samples that the layout calls corrupt, and say so."""
        dropped = self.mapping.drop_rows or 0
        if dropped:
            rows = self.rows
            self.rows = slice(rows.start + dropped, rows.stop) if isinstance(rows, slice) else rows[dropped:]
            detail = f"The first {dropped} of the file's samples were left out, as its layout says."
            self.notes.append(QualityNote("edge_glitch", "note", detail))

    def _recording(self) -> Recording:
        mapping, options = self.mapping, self.options
        axes: AxesName = options.axes or mapping.axes or "anatomical"
        sensor = mapping.location == "sensor"
        self.samples.require_finite(self.rows, self.samples.window.first + self.first)
        # Counts of hours in microseconds lose their last digits if they are scaled first: they stay as they stand.
        stamps = None if self.samples.stamps is None else self.samples.stamps[self.rows]
        rate, elapsed_s = self._rate(stamps)
        signals: dict[str, Any] = {name: self._signal(name, rate, elapsed_s) for name in self.layout.signals}
        return Recording(
            axes=axes,
            mounting=mounting(mapping.mounting) if sensor and mapping.mounting is not None else None,
            constrained_plane=mapping.constrained_plane,
            low_pass=options.low_pass or (PAPER if mapping.filter is None else low_pass(mapping.filter)),
            pre_trigger_ms=self._pre_trigger_ms(stamps),
            **signals,
        )

    def _rate(self, stamps: FloatArray | None) -> tuple[float | None, FloatArray | None]:
        """The rate that is stated, given beside the file or said by uniform stamps; else the times [s]."""
        if self.options.sample_rate_hz is not None:
            return self.options.sample_rate_hz, None
        if stamps is None:
            return self.mapping.sample_rate_hz, None
        elapsed_s = (stamps - stamps[:1]) * self.layout.time_factor
        rate = nominal_rate(elapsed_s)
        return (None, elapsed_s) if rate is None else (rate, None)

    def _pre_trigger_ms(self, stamps: FloatArray | None) -> float | None:
        if self.mapping.pre_trigger_ms is not None:
            return self.mapping.pre_trigger_ms
        if stamps is None or stamps.size == 0:
            return None
        spans_zero = bool(stamps[0] < 0.0 <= stamps[-1])
        zero = self.mapping.zero or ("trigger" if spans_zero else "record_start")
        if zero == "record_start":
            return None
        if not spans_zero and stamps[0] != 0.0:
            raise _fault("The record's times must include zero, which its layout says is the trigger.", "time-zero")
        return round(-1000.0 * float(stamps[0]) * self.layout.time_factor, 9) + 0.0

    def _signal(self, name: SignalName, rate: float | None, elapsed_s: FloatArray | None) -> Signal:
        # A copy, so that one impact that is kept does not keep the whole table.
        values = self.samples.signals[name][self.rows].copy()
        if values.shape[0] > MAX_SAMPLES:
            raise _fault(f"An impact may have at most {MAX_SAMPLES} samples.", "sample-count")
        return Signal(values=values, unit=self.layout.signals[name].unit, sample_rate_hz=rate, time_s=elapsed_s)

    def _text(self, column: int | None) -> str | None:
        if column is None:
            return None
        return self.samples.texts[column][self.cell].strip() or None

    def _name(self, field: str, column: int | None) -> str | None:
        text = self._text(column)
        if text is not None and (len(text) > MAX_NAME or _PRINTABLE.match(text) is None):
            raise _fault(f"A name has 1 to {MAX_NAME} printable characters.", "name-form", parameter=field)
        return text

    def _context(self) -> dict[str, Any]:
        session = self._name("session_id", self.layout.session_id)
        return {} if session is None else {"session_id": session}

    def _occurred_at(self) -> datetime | None:
        parts = [self._text(column) for column in self.layout.occurred_at]
        if not any(parts):
            return None
        text = (parts[0] or "").replace("/", "-") + "".join(f"T{part}" for part in parts[1:])
        try:
            return instant(text, self.options.time_zone)
        except TimeError as error:
            detail = f"{error} If the file's own time is broken, give occurred_at beside the file."
            raise _fault(detail, error.code, parameter=error.field) from None

    def _metadata(self) -> dict[str, Any]:
        told = {"format": self.plan.format, "preset": self.plan.preset, "file": self.options.filename}
        return {name: value for name, value in told.items() if value is not None}


def _fault(detail: str, code: str, parameter: str | None = None) -> Problem:
    return Problem("unreadable-file", detail, errors=[PayloadError(detail=detail, code=code, parameter=parameter)])
