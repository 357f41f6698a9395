"""Frames between the service and the process that parses: a JSON header and the bytes of its arrays.

Nothing is pickled: whatever a hostile file makes of the one side, the other reads names, numbers and text.
"""

from __future__ import annotations

import json
import socket
import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAX_HEADER = 32 * 1024 * 1024
MAX_PAYLOAD = 64 * 1024 * 1024
_LENGTHS = struct.Struct("<II")
_TYPES: dict[str, np.dtype[Any]] = {"f": np.dtype("<f8"), "i": np.dtype("<i4"), "b": np.dtype("u1")}

Array = NDArray[Any]


class WireError(Exception):
    """The other side is gone, broke the form of a frame, or let the deadline pass."""


@dataclass(frozen=True, slots=True)
class Frame:
    """What one side says."""

    kind: str
    fields: dict[str, Any] = field(default_factory=dict)
    arrays: Sequence[Array] = ()


class Deadline:
    """How long one side still waits for the other: only waiting counts, not what lies between."""

    def __init__(self, seconds: float | None) -> None:
        """Wait `seconds` in all; None waits for ever."""
        self._left = seconds

    def receive(self, connection: socket.socket, buffer: memoryview) -> int:
        """As :meth:`socket.socket.recv_into`, until the time is spent."""
        if self._left is not None and self._left <= 0.0:
            raise WireError("timeout")
        started = time.monotonic()
        connection.settimeout(self._left)
        try:
            return connection.recv_into(buffer)
        except OSError as error:
            raise WireError(type(error).__name__) from None
        finally:
            if self._left is not None:
                self._left -= time.monotonic() - started


def send(connection: socket.socket, frame: Frame) -> None:
    """Send a frame, waiting as long as the other side takes."""
    arrays = [np.ascontiguousarray(array) for array in frame.arrays]
    shapes = [[_letter(array), array.size] for array in arrays]
    header = json.dumps({"kind": frame.kind, "fields": frame.fields, "arrays": shapes}).encode()
    payload = sum(array.nbytes for array in arrays)
    connection.settimeout(None)
    try:
        connection.sendall(_LENGTHS.pack(len(header), payload) + header)
        for array in arrays:
            connection.sendall(array.tobytes())
    except OSError as error:
        raise WireError(type(error).__name__) from None


def receive(connection: socket.socket, deadline: Deadline) -> Frame:
    """The next frame; arrays that it announces must fill it to the byte."""
    lengths = _exactly(connection, _LENGTHS.size, deadline)
    header_size, payload_size = _LENGTHS.unpack(lengths)
    if header_size > MAX_HEADER or payload_size > MAX_PAYLOAD:
        raise WireError("too-large")
    header, payload = _exactly(connection, header_size, deadline), _exactly(connection, payload_size, deadline)
    try:
        document = json.loads(header)
        arrays = _arrays(payload, document["arrays"])
        return Frame(str(document["kind"]), dict(document["fields"]), arrays)
    except (ValueError, KeyError, TypeError, RecursionError):
        raise WireError("malformed") from None


def _letter(array: Array) -> str:
    return next(letter for letter, dtype in _TYPES.items() if array.dtype == dtype)


def _arrays(payload: bytearray, shapes: list[tuple[str, int]]) -> list[Array]:
    arrays, place = [], 0
    for letter, count in shapes:
        array: Array = np.frombuffer(payload, _TYPES[letter], count, place)
        arrays.append(array)
        place += array.nbytes
    if place != len(payload):
        raise ValueError("The arrays do not fill the frame.")
    return arrays


def _exactly(connection: socket.socket, count: int, deadline: Deadline) -> bytearray:
    held = bytearray(count)
    view, place = memoryview(held), 0
    while place < count:
        got = deadline.receive(connection, view[place:])
        if got == 0:
            raise WireError("closed")
        place += got
    return held
