"""The samples of an impact as bytes: lossless, small, and readable by every later version.

The first byte names the codec: a table of names, forms and shapes, then all arrays as one Zstandard frame (codec 2) or
zlib stream (codec 1, which is read only). Each array is stored in the first of three forms that gives every bit of it
back: whole multiples of 10^-d, as JSON and CSV write samples, as int32 differences from sample to sample; float32;
float64. Component by component (n x 3 as 3 x n), its bytes transposed so that bytes of equal weight stand together and
compress.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from threading import local
from typing import NamedTuple

import numpy as np
import zstandard
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

CODEC, ZLIB_CODEC = 2, 1
_ENTRY = struct.Struct("<BBBII")  # length of the name, form, dimensions, rows, columns
_MAX_NAME = 255

SINGLE, DOUBLE = 4, 8
"""Forms of floats, named by their bytes."""
DECIMAL = 16
"""The form of multiples of 10^-d is this plus d."""
DIGITS = (2, 4, 6)
_SCALES = np.array([10.0**digits for digits in DIGITS])[:, None]
_GLANCE = 8
_of_this_thread = local()
_TOGETHER = 64 * 1024
"""Samples that are put into their form together: what of them is held in between stays in the processor's cache."""


class TraceCodecError(ValueError):
    """The bytes are not a stored trace that this version reads."""


class _Stored(NamedTuple):
    """One array in its form, as the bytes that are compressed."""

    form: int
    plane: bytes


def encode(signals: Mapping[str, FloatArray]) -> bytes:
    """Arrays of float64 with one or two dimensions, by name, as bytes."""
    return encode_many([signals])[0]


