"""Struct arrays of MATLAB: each element is an impact, each field a column of samples, several of them, or a fact."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, TypeGuard

import numpy as np

from headimpact_service.ingest.cells import number_text
from headimpact_service.ingest.guarded.array_table import AXES, MAX_LENGTH, ROWS_AT_ONCE
from headimpact_service.ingest.guarded.contents import checked_headings, checked_text, unreadable
from headimpact_service.ingest.guarded.stated_units import of_columns
from headimpact_service.ingest.table import Columns, FloatArray

MAX_FIELDS = 100
MAX_WIDTH = 64
TIMES = ("t", "time")
_STEPS = (("t (s)", 1e-3), ("t (ms)", 1.0))
"""What a device of 1 kHz calls its times, by the step between two of them."""
_TOLERANCE = 0.15

AnyArray = np.ndarray[Any, np.dtype[Any]]


class StructTable:
    """A struct array: each element is an impact, each field a column of samples, three of them, or a fact."""

    parted = True
    dated = frozenset[int]()
    above: Sequence[Sequence[str]] = ()
    beside: Sequence[Sequence[str]] = ()

    def __init__(self, impacts: Sequence[dict[str, Any]]) -> None:
        """Look at every field once."""
        self._impacts = impacts
        names = list(dict.fromkeys(name for impact in impacts for name in impact))
        if len(names) > MAX_FIELDS:
            raise unreadable(f"A struct may have at most {MAX_FIELDS} fields.")
        self._columns: list[tuple[str, int | None]] = []
        headings: list[str] = []
        for name in names:
            for heading, part in self._headings_of(name):
                headings.append(heading)
                self._columns.append((name, part))
        self.headings = checked_headings(headings)
        texts = {name: text_of(impacts[0].get(name)) for name in names} if impacts else {}
        parts = [(name, -1 if part is None else part) for name, part in self._columns]
        units = of_columns(parts, {name: text for name, text in texts.items() if text})
        self.units = {place: unit for place, unit in units.items() if parts[place][1] >= 0}
        self.wordless = [place for place, (_, part) in enumerate(self._columns) if part is not None]

    def has_samples(self, place: int) -> bool:
        """A field of columns does."""
        return self._columns[place][1] is not None

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Columns]:
        """Some impacts at a time."""
        held: list[tuple[dict[int, FloatArray], dict[int, str], int]] = []
        for impact in self._impacts:
            samples = {place: self._column(impact, place) for place in numbers}
            length = min(max((values.size for values in samples.values()), default=0), MAX_LENGTH)
            held.append((samples, {place: text_of(impact.get(self._columns[place][0])) for place in texts}, length))
            if sum(rows for _, _, rows in held) >= ROWS_AT_ONCE:
                yield _joined(held, numbers, texts)
                held = []
        if held:
            yield _joined(held, numbers, texts)

    def _headings_of(self, name: str) -> list[tuple[str, int | None]]:
        """A field's headings: of three components one each, of times also that with the unit that makes 1 kHz."""
        cells = [value for impact in self._impacts if holds_samples(value := impact.get(name))]
        if cells and all(by_samples(value).shape[1] == 3 for value in cells):
            return [(f"{name}_{axis}", part) for part, axis in enumerate(AXES)]
        widths = {by_samples(value).shape[1] for value in cells}
        if len(widths) == 1 and len(AXES) < max(widths) <= MAX_WIDTH:
            return [(f"{name}_{part + 1}", part) for part in range(max(widths))]
        if widths != {1}:
            return [(name, None)]
        return [(heading, 0) for heading in called_by(name, cells)]

    def _column(self, impact: dict[str, Any], place: int) -> FloatArray:
        name, part = self._columns[place]
        value: Any = impact.get(name)
        if part is not None and not holds_samples(value) and is_numeric(value):
            return np.empty(0)  # this impact has no such samples
        if part is None or not is_numeric(value):
            raise unreadable(f"The field {name} of the struct holds no column of numbers.")
        return by_samples(value)[:, part].astype(np.float64)


def is_numeric(value: Any) -> TypeGuard[AnyArray]:  # noqa: ANN401 - whatever a file holds
    """A matrix of numbers, as MATLAB keeps columns, rows and lone ones too."""
    return isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.ndim == 2


def holds_samples(value: Any) -> TypeGuard[AnyArray]:  # noqa: ANN401 - whatever a file holds
    """Neither nothing nor a lone number, as which MATLAB writes what is not there."""
    return is_numeric(value) and value.size > 1


def by_samples(value: AnyArray) -> AnyArray:
    """Samples x components, however the field lies."""
    lies_down = value.shape[0] in (1, 3) and value.shape[1] > 3
    return value.T if lies_down else value


def called_by(name: str, cells: Iterable[AnyArray]) -> list[str]:
    """What a column of samples is called: of times also with the unit that makes 1 kHz of them."""
    columns = list(cells) if name.lower() in TIMES else []
    return [name, *(called for called, step in _STEPS if columns and all(_steps_by(one, step) for one in columns))]


def _steps_by(value: AnyArray, step: float) -> bool:
    steps = np.diff(by_samples(value)[:, 0].astype(np.float64))
    return steps.size > 0 and bool(np.all(np.abs(steps / step - 1.0) <= _TOLERANCE))


def _joined(
    held: list[tuple[dict[int, FloatArray], dict[int, str], int]], numbers: Sequence[int], texts: Sequence[int]
) -> Columns:
    """Impacts end to end, the shorter columns of each ending in NaN."""
    lengths = [length for _, _, length in held]
    columns: dict[int, FloatArray] = {}
    for place in numbers:
        parts = [_of_length(samples[place], length) for samples, _, length in held]
        columns[place] = np.concatenate(parts)
    return Columns(sum(lengths), columns, {place: [cells[place] for _, cells, _ in held] for place in texts}, lengths)


def _of_length(values: FloatArray, length: int) -> FloatArray:
    if values.size >= length:
        return values[:length]
    return np.concatenate((values, np.full(length - values.size, np.nan)))


def text_of(cell: Any) -> str:  # noqa: ANN401 - whatever a file holds
    """The text or number of a cell that holds one; empty for anything else."""
    if isinstance(cell, np.ndarray):
        return text_of(cell.reshape(-1)[0].item()) if cell.size == 1 and cell.dtype.kind in "USfiu" else ""
    if isinstance(cell, str):
        return checked_text(cell)
    return number_text(float(cell)) if isinstance(cell, int | float) else ""
