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
from collections.abc import Callable, Mapping
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


class TraceCodecError(ValueError):
    """The bytes are not a stored trace that this version reads."""


class _Stored(NamedTuple):
    """An array in its form: `plane` is one-dimensional, component by component."""

    form: int
    shape: tuple[int, ...]
    plane: NDArray[np.float32] | NDArray[np.float64] | NDArray[np.int32]


def encode(signals: Mapping[str, FloatArray]) -> bytes:
    """Arrays of float64 with one or two dimensions, by name, as bytes."""
    header = bytearray((CODEC, len(signals)))
    planes = []
    with np.errstate(over="ignore", invalid="ignore"):  # a form that cannot hold a value is not the one chosen
        for name, values in signals.items():
            stored = _stored(np.asarray(values, dtype=np.float64))
            header += _entry(name, stored)
            planes.append(stored.plane.view(np.uint8).reshape(-1, stored.plane.itemsize).T.tobytes())
    return bytes(header) + zstandard.ZstdCompressor(write_checksum=True).compress(b"".join(planes))


def _stored(values: FloatArray) -> _Stored:
    """The values in the smallest form from which every bit comes back: what is written in decimals is no float32."""
    rows = np.ascontiguousarray(values.T)
    digits = _digits(rows)
    if digits is not None:
        whole = np.rint(rows * 10.0**digits).astype(np.int32)
        if _same_bits(whole / 10.0**digits, rows):  # neither -0.0 nor a multiple beyond int32 comes back
            return _Stored(DECIMAL + digits, values.shape, _differences(whole))
    single = rows.astype(np.float32)
    if _same_bits(single.astype(np.float64), rows):
        return _Stored(SINGLE, values.shape, single.reshape(-1))
    return _Stored(DOUBLE, values.shape, rows.reshape(-1))


def _digits(rows: FloatArray) -> int | None:
    """How many decimals the samples may have, by a glance at the first few."""
    few = rows.reshape(-1)[:_GLANCE].tolist()
    return next((digits for digits in DIGITS if all(round(value, digits) == value for value in few)), None)


def _same_bits(found: FloatArray, values: FloatArray) -> bool:
    return found.tobytes() == values.tobytes()


def _differences(whole: NDArray[np.int32]) -> NDArray[np.int32]:
    """From sample to sample, the first as it is. Beyond the range of int32 they wrap, there and back."""
    flat = whole.reshape(-1)
    steps = flat.copy()
    steps[1:] -= flat[:-1]
    return steps


def _entry(name: str, stored: _Stored) -> bytes:
    label = name.encode()
    if len(label) > _MAX_NAME or len(stored.shape) not in {1, 2}:
        raise TraceCodecError("A signal has a name of up to 255 bytes and one or two dimensions.")
    rows, columns = stored.shape if len(stored.shape) == 2 else (stored.shape[0], 1)
    return _ENTRY.pack(len(label), stored.form, len(stored.shape), rows, columns) + label


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
