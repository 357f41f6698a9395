"""MATLAB files of version 5 to 7.2: arrays impacts x samples x components, and struct arrays with an element an impact.

Matrices are inflated once without being kept, to count what they hold, before anything is made of them.
"""

from __future__ import annotations

import io
import zlib
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np
from scipy.io import loadmat, savemat

from headimpact_service.ingest.guarded.array_table import AXES, ArrayTable, Fact, Samples
from headimpact_service.ingest.guarded.contents import Content, NamedTable, unreadable
from headimpact_service.ingest.guarded.mat_struct import (
    MAX_WIDTH,
    TIMES,
    AnyArray,
    StructTable,
    by_samples,
    called_by,
    holds_samples,
    text_of,
)
from headimpact_service.ingest.guarded.stated_units import unit_of
from headimpact_service.ingest.table import FloatArray

MAX_INFLATED = 32 * 1024 * 1024
MAX_ELEMENTS = 10_000
MAX_DEPTH = 8
"""Of structs within structs."""
_FEW = 8
ALONE = "array"
"""The other name of an array that is the only one."""
_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_BLOCK = 64 * 1024


def contents(stream: BinaryIO) -> Iterator[Content]:
    """The impacts of a file's struct array, or else those of its arrays of samples."""
    _require_small(stream)
    stream.seek(0)
    document: dict[str, Any] = loadmat(stream)  # type: ignore[arg-type] # the stubs know of paths only
    variables = _with_facts({name: value for name, value in document.items() if not name.startswith("__")})
    structs = [value for value in variables.values() if _is_struct(value)]
    cells = {name: value for name, value in variables.items() if _is_cells(value)}
    if structs:
        shared = _shared_by_all(variables)
        for struct in structs:
            elements, within = _elements(struct)
            yield NamedTable(None, _table_of([shared | within | _fields(element) for element in elements]))
    elif cells:
        shared = _shared_by_all(variables)
        for name, value in cells.items():
            yield NamedTable(None, _table_of([shared | _of_cell(name, cell) for cell in value.reshape(-1)]))
    else:
        yield NamedTable(None, _arrays(variables))


def _with_facts(variables: dict[str, Any]) -> dict[str, Any]:
    """The variables, where some are arrays of samples, with the fields of structs that hold none in their place.

    Such a struct says something of all of them: a rate, the athlete, or by their names the units.
    """
    if not any(isinstance(value, np.ndarray) and _is_long(value) for value in variables.values()):
        return variables
    told = {name: value for name, value in variables.items() if _is_struct(value) and not _holds_long(value)}
    facts = [
        _flat(struct.reshape(-1)[0], "" if unit_of(name) is None else f"{name}_")
        for name, struct in told.items()
        if struct.size == 1
    ]
    rest = {name: value for name, value in variables.items() if name not in told}
    return {name: fact for fields in facts for name, fact in fields.items()} | rest


def _is_long(value: AnyArray) -> bool:
    """Whether it may be samples: more numbers than a setting has."""
    return value.dtype.kind in "fiu" and max(value.shape, default=0) > _FEW


def _holds_long(struct: AnyArray, depth: int = 0) -> bool:
    """Whether a struct, or one within it, holds what may be samples."""
    cells = [record[name] for record in struct.reshape(-1) for name in struct.dtype.names or ()]
    arrays = [cell for cell in cells if isinstance(cell, np.ndarray)]
    return any(
        _is_long(cell) or (_is_struct(cell) and depth < MAX_DEPTH and _holds_long(cell, depth + 1)) for cell in arrays
    )


def _table_of(impacts: list[dict[str, Any]]) -> ArrayTable | StructTable:
    """The impacts of a struct array; a single struct may hold the arrays of many."""
    if len(impacts) == 1 and _numeric(impacts[0], 3):
        return _arrays(impacts[0])
    return StructTable(impacts)


def _is_cells(value: Any) -> bool:  # noqa: ANN401 - whatever a file holds
    """Whether a variable is a cell array with an impact in each cell: a struct, or samples x components."""
    if not isinstance(value, np.ndarray) or value.dtype != object or not value.size:
        return False
    cells = value.reshape(-1)
    return all(_is_struct(cell) and cell.size == 1 for cell in cells) or all(
        holds_samples(cell) and by_samples(cell).shape[1] >= len(AXES) for cell in cells
    )


