"""NumPy archives: plain arrays only. An array of Python objects would be a pickle, and is refused by its header."""

from __future__ import annotations

import io
import tokenize
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from headimpact_service.ingest.cells import number_text
from headimpact_service.ingest.guarded.array_table import AXES, ArrayTable, Fact, Samples
from headimpact_service.ingest.guarded.contents import MAX_TEXT, Content, NamedTable, checked_text, unreadable
from headimpact_service.ingest.guarded.stated_units import unit_of
from headimpact_service.ingest.table import FloatArray
from headimpact_service.ingest.zip_guard import GuardedZip

SUFFIX = ".npy"
MAX_HEADER = 4096
MAX_FACTS = 16 * 1024 * 1024
MAX_WIDTH = 64
MOST_COMPONENTS = 8
"""Of one signal: its axes and their resultant, of two sensors."""
_TIMES = ("t", "time", "stamp")


@dataclass(frozen=True, slots=True)
class _Member:
    """One array of the archive, by its header."""

    name: str
    file: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    by_columns: bool
    header: int

    @property
    def is_text(self) -> bool:
        """Whether its cells are text or times."""
        return self.dtype.kind in "USM"

    @property
    def is_unit(self) -> bool:
        """Whether it says the unit of another array."""
        return self.is_text and self.shape == () and unit_of(self.name) is not None


def contents(stream: BinaryIO) -> Iterator[Content]:
    """All arrays of the archive as one table."""
    archive = GuardedZip(stream)
    members = [_member(archive, name) for name in archive.names]
    units = {member.name: _texts(archive, member)[0] for member in members if member.is_unit}
    yield NamedTable(None, _table(archive, [member for member in members if not member.is_unit], units))


def warm_up() -> None:
    """Read a file of our own, so that every library is loaded."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, a=np.zeros((2, 3, 3)), external_id=np.array(["x", "y"]), a_unit=np.array("g"))
    for content in contents(buffer):
        if isinstance(content, NamedTable):
            list(content.table.blocks([0], [3]))


def _member(archive: GuardedZip, file: str) -> _Member:
    if not file.endswith(SUFFIX):
        raise unreadable("An npz archive holds nothing but arrays (.npy).")
    with archive.open(file) as stream:
        try:
            version = np.lib.format.read_magic(stream)
            read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
            shape, by_columns, dtype = read(stream, max_header_size=MAX_HEADER)
        except (ValueError, KeyError, SyntaxError, RecursionError, EOFError, tokenize.TokenError):
            raise unreadable("The header of an array in the npz archive is broken.") from None
        header = stream.tell()
    if dtype.hasobject:
        raise unreadable("The npz archive holds Python objects (pickles), which are never read: save plain arrays.")
    if dtype.kind not in "fiubUSM":
        raise unreadable("The arrays of an npz archive hold numbers, text or times.")
    member = _Member(file.removesuffix(SUFFIX), file, tuple(shape), dtype, by_columns, header)
    if member.header + _size(member) != archive.size(file):
        raise unreadable("The size of an array in the npz archive is not the one its header says.")
    return member


def _size(member: _Member) -> int:
    size = int(member.dtype.itemsize)
    for count in member.shape:
        size *= count
    return size


def _table(archive: GuardedZip, members: list[_Member], units: dict[str, str]) -> ArrayTable:
    shaped = [member for member in members if not member.is_text and len(member.shape) in (2, 3)]
    if not shaped:
        return _by_channel(archive, members, units)
    if any(len(member.shape) > 3 for member in members):
        raise unreadable("An array has at most three dimensions: impacts x samples x components.")
    several = _are_of_several(shaped)
    samples = [_samples(archive, member, several=several) for member in shaped]
    impacts, lengths = samples[0].impacts, {array.length for array in samples}
    facts: list[Fact] = []
    for member in members:
        if len(member.shape) == 1 and not member.is_text and _is_along_samples(member, impacts, lengths):
            samples.append(_repeated(archive, member, impacts))
        elif len(member.shape) <= 1:
            facts.append(_fact(archive, member, impacts))
    # A signal's own times are looked for before it.
    samples.sort(key=lambda array: array.width != 1)
    return ArrayTable(samples, facts, units)


def _by_channel(archive: GuardedZip, members: list[_Member], units: dict[str, str]) -> ArrayTable:
    """One impact, an array for each channel: rows of numbers of one length, and facts beside them."""
    rows = [member for member in members if not member.is_text and len(member.shape) == 1 and member.shape[0] > 1]
    if not rows:
        raise unreadable("The npz archive holds no array of samples: impacts x samples x components.")
    if len({member.shape for member in rows}) > 1:
        raise unreadable("The arrays of the channels differ in length.")
    facts = [_fact(archive, member, 1) for member in members if member not in rows]
    return ArrayTable([_repeated(archive, member, 1) for member in rows], facts, units)


def _are_of_several(shaped: list[_Member]) -> bool:
    """Whether arrays of two dimensions are impacts x samples, and not the samples x components of one impact.

    They are beside an array of three, and where each component of a signal is an array: three or more of one shape,
    wider than any signal has components.
    """
    if any(len(member.shape) == 3 for member in shaped):
        return True
    shapes = {member.shape for member in shaped}
    return len(shaped) >= len(AXES) and len(shapes) == 1 and shaped[0].shape[1] > MOST_COMPONENTS


def _is_along_samples(member: _Member, impacts: int, lengths: set[int]) -> bool:
    """Whether a plain row of numbers has one for each sample; where both fit, times do."""
    if member.shape[0] not in lengths:
        return False
    return member.shape[0] != impacts or member.name.lower().startswith(_TIMES)


def _samples(archive: GuardedZip, member: _Member, *, several: bool) -> Samples:
    """An array of samples: three dimensions as they are; two of them one impact's, or one component of several."""
    if member.by_columns and _size(member) > MAX_FACTS:
        raise unreadable("A large array must be stored by rows (C order).")
    if len(member.shape) == 3:
        impacts, length, width = member.shape
    elif several:
        (impacts, length), width = member.shape, 1
    else:
        impacts, (length, width) = 1, member.shape
    if width > MAX_WIDTH or width < 1:
        raise unreadable(f"The last dimension of an array of samples is its 1 to {MAX_WIDTH} components.")
    stream = _Rows(archive, member, (length, width))
    return Samples(member.name, impacts, length, width, stream.take)


