"""Zip archives from strangers: refused by their directory before anything inflates, and read under a budget.

Nothing is ever written to disk, so a path cannot lead out of a folder; paths that try are refused all the same, as are
links, encrypted entries and any method but stored and deflated.
"""

from __future__ import annotations

import io
import re
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import PurePosixPath
from typing import BinaryIO, cast

from headimpact_service.errors import Problem

MAX_ENTRIES = 4096
MAX_DIRECTORY = 2 * 1024 * 1024
MAX_ENTRY = 64 * 1024 * 1024
MAX_TOTAL = 1024 * 1024 * 1024
MAX_READ = 256 * 1024 * 1024
MAX_RATIO = 200
RATIO_FROM = 1024 * 1024
"""Bytes: a smaller entry may be as repetitive as it likes."""

_END = b"PK\x05\x06"
_END_SIZE = 22
_METHODS = frozenset({zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED})


class GuardedZip:
    """An archive whose directory keeps to the bounds; :meth:`read` keeps to them as well."""

    def __init__(self, content: bytes | BinaryIO) -> None:
        """Read and judge the directory.

        Raises
        ------
        Problem
            422 for an archive that is broken or breaks a bound.
        """
        stream = io.BytesIO(content) if isinstance(content, bytes) else content
        _require_small_directory(stream)
        try:
            self._archive = zipfile.ZipFile(stream)
            entries = self._archive.infolist()
        except (zipfile.BadZipFile, ValueError, struct.error, NotImplementedError, EOFError, OverflowError):
            raise _unreadable("The zip archive is broken.") from None
        if len(entries) > MAX_ENTRIES:
            raise _unreadable(f"A zip archive may have at most {MAX_ENTRIES} entries.")
        for entry in entries:
            _require_harmless(entry)
        if sum(entry.file_size for entry in entries) > MAX_TOTAL:
            raise _unreadable(f"A zip archive may inflate to at most {MAX_TOTAL} bytes.")
        files = [entry for entry in entries if not entry.is_dir() and not _is_of_a_desktop(entry.filename)]
        self._entries = {entry.filename: entry for entry in files}
        if len(self._entries) != len(files):
            raise _unreadable("A zip archive holds each name once.")
        self._budget = MAX_READ

    @property
    def names(self) -> list[str]:
        """The files' paths in the archive, in its order."""
        return list(self._entries)

    def read(self, name: str) -> bytes:
        """One file, inflated; 422 where it is broken or the archive's budget is spent."""
        self._budget -= self.size(name)
        if self._budget < 0:
            raise _unreadable(f"At most {MAX_READ} bytes are read from one zip archive.")
        with self.open(name) as file:
            # A bound on what is asked for is one on what inflates: a size that lies ends as a broken file.
            return file.read(self.size(name) + 1)

    def size(self, name: str) -> int:
        """What one file inflates to, as the directory says [bytes]."""
        return self._entries[name].file_size

    @contextmanager
    def open(self, name: str) -> Iterator[BinaryIO]:
        """One file as a stream that inflates as it is read; 422 where it is broken."""
        try:
            with self._archive.open(self._entries[name]) as file:
                yield cast("BinaryIO", file)
        except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError, struct.error, OSError):
            raise _unreadable("A file of the zip archive is broken.") from None


def _require_small_directory(stream: BinaryIO) -> None:
    """Judge the archive's last record, so that a directory of a million entries is never parsed."""
    size = stream.seek(0, io.SEEK_END)
    stream.seek(max(0, size - _END_SIZE - 0xFFFF))
    data = stream.read()
    place = data.rfind(_END)
    if place < 0 or len(data) - place < _END_SIZE:
        raise _unreadable("The zip archive is broken: it has no end.")
    entries, length = struct.unpack_from("<HI", data, place + 10)
    if entries > MAX_ENTRIES or length > MAX_DIRECTORY:
        raise _unreadable(f"A zip archive may have at most {MAX_ENTRIES} entries.")


def _require_harmless(entry: zipfile.ZipInfo) -> None:
    if entry.flag_bits & 0x1:
        raise _unreadable("Encrypted zip archives are not read.")
    if entry.compress_type not in _METHODS:
        raise _unreadable("A zip archive's files are stored or deflated; other methods are not read.")
    if stat.S_ISLNK(entry.external_attr >> 16):
        raise _unreadable("A zip archive may hold no links.")
    if not entry.filename:
        raise _unreadable("Each file of a zip archive has a name.")
    if _leads_out(entry.orig_filename):
        raise _unreadable("A path in the zip archive leads out of it.")
    if entry.file_size > MAX_ENTRY:
        raise _unreadable(f"A file in a zip archive may inflate to at most {MAX_ENTRY} bytes.")
    if entry.file_size > RATIO_FROM and entry.file_size > MAX_RATIO * max(entry.compress_size, 1):
        raise _unreadable(f"A file in a zip archive may inflate to at most {MAX_RATIO} times its size.")


def _is_of_a_desktop(path: str) -> bool:
    """What macOS and Windows put beside a folder's files: a twin ``._name`` of each, and how the folder looks."""
    name = PurePosixPath(path).name
    return path.startswith("__MACOSX/") or name.startswith("._") or name in {".DS_Store", "Thumbs.db", "desktop.ini"}


_DRIVE = re.compile(r"[A-Za-z]:")
"""A path of Windows begins with a letter and a colon; further on a colon is a part of a name, as in a time."""


def _leads_out(path: str) -> bool:
    plain = path.replace("\\", "/")
    return (
        plain.startswith("/") or "\0" in path or _DRIVE.match(plain) is not None or ".." in PurePosixPath(plain).parts
    )


def _unreadable(detail: str) -> Problem:
    return Problem("unreadable-file", detail)