def _of_cell(name: str, cell: AnyArray) -> dict[str, Any]:
    """The fields of the impact in a cell; six components have the other name too."""
    if _is_struct(cell):
        return _flat(cell.reshape(-1)[0])
    return {name: cell, ALONE: cell} if by_samples(cell).shape[1] == 2 * len(AXES) else {name: cell}


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
        if kind not in {_MATRIX, _COMPRESSED}:
            raise unreadable("Behind a variable of the MATLAB file stands what is none: the file is broken.")
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
    """Every array impacts x samples x components, or else samples x components, or else a row of samples a channel.

    Of one alone that has six components the columns are also called array_1 to array_6.
    """
    numbers = _numeric(variables, 2)
    solid = _numeric(variables, 3) or {name: value[np.newaxis] for name, value in _of_one_impact(variables).items()}
    if not solid:
        solid = {name: value.reshape(1, -1, 1) for name, value in numbers.items() if _is_row(value)}
    if not solid:
        raise unreadable(
            "The MATLAB file holds neither a struct array nor an array impacts x samples x components, nor rows of "
            "samples."
        )
    if any(value.shape[2] > MAX_WIDTH for value in solid.values()):
        raise unreadable(f"The last dimension of an array of samples is its 1 to {MAX_WIDTH} components.")
    impacts, length = next(iter(solid.values())).shape[:2]
    samples = [_samples(name, value) for name, value in solid.items()]
    if len(solid) == 1 and ALONE not in solid and samples[0].width == 2 * len(AXES):
        samples.append(_samples(ALONE, next(iter(solid.values()))))
    beside = {name: value for name, value in numbers.items() if name not in solid}
    fitted = ((name, _shared(name, value, impacts, length)) for name, value in beside.items())
    shared = {name: found for name, found in fitted if found is not None}
    clocks = [_samples(called, found) for name, found in shared.items() for called in called_by(name, found)]
    facts = [
        Fact(name, None, texts)
        for name, value in variables.items()
        if name not in shared and (texts := _texts_of(value, impacts))
    ]
    units = {fact.name: fact.texts[0] for fact in facts}
    of_alone = (text for name, text in units.items() if unit_of(name) == next(iter(solid)).lower())
    return ArrayTable([*clocks, *samples], facts, units | {f"{ALONE}_unit": text for text in of_alone})


def _is_row(value: AnyArray) -> bool:
    return 1 in value.shape and value.size > 1


def _shared(name: str, value: AnyArray, impacts: int, length: int) -> AnyArray | None:
    """A channel beside the samples: a value for each sample of each impact, or for each sample of all of them."""
    if value.shape == (impacts, length) and impacts > 1:
        return value[:, :, np.newaxis]
    if not _is_row(value) or value.size != length or (value.size == impacts and name.lower() not in TIMES):
        return None
    return np.broadcast_to(value.reshape(1, -1, 1), (impacts, length, 1))


def _shared_by_all(fields: dict[str, Any]) -> dict[str, Any]:
    """What is said once for all impacts beside them: lone numbers and texts, and rows of times."""
    return {name: value for name, value in fields.items() if isinstance(value, np.ndarray) and _is_shared(name, value)}


def _is_shared(name: str, value: AnyArray) -> bool:
    if value.size == 1:
        return value.dtype.kind in "USfiu"
    return value.ndim == 2 and value.dtype.kind in "fiu" and _is_row(value) and name.lower().startswith(TIMES)


def _elements(struct: AnyArray) -> tuple[AnyArray, dict[str, Any]]:
    """The impacts of a struct array, which may be the only one of many elements within a session's struct.

    With them what that struct says once for all of them.
    """
    many = _of_many(struct)
    if len(many) != 1 or many[0] is struct:
        return struct.reshape(-1), {}
    session = struct.reshape(-1)[0]
    return many[0].reshape(-1), _shared_by_all({name: session[name] for name in session.dtype.names})


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


def _fields(record: Any) -> dict[str, Any]:  # noqa: ANN401 - a record of a struct array
    """The fields of one impact, or of a session's struct that holds one impact: then by that one's own names too."""
    inner = [value for name in record.dtype.names if _is_struct(value := record[name]) and value.size == 1]
    if len(inner) != 1 or any(holds_samples(record[name]) for name in record.dtype.names):
        return _flat(record)
    return _flat(inner[0].reshape(-1)[0]) | _flat(record)


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
    """The texts or numbers of a variable that has one for each impact, or for all; none where it has not."""
    if not isinstance(value, np.ndarray) or value.size not in {1, impacts} or max(value.shape, default=0) != value.size:
        return []
    return [text_of(cell) for cell in value.reshape(-1).tolist()]
