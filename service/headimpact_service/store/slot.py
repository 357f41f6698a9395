"""A numbered slot that a living process holds: what the locks of files and those of a server have in common."""

from __future__ import annotations

from types import TracebackType
from typing import Protocol

SLOTS = 64


class SlotsTakenError(RuntimeError):
    """More processes work on this database than there are slots."""


class SlotLostError(RuntimeError):
    """Another process holds the slot that this one worked under."""


class Slot(Protocol):
    """Which processes are alive: each holds the lock of one slot, which is free when it dies.

    A process that starts takes the first free slot, so that after a crash it finds itself under the same name as before
    and takes its own work up at once; the work of others it takes over once their slot has stayed free for a while.
    """

    def __enter__(self) -> Slot:
        """Itself."""

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Let it go."""

    @property
    def name(self) -> str:
        """What this process is called in the engine's records."""

    def keep(self) -> None:
        """Make sure that it is still held; a `SlotLostError` if it cannot be."""

    def is_free(self, name: str) -> bool:
        """Whether no living process holds the slot of this name."""

    def is_alone(self) -> bool:
        """Whether no other process works on this database."""


def slot_name(number: int) -> str:
    """What the process of a slot is called."""
    return f"slot-{number}"


def slot_number(name: str) -> int | None:
    """The number in a slot's name; None if it is none."""
    number = name.removeprefix("slot-")
    return int(number) if number.isdecimal() else None
