"""Uploaded files that a job reads later: in memory while small, else in a folder, kept until the job has ended."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import BinaryIO
from uuid import uuid4

from sqlalchemy.engine import URL

from headimpact_service.store import disk
from headimpact_service.store.unavailable import unavailable

PARTIAL = ".part"
BLOCK = 1024 * 1024


def job_folder(url: URL) -> Path:
    """Where the files of a database's jobs are: beside an SQLite file, else where the service was started."""
    file = (url.database or "").removeprefix("file:").partition("?")[0]
    return Path(f"{file}-jobs") if url.get_backend_name() == "sqlite" else Path("headimpact-jobs")


class Uploads:
    """A folder of files, each named by its job."""

    def __init__(self, folder: Path) -> None:
        """Nothing is made before the first file comes."""
        self.folder = folder

    def warnings(self) -> list[str]:
        """What an operator should know of the folder, as sentences."""
        return disk.warnings(self.folder, "uploads")

    def receive(self, in_memory: int) -> Incoming:
        """A file that is about to arrive; it goes to the folder once it is longer than `in_memory` bytes."""
        return Incoming(self.folder, in_memory)

    def path(self, name: str) -> Path:
        """Where a kept file is."""
        return self.folder / name

    def remove(self, name: str) -> None:
        """Delete a kept file, if it is there."""
        self.path(name).unlink(missing_ok=True)

    def names(self, older_than_s: float = 0.0) -> set[str]:
        """What is in the folder, received in part or kept, and was not written to for a while."""
        if not self.folder.is_dir():
            return set()
        limit = time.time() - older_than_s
        return {path.name for path in self.folder.iterdir() if not older_than_s or _written(path) <= limit}


class Incoming:
    """A file as it arrives: write to it, then keep it under a name or let it go."""

    def __init__(self, folder: Path, in_memory: int) -> None:
        """Kept in memory up to `in_memory` bytes."""
        self._folder = folder
        self._in_memory = in_memory
        self._file: BinaryIO = BytesIO()
        self._path: Path | None = None
        self.length = 0
        self._hashed: bytes | None = None

    def __enter__(self) -> Incoming:
        """Itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Let go of what was not kept."""
        self.close()

    @property
    def is_large(self) -> bool:
        """Whether it is longer than what stays in memory."""
        return self.length > self._in_memory

    def write(self, data: bytes) -> int:
        """Append bytes."""
        self.length += len(data)
        self._hashed = None
        with _writing():
            if self.is_large and self._path is None:
                self._move_to_folder()
            return self._file.write(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        """As of any file."""
        return self._file.seek(offset, whence)

    def read(self, size: int = -1) -> bytes:
        """As of any file."""
        return self._file.read(size)

    def contents(self) -> bytes:
        """All of it."""
        self._file.seek(0)
        return self._file.read()

    def digest(self) -> bytes:
        """SHA-256 of all of it, read once."""
        if self._hashed is None:
            self._file.seek(0)
            hashed = sha256()
            while block := self._file.read(BLOCK):
                hashed.update(block)
            self._hashed = hashed.digest()
        return self._hashed

    def keep(self, name: str) -> None:
        """Bring it to disk under a name: when this returns, it survives the power."""
        with _writing():
            if self._path is None:
                self._move_to_folder()
            assert self._path is not None
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
            self._path.rename(self._folder / name)
            self._path = None
            _sync_folder(self._folder)

    def close(self) -> None:
        """Let go of it."""
        with suppress(OSError):  # what was still to be written, to a full disk
            self._file.close()
        if self._path is not None:
            self._path.unlink(missing_ok=True)
            self._path = None

    def _move_to_folder(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._path = self._folder / f"{uuid4().hex}{PARTIAL}"
        before = self.contents()
        self._file.close()
        self._file = os.fdopen(os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_EXCL, disk.PRIVATE), "w+b")
        self._file.write(before)


@contextmanager
def _writing() -> Iterator[None]:
    """503 where the folder is full, or is none."""
    try:
        yield
    except OSError as error:
        raise unavailable("Uploads cannot be kept now: their folder is full or cannot be written to.") from error


def _written(path: Path) -> float:
    with suppress(FileNotFoundError):
        return path.stat().st_mtime
    return float("inf")


def _sync_folder(folder: Path) -> None:
    """A new name is on disk when its folder is."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