def _repeated(archive: GuardedZip, member: _Member, impacts: int) -> Samples:
    """A row of numbers that all impacts share, as times; of a single impact, a channel."""
    row = _numbers(archive, member).reshape(1, -1, 1)
    return Samples(member.name, impacts, row.shape[1], 1, lambda count: np.repeat(row, count, axis=0))


def _fact(archive: GuardedZip, member: _Member, impacts: int) -> Fact:
    if member.shape not in ((), (1,), (impacts,)):
        raise unreadable("An array of one dimension has a value for each impact or for each sample.")
    if member.is_text:
        return Fact(member.name, None, _texts(archive, member))
    numbers = _numbers(archive, member)
    return Fact(member.name, numbers, [number_text(number) for number in numbers.reshape(-1).tolist()])


class _Rows:
    """An array read impact by impact, as it inflates."""

    def __init__(self, archive: GuardedZip, member: _Member, shape: tuple[int, int]) -> None:
        self._archive, self._member, self._shape = archive, member, shape
        self._open = ExitStack()
        self._stream: BinaryIO | None = None
        self._held: FloatArray | None = None
        self._taken = 0

    def take(self, count: int) -> FloatArray:
        """The samples of the next `count` impacts."""
        if self._member.by_columns:
            return self._from_whole(count)
        if self._stream is None:
            self._stream = self._open.enter_context(self._archive.open(self._member.file))
            self._stream.read(self._member.header)
        length, width = self._shape
        wanted = count * length * width * self._member.dtype.itemsize
        data = self._stream.read(wanted)
        if len(data) != wanted:
            raise unreadable("An array of the npz archive is cut off.")
        return np.frombuffer(data, self._member.dtype).astype(np.float64).reshape(count, length, width)

    def _from_whole(self, count: int) -> FloatArray:
        if self._held is None:
            self._held = _numbers(self._archive, self._member).reshape(-1, *self._shape)
        self._taken += count
        return self._held[self._taken - count : self._taken]


def _numbers(archive: GuardedZip, member: _Member) -> FloatArray:
    return _whole(archive, member).astype(np.float64)


def _texts(archive: GuardedZip, member: _Member) -> list[str]:
    """Text as it is; times as RFC 3339 has them, in UTC."""
    if member.dtype.itemsize > 4 * MAX_TEXT:
        raise unreadable(f"A text may have at most {MAX_TEXT} characters.")
    values = _whole(archive, member).reshape(-1)
    if member.dtype.kind == "M":
        return ["" if text == "NaT" else f"{text}Z" for text in np.datetime_as_string(values, unit="us").tolist()]
    cells = values.tolist()
    texts = [checked_text(cell.decode("latin-1") if isinstance(cell, bytes) else cell) for cell in cells]
    return texts or [""]


def _whole(archive: GuardedZip, member: _Member) -> np.ndarray[Any, np.dtype[Any]]:
    if _size(member) > MAX_FACTS:
        raise unreadable(f"Only arrays of samples may have more than {MAX_FACTS} bytes.")
    with archive.open(member.file) as stream:
        stream.read(member.header)
        data = stream.read(_size(member))
    if len(data) != _size(member):
        raise unreadable("An array of the npz archive is cut off.")
    array = np.frombuffer(data, member.dtype)
    return array.reshape(member.shape, order="F" if member.by_columns else "C")