def encode_many(items: Sequence[Mapping[str, FloatArray]]) -> list[bytes]:
    """The arrays of many impacts, those of one size put into their form together."""
    stored: list[dict[str, _Stored]] = [{} for _ in items]
    alike: dict[int, list[tuple[int, str, FloatArray]]] = {}
    for index, signals in enumerate(items):
        for name, values in signals.items():
            alike.setdefault(values.size, []).append((index, name, values))
    for size, members in alike.items():
        together = max(1, _TOGETHER // max(1, size))
        for first in range(0, len(members), together):
            part = members[first : first + together]
            forms = _in_forms(np.array([values.T.reshape(-1) for _, _, values in part], dtype=np.float64))
            for (index, name, _), form in zip(part, forms, strict=True):
                stored[index][name] = form
    return [_framed(signals, found) for signals, found in zip(items, stored, strict=True)]


def _framed(signals: Mapping[str, FloatArray], stored: Mapping[str, _Stored]) -> bytes:
    """The table of an impact's arrays, and all of them as one frame."""
    head = [_entry(name, values.shape, stored[name].form) for name, values in signals.items()]
    planes = b"".join([stored[name].plane for name in signals])
    return bytes((CODEC, len(signals))) + b"".join(head) + _compressor().compress(planes)


def _compressor() -> zstandard.ZstdCompressor:
    """This thread's own: to make one costs as much as to use it."""
    found: zstandard.ZstdCompressor | None = getattr(_of_this_thread, "compressor", None)
    if found is None:
        found = _of_this_thread.compressor = zstandard.ZstdCompressor(write_checksum=True)
    return found


def _in_forms(rows: FloatArray) -> list[_Stored]:
    """Rows in the smallest form from which every bit comes back: what is written in decimals is no float32."""
    found: dict[int, _Stored] = {}
    digits = _digits(rows[:, :_GLANCE])
    with np.errstate(over="ignore", invalid="ignore"):  # a form that cannot hold a value is not the one chosen
        for form in {few for few in digits if few is not None}:
            chosen = [row for row, few in enumerate(digits) if few == form]
            values = _chosen(rows, chosen)
            whole = np.rint(values * 10.0**form).astype(np.int32)
            same = _same_rows(whole / 10.0**form, values)  # neither -0.0 nor a multiple beyond int32 comes back
            found.update(_planes(chosen, same, DECIMAL + form, _differences(whole)))
        rest = [row for row in range(len(rows)) if row not in found]
        if rest:
            values = _chosen(rows, rest)
            single = values.astype(np.float32)
            found.update(_planes(rest, _same_rows(single.astype(np.float64), values), SINGLE, single))
            found.update(_planes(rest, [row not in found for row in rest], DOUBLE, values))
    return [found[row] for row in range(len(rows))]


def _chosen(rows: FloatArray, chosen: list[int]) -> FloatArray:
    return rows if len(chosen) == len(rows) else rows[chosen]


def _digits(few: FloatArray) -> list[int | None]:
    """How many decimals the samples of each row may have, by a glance at the first few; None for none of ours."""
    scaled = few[:, None] * _SCALES
    may_be = (np.rint(scaled) / _SCALES == few[:, None]).all(axis=2)
    return [next((digits for digits, fits in zip(DIGITS, row, strict=True) if fits), None) for row in may_be.tolist()]


def _same_rows(found: FloatArray, values: FloatArray) -> list[bool]:
    """Of each row, whether all of it is the same."""
    same: list[bool] = (found.view(np.int64) == values.view(np.int64)).all(axis=1).tolist()
    return same


def _differences(whole: NDArray[np.int32]) -> NDArray[np.int32]:
    """From sample to sample of each row, the first as it is. Beyond the range of int32 they wrap, there and back."""
    steps = whole.copy()
    steps[:, 1:] -= whole[:, :-1]
    return steps


def _planes(
    rows: list[int],
    fit: list[bool],
    form: int,
    stored: NDArray[np.float32] | NDArray[np.float64] | NDArray[np.int32],
) -> Iterator[tuple[int, _Stored]]:
    """The bytes of each row that fits the form, those of equal weight together."""
    count, size = stored.shape
    planes = stored.view(np.uint8).reshape(count, size, stored.itemsize).transpose(0, 2, 1).tobytes()
    length = size * stored.itemsize
    for place, (row, fits) in enumerate(zip(rows, fit, strict=True)):
        if fits:
            yield row, _Stored(form, planes[place * length : (place + 1) * length])


@lru_cache(maxsize=256)
def _entry(name: str, shape: tuple[int, ...], form: int) -> bytes:
    label = name.encode()
    if len(label) > _MAX_NAME or len(shape) not in {1, 2}:
        raise TraceCodecError("A signal has a name of up to 255 bytes and one or two dimensions.")
    rows, columns = shape if len(shape) == 2 else (shape[0], 1)
    return _ENTRY.pack(len(label), form, len(shape), rows, columns) + label


def decode(data: bytes) -> dict[str, FloatArray]:
    """The arrays of :func:`encode`, bit for bit."""
    try:
        return _decode(data)
    except (struct.error, zlib.error, zstandard.ZstdError, IndexError, UnicodeDecodeError) as error:
        raise TraceCodecError("The stored trace is damaged.") from error


def _expand_frame(compressed: memoryview) -> bytes:
    return zstandard.ZstdDecompressor().decompress(compressed)


_EXPAND: dict[int, Callable[[memoryview], bytes]] = {CODEC: _expand_frame, ZLIB_CODEC: zlib.decompress}


def _decode(data: bytes) -> dict[str, FloatArray]:
    if data[0] not in _EXPAND:
        raise TraceCodecError("The stored trace was written by a codec that this version does not know.")
    entries = []
    offset = 2
    for _ in range(data[1]):
        length, *form = _ENTRY.unpack_from(data, offset)
        offset += _ENTRY.size
        entries.append((data[offset : offset + length].decode(), *form))
        offset += length
    return _arrays(entries, _EXPAND[data[0]](memoryview(data)[offset:]))


def _arrays(entries: list[tuple[str, int, int, int, int]], payload: bytes) -> dict[str, FloatArray]:
    arrays = {}
    offset = 0
    for name, form, dimensions, rows, columns in entries:
        if form not in {SINGLE, DOUBLE, *(DECIMAL + digits for digits in DIGITS)} or dimensions not in {1, 2}:
            raise TraceCodecError("The stored trace is damaged.")
        shape = (rows,) if dimensions == 1 else (columns, rows)
        end = offset + (DOUBLE if form == DOUBLE else SINGLE) * math.prod(shape)
        arrays[name] = _widened(payload[offset:end], form, shape)
        offset = end
    if offset != len(payload):
        raise TraceCodecError("The stored trace is damaged.")
    return arrays


def _widened(plane: bytes, form: int, shape: tuple[int, ...]) -> FloatArray:
    """One array from its transposed bytes."""
    kind = {SINGLE: "<f4", DOUBLE: "<f8"}.get(form, "<i4")
    size = int(kind[2])
    if len(plane) != size * math.prod(shape):
        raise TraceCodecError("The stored trace is damaged.")
    stored = np.ascontiguousarray(np.frombuffer(plane, dtype=np.uint8).reshape(size, -1).T).reshape(-1).view(kind)
    if form > DECIMAL:
        stored = np.add.accumulate(stored, dtype=np.int32) / 10.0 ** (form - DECIMAL)
    return np.ascontiguousarray(stored.reshape(shape).T, dtype=np.float64)
