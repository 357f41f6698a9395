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
_GLANCE = 8
_MANY = 4
"""Impacts from which on it is cheaper to put them together."""
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
    header = bytearray((CODEC, len(signals)))
    planes = []
    with np.errstate(over="ignore", invalid="ignore"):  # a form that cannot hold a value is not the one chosen
        for name, values in signals.items():
            stored = _stored(np.asarray(values, dtype=np.float64))
            header += _entry(name, values.shape, stored.form)
            planes.append(stored.plane)
    return bytes(header) + zstandard.ZstdCompressor(write_checksum=True).compress(b"".join(planes))


def _stored(values: FloatArray) -> _Stored:
    """The values in the smallest form from which every bit comes back: what is written in decimals is no float32."""
    rows = np.ascontiguousarray(values.T)
    digits = _digits(rows)
    if digits is not None:
        whole = np.rint(rows * 10.0**digits).astype(np.int32)
        if _same_bits(whole / 10.0**digits, rows):  # neither -0.0 nor a multiple beyond int32 comes back
            return _Stored(DECIMAL + digits, _plane(_differences(whole.reshape(-1))))
    single = rows.astype(np.float32)
    if _same_bits(single.astype(np.float64), rows):
        return _Stored(SINGLE, _plane(single.reshape(-1)))
    return _Stored(DOUBLE, _plane(rows.reshape(-1)))


def _plane(stored: NDArray[np.float32] | NDArray[np.float64] | NDArray[np.int32]) -> bytes:
    """The bytes of an array, those of equal weight together."""
    return stored.view(np.uint8).reshape(-1, stored.itemsize).T.tobytes()


def _digits(rows: FloatArray) -> int | None:
    """How many decimals the samples may have, by a glance at the first few."""
    few = rows.reshape(-1)[:_GLANCE].tolist()
    return next((digits for digits in DIGITS if all(round(value, digits) == value for value in few)), None)


def _same_bits(found: FloatArray, values: FloatArray) -> bool:
    return found.tobytes() == values.tobytes()


def encode_many(items: Sequence[Mapping[str, FloatArray]]) -> list[bytes]:
    """The arrays of many impacts, each as :func:`encode` has them; those of equal names and shapes are put together."""
    if len(items) < _MANY:
        return [encode(signals) for signals in items]
    groups: dict[tuple[tuple[str, tuple[int, ...]], ...], list[int]] = {}
    for index, signals in enumerate(items):
        groups.setdefault(tuple((name, values.shape) for name, values in signals.items()), []).append(index)
    compress = zstandard.ZstdCompressor(write_checksum=True).compress
    encoded = [b""] * len(items)
    for layout, members in groups.items():
        columns = [_stored_many([items[index][name] for index in members]) for name, _ in layout]
        for index, *arrays in zip(members, *columns, strict=True):
            head = [_entry(name, shape, stored.form) for (name, shape), stored in zip(layout, arrays, strict=True)]
            planes = b"".join([stored.plane for stored in arrays])
            encoded[index] = bytes((CODEC, len(layout))) + b"".join(head) + compress(planes)
    return encoded


def _stored_many(arrays: Sequence[FloatArray]) -> list[_Stored]:
    """Arrays of one shape in their forms."""
    together = max(1, _TOGETHER // max(1, arrays[0].size))
    stored: list[_Stored] = []
    with np.errstate(over="ignore", invalid="ignore"):  # a form that cannot hold a value is not the one chosen
        for first in range(0, len(arrays), together):
            rows = [np.asarray(values, dtype=np.float64).T.reshape(-1) for values in arrays[first : first + together]]
            stored += _in_forms(np.stack(rows))
    return stored


def _in_forms(rows: FloatArray) -> list[_Stored]:
    """Rows in the smallest form from which every bit comes back: what is written in decimals is no float32."""
    found: dict[int, _Stored] = {}
    digits = _digits_many(rows[:, :_GLANCE])
    for form in DIGITS:
        of_form = np.flatnonzero(digits == form)
        if of_form.size:
            values = rows[of_form]
            whole = np.rint(values * 10.0**form).astype(np.int32)
            same = _same_rows(whole / 10.0**form, values)  # neither -0.0 nor a multiple beyond int32 comes back
            found.update(_planes(of_form[same], DECIMAL + form, _differences(whole[same])))
    rest = np.array([row for row in range(len(rows)) if row not in found], dtype=np.intp)
    if rest.size:
        values = rows[rest]
        single = values.astype(np.float32)
        same = _same_rows(single.astype(np.float64), values)
        found.update(_planes(rest[same], SINGLE, single[same]))
        found.update(_planes(rest[~same], DOUBLE, values[~same]))
    return [found[row] for row in range(len(rows))]


def _digits_many(few: FloatArray) -> NDArray[np.int64]:
    """How many decimals the samples of each row may have, by a glance at the first few; -1 for none of ours."""
    digits = np.full(len(few), -1, dtype=np.int64)
    for form in reversed(DIGITS):
        digits[(np.rint(few * 10.0**form) / 10.0**form == few).all(axis=1)] = form
    return digits


def _same_rows(found: FloatArray, values: FloatArray) -> NDArray[np.bool_]:
    """Of each row, whether all of it is the same."""
    same: NDArray[np.bool_] = (found.view(np.int64) == values.view(np.int64)).all(axis=1)
    return same


def _differences(whole: NDArray[np.int32]) -> NDArray[np.int32]:
    """From sample to sample of each row, the first as it is. Beyond the range of int32 they wrap, there and back."""
    steps = whole.copy()
    steps[..., 1:] -= whole[..., :-1]
    return steps


def _planes(
    rows: NDArray[np.intp], form: int, stored: NDArray[np.float32] | NDArray[np.float64] | NDArray[np.int32]
) -> Iterator[tuple[int, _Stored]]:
    """The bytes of each row, those of equal weight together."""
    count, size = stored.shape
    parted = stored.view(np.uint8).reshape(count, size, stored.itemsize).transpose(0, 2, 1)
    for row, plane in zip(rows.tolist(), np.ascontiguousarray(parted), strict=True):
        yield row, _Stored(form, plane.tobytes())


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
