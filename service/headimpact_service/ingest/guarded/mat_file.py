"""MATLAB files of version 5 to 7.2: arrays impacts x samples x components, and struct arrays with an element an impact.

Matrices are inflated once without being kept, to count what they hold, before anything is made of them.
"""

from __future__ import annotations

import io
import zlib
from collections.abc import Iterator, Sequence
from typing import Any, BinaryIO, TypeGuard

import numpy as np
from scipy.io import loadmat, savemat

from headimpact_service.ingest.cells import number_text
from headimpact_service.ingest.guarded.array_table import AXES, MAX_LENGTH, ROWS_AT_ONCE, ArrayTable, Fact, Samples
from headimpact_service.ingest.guarded.contents import (
    Content,
    NamedTable,
    checked_headings,
    checked_text,
    unreadable,
)
from headimpact_service.ingest.table import Columns, FloatArray

MAX_INFLATED = 32 * 1024 * 1024
MAX_ELEMENTS = 10_000
MAX_FIELDS = 100
MAX_WIDTH = 64
MAX_DEPTH = 8
"""Of structs within structs."""
ALONE = "array"
"""The other name of an array that is the only one."""
_HEADER = 128
_COMPRESSED = 15
_BLOCK = 64 * 1024

AnyArray = np.ndarray[Any, np.dtype[Any]]
_TIME = "t"
_STEPS = (("t (s)", 1e-3), ("t (ms)", 1.0))
"""What a device of 1 kHz calls its times, by the step between two of them."""
_TOLERANCE = 0.15


def contents(stream: BinaryIO) -> Iterator[Content]:
    """The impacts of a file's struct array, or else those of its arrays of samples."""
    _require_small(stream)
    stream.seek(0)
    document: dict[str, Any] = loadmat(stream)  # type: ignore[arg-type] # the stubs know of paths only
    variables = {name: value for name, value in document.items() if not name.startswith("__")}
    structs = [value for value in variables.values() if isinstance(value, np.ndarray) and value.dtype.names]
    if structs:
        for struct in structs:
            yield NamedTable(None, StructTable([_flat(element) for element in _elements(struct)]))
        return
    yield NamedTable(None, _arrays(variables))


def warm_up() -> None:
    """Read a file of our own, so that every library is loaded."""
    for document in ({"a": np.zeros((2, 3, 6))}, {"impact": {"t": np.arange(3.0), "name": "x"}}):
        buffer = io.BytesIO()
        savemat(buffer, document, do_compression=True)  # type: ignore[arg-type] # as above
        buffer.seek(0)
        for content in contents(buffer):
            if isinstance(content, NamedTable):
                list(content.table.blocks([0], []))


def _require_small(stream: BinaryIO) -> None:
    """Count what the file inflates to, without keeping any of it."""
    stream.seek(0)
    header = stream.read(_HEADER)
    order: Any = {b"IM": "little", b"MI": "big"}.get(header[126:128])
    if order is None:
        raise unreadable("The header of the MATLAB file is broken.")
    total = 0
    for _ in range(MAX_ELEMENTS):
        tag = stream.read(8)
        if len(tag) < 8:
            return
        kind, size = int.from_bytes(tag[:4], order), int.from_bytes(tag[4:], order)
        total += _inflated(stream, size, MAX_INFLATED - total) if kind == _COMPRESSED else _passed(stream, size)
        if total > MAX_INFLATED:
            raise unreadable(f"The variables of a MATLAB file may have at most {MAX_INFLATED} bytes: split the file.")
    raise unreadable(f"A MATLAB file may have at most {MAX_ELEMENTS} variables.")


def _passed(stream: BinaryIO, size: int) -> int:
    stream.seek(size, io.SEEK_CUR)
    return size


def _inflated(stream: BinaryIO, size: int, most: int) -> int:
    """Bytes that the next `size` bytes inflate to, counted to a little over `most`."""
    inflate, total = zlib.decompressobj(), 0
    while size > 0 and (piece := stream.read(min(size, _BLOCK))):
        size -= len(piece)
        while piece:
            total += len(inflate.decompress(piece, _BLOCK))
            if total > most:
                return total
            piece = inflate.unconsumed_tail
    return total


def _arrays(variables: dict[str, Any]) -> ArrayTable:
    """Every array impacts x samples x components, or else samples x components.

    Of one alone the columns are also called array_1, array_2 and so on.
    """
    solid = _numeric(variables, 3) or {name: value[np.newaxis] for name, value in _of_one_impact(variables).items()}
    if not solid:
        raise unreadable("The MATLAB file holds neither a struct array nor an array impacts x samples x components.")
    if any(value.shape[2] > MAX_WIDTH for value in solid.values()):
        raise unreadable(f"The last dimension of an array of samples is its 1 to {MAX_WIDTH} components.")
    impacts = next(iter(solid.values())).shape[0]
    samples = [_samples(name, value) for name, value in solid.items()]
    if len(solid) == 1 and ALONE not in solid:
        samples.append(_samples(ALONE, next(iter(solid.values()))))
    facts = [Fact(name, None, texts) for name, value in variables.items() if (texts := _texts_of(value, impacts))]
    return ArrayTable(samples, facts, {})


def _elements(struct: AnyArray) -> AnyArray:
    """The impacts of a struct array, which may be the only one of many elements within a struct of a session."""
    many = _of_many(struct)
    return (many[0] if len(many) == 1 else struct).reshape(-1)


