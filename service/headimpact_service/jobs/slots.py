"""The slot of a process beside a database that is a file: the lock of a file, which the system frees when it dies."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from types import TracebackType

from headimpact_service.store.database import Database
from headimpact_service.store.server_slots import ServerSlot
from headimpact_service.store.slot import SLOTS, Slot, SlotsTakenError, slot_name, slot_number


def slot_of(database: Database, folder: Path) -> Slot:
    """The first free slot of a database; `folder` is beside it, if it is a file."""
    return FileSlot(folder) if database.is_file else ServerSlot(database.url)


class FileSlot:
    """A slot that this process holds."""

    def __init__(self, folder: Path) -> None:
        """Take the first that is free."""
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._folder = folder
        self.number, self._handle = self._first_free()

    def __enter__(self) -> FileSlot:
        """Itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Let it go."""
        os.close(self._handle)

    @property
    def name(self) -> str:
        """What this process is called in the engine's records."""
        return slot_name(self.number)

    def keep(self) -> None:
        """It is held until the process ends."""

    def is_free(self, name: str) -> bool:
        """Whether no living process holds the slot of this name."""
        number = slot_number(name)
        if number is None or number == self.number:
            return False
        handle = _locked(self._path(number))
        if handle is not None:
            os.close(handle)
        return handle is not None

    def is_alone(self) -> bool:
        """Whether no other process works on this database."""
        others = {path.stem for path in self._folder.glob("slot-*.lock")} - {self.name}
        return all(self.is_free(name) for name in others)

    def _first_free(self) -> tuple[int, int]:
        for number in range(SLOTS):
            handle = _locked(self._path(number))
            if handle is not None:
                return number, handle
        raise SlotsTakenError(f"At most {SLOTS} processes may work on one database.")

    def _path(self, number: int) -> Path:
        return self._folder / f"{slot_name(number)}.lock"


def _locked(path: Path) -> int | None:
    """A handle that holds the file's lock; None if another process has it. The lock ends with the process."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        return None
    return handle
