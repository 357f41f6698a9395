"""Which processes are alive: each holds the lock of one numbered slot, which the system frees when it dies.

A process that starts takes the first free slot, so that after a crash it finds itself under the same name as before
and takes its own work up at once; the work of others it takes over once their slot has stayed free for a while.
"""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from types import TracebackType

SLOTS = 64


class SlotsTakenError(RuntimeError):
    """More processes work on this database than there are slots."""


class Slot:
    """A slot that this process holds."""

    def __init__(self, folder: Path) -> None:
        """Take the first that is free."""
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._folder = folder
        self.number, self._handle = self._first_free()

    def __enter__(self) -> Slot:
        """Itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Let it go."""
        os.close(self._handle)

    @property
    def name(self) -> str:
        """What this process is called in the engine's records."""
        return f"slot-{self.number}"

    def is_free(self, name: str) -> bool:
        """Whether no living process holds the slot of this name."""
        number = name.removeprefix("slot-")
        if not number.isdecimal() or int(number) == self.number:
            return False
        handle = _locked(self._path(int(number)))
        if handle is not None:
            os.close(handle)
        return handle is not None

    def is_alone(self) -> bool:
        """Whether no other process works on this database."""
        others = (int(path.stem.removeprefix("slot-")) for path in self._folder.glob("slot-*.lock"))
        return all(self.is_free(f"slot-{number}") for number in others if number != self.number)

    def _first_free(self) -> tuple[int, int]:
        for number in range(SLOTS):
            handle = _locked(self._path(number))
            if handle is not None:
                return number, handle
        raise SlotsTakenError(f"At most {SLOTS} processes may work on one database.")

    def _path(self, number: int) -> Path:
        return self._folder / f"slot-{number}.lock"


def _locked(path: Path) -> int | None:
    """A handle that holds the file's lock; None if another process has it. The lock ends with the process."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        return None
    return handle