def _of_many(struct: AnyArray, depth: int = 0) -> list[AnyArray]:
    if struct.size != 1 or depth == MAX_DEPTH:
        return [struct] if struct.size > 1 else []
    fields = struct.reshape(-1)[0]
    inner = [fields[name] for name in fields.dtype.names if _is_struct(fields[name])]
    return [many for one in inner for many in _of_many(one, depth + 1)]


def _flat(record: Any, before: str = "", depth: int = 0) -> dict[str, Any]:  # noqa: ANN401 - a record of a struct array
    """The fields of one impact; of a struct within it, `data.acc` is called `data_acc`."""
    fields: dict[str, Any] = {}
    for name in record.dtype.names:
        value = record[name]
        if _is_struct(value) and value.size == 1 and depth < MAX_DEPTH:
            fields |= _flat(value.reshape(-1)[0], f"{before}{name}_", depth + 1)
        else:
            fields[before + name] = value
    return fields


def _is_struct(value: Any) -> bool:  # noqa: ANN401 - whatever a file holds
    return isinstance(value, np.ndarray) and value.dtype.names is not None


def _numeric(variables: dict[str, Any], dimensions: int) -> dict[str, AnyArray]:
    return {
        name: value
        for name, value in variables.items()
        if isinstance(value, np.ndarray) and value.ndim == dimensions and value.dtype.kind in "fiu"
    }


def _of_one_impact(variables: dict[str, Any]) -> dict[str, AnyArray]:
    """Arrays samples x components: what is left of an array of one impact when its first dimension is dropped."""
    return {
        name: value
        for name, value in _numeric(variables, 2).items()
        if len(AXES) <= value.shape[1] <= MAX_WIDTH and value.shape[0] > value.shape[1]
    }


def _samples(name: str, value: AnyArray) -> Samples:
    impacts, length, width = value.shape
    taken = iter(range(impacts))

    def take(count: int) -> FloatArray:
        first = next(taken)
        for _ in range(count - 1):
            next(taken)
        return value[first : first + count].astype(np.float64)

    return Samples(name, impacts, length, width, take)


def _texts_of(value: Any, impacts: int) -> list[str]:  # noqa: ANN401 - whatever a file holds
    """The texts or numbers of a variable that has one for each impact; none where it has not."""
    if not isinstance(value, np.ndarray) or value.size != impacts or max(value.shape, default=0) != impacts:
        return []
    return [_text(cell) for cell in value.reshape(-1).tolist()]


def _text(cell: Any) -> str:  # noqa: ANN401 - whatever a file holds
    if isinstance(cell, np.ndarray):
        return _text(cell.reshape(-1)[0].item()) if cell.size == 1 and cell.dtype.kind in "USfiu" else ""
    if isinstance(cell, str):
        return checked_text(cell)
    return number_text(float(cell)) if isinstance(cell, int | float) else ""


class StructTable:
    """A struct array: each element is an impact, each field a column of samples, three of them, or a fact."""

    parted = True
    units: dict[int, str] = {}  # noqa: RUF012 - a MATLAB file says none

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

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Columns]:
        """Some impacts at a time."""
        held: list[tuple[dict[int, FloatArray], dict[int, str], int]] = []
        for impact in self._impacts:
            samples = {place: self._column(impact, place) for place in numbers}
            length = min(max((values.size for values in samples.values()), default=0), MAX_LENGTH)
            held.append((samples, {place: _text(impact.get(self._columns[place][0])) for place in texts}, length))
            if sum(rows for _, _, rows in held) >= ROWS_AT_ONCE:
                yield _joined(held, numbers, texts)
                held = []
        if held:
            yield _joined(held, numbers, texts)

    def _headings_of(self, name: str) -> list[tuple[str, int | None]]:
        """A field's headings: of three components one each, of times also that with the unit that makes 1 kHz."""
        cells = [value for impact in self._impacts if _holds_samples(value := impact.get(name))]
        if cells and all(_by_samples(value).shape[1] == 3 for value in cells):
            return [(f"{name}_{axis}", part) for part, axis in enumerate(AXES)]
        if not cells or any(_by_samples(value).shape[1] != 1 for value in cells):
            return [(name, None)]
        called = [heading for heading, step in _STEPS if name == _TIME and all(_steps_by(v, step) for v in cells)]
        return [(heading, 0) for heading in (name, *called)]

    def _column(self, impact: dict[str, Any], place: int) -> FloatArray:
        name, part = self._columns[place]
        value: Any = impact.get(name)
        if part is not None and not _holds_samples(value) and _is_numeric(value):
            return np.empty(0)  # this impact has no such samples
        if part is None or not _is_numeric(value):
            raise unreadable(f"The field {name} of the struct holds no column of numbers.")
        return _by_samples(value)[:, part].astype(np.float64)


def _is_numeric(value: Any) -> TypeGuard[AnyArray]:  # noqa: ANN401 - whatever a file holds
    return isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.ndim == 2


def _holds_samples(value: Any) -> TypeGuard[AnyArray]:  # noqa: ANN401 - whatever a file holds
    """Neither nothing nor a lone number, as which MATLAB writes what is not there."""
    return _is_numeric(value) and value.size > 1


def _by_samples(value: AnyArray) -> AnyArray:
    """Samples x components, however the field lies."""
    lies_down = value.shape[0] in (1, 3) and value.shape[1] > 3
    return value.T if lies_down else value


def _steps_by(value: AnyArray, step: float) -> bool:
    steps = np.diff(_by_samples(value)[:, 0].astype(np.float64))
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
