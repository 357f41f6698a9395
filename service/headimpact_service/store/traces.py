"""The samples of an impact as bytes: lossless, small, and readable by every later version.

The first byte names the codec. Codec 1: a table of names, types and shapes, then one zlib stream of all arrays. An
array is stored as float32 when that is exact for every sample, else as float64, component by component (n x 3 as
3 x n), its bytes transposed so that bytes of equal weight stand together and compress.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

CODEC = 1
_LEVEL = 1  # of zlib: level 6 costs three times as much time for 2 % of the size
_ENTRY = struct.Struct("<BBBII")  # length of the name, item size, dimensions, rows, columns
_MAX_NAME = 255


class TraceCodecError(ValueError):
    """The bytes are not a stored trace that this version reads."""


def encode(signals: Mapping[str, NDArray[np.float64]]) -> bytes:
    """Arrays of float64 with one or two dimensions, by name, as bytes."""
    header = bytearray((CODEC, len(signals)))
    planes = []
    for name, values in signals.items():
        stored = _narrow(np.asarray(values, dtype=np.float64))
        header += _entry(name, stored)
        planes.append(stored.T.reshape(-1).view(np.uint8).reshape(-1, stored.itemsize).T.tobytes())
    return bytes(header) + zlib.compress(b"".join(planes), _LEVEL)


def _narrow(values: NDArray[np.float64]) -> NDArray[np.float32] | NDArray[np.float64]:
    """The values as float32 if every bit comes back, else as they are."""
    with np.errstate(over="ignore", invalid="ignore"):
        single = values.astype(np.float32)
    same = np.array_equal(single.astype(np.float64).view(np.uint64), values.view(np.uint64))
    return single if same else values


def _entry(name: str, stored: NDArray[np.float32] | NDArray[np.float64]) -> bytes:
    label = name.encode()
    if len(label) > _MAX_NAME or stored.ndim not in {1, 2}:
        raise TraceCodecError("A signal has a name of up to 255 bytes and one or two dimensions.")
    rows, columns = stored.shape if stored.ndim == 2 else (stored.shape[0], 1)
    return _ENTRY.pack(len(label), stored.itemsize, stored.ndim, rows, columns) + label


def decode(data: bytes) -> dict[str, NDArray[np.float64]]:
    """The arrays of :func:`encode`, bit for bit."""
    try:
        return _decode(data)
    except (struct.error, zlib.error, IndexError, UnicodeDecodeError) as error:
        raise TraceCodecError("The stored trace is damaged.") from error


def _decode(data: bytes) -> dict[str, NDArray[np.float64]]:
    if data[0] != CODEC:
        raise TraceCodecError("The stored trace was written by a codec that this version does not know.")
    entries = []
    offset = 2
    for _ in range(data[1]):
        length, *form = _ENTRY.unpack_from(data, offset)
        offset += _ENTRY.size
        entries.append((data[offset : offset + length].decode(), *form))
        offset += length
    return _arrays(entries, zlib.decompress(memoryview(data)[offset:]))


def _arrays(entries: list[tuple[str, int, int, int, int]], payload: bytes) -> dict[str, NDArray[np.float64]]:
    arrays = {}
    offset = 0
    for name, size, dimensions, rows, columns in entries:
        if size not in {4, 8} or dimensions not in {1, 2}:
            raise TraceCodecError("The stored trace is damaged.")
        shape = (rows,) if dimensions == 1 else (columns, rows)
        end = offset + size * math.prod(shape)
        arrays[name] = _widen(payload[offset:end], size, shape)
        offset = end
    if offset != len(payload):
        raise TraceCodecError("The stored trace is damaged.")
    return arrays


def _widen(plane: bytes, size: int, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """One array from its transposed bytes."""
    if len(plane) != size * math.prod(shape):
        raise TraceCodecError("The stored trace is damaged.")
    shuffled = np.frombuffer(plane, dtype=np.uint8).reshape(size, -1).T
    stored = np.ascontiguousarray(shuffled).reshape(-1).view(f"<f{size}").reshape(shape)
    return np.ascontiguousarray(stored.T, dtype=np.float64)
