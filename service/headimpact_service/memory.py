"""How the C library's allocator is told to give memory back."""

from __future__ import annotations

import ctypes
from contextlib import suppress

_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8
"""The numbers of glibc's `mallopt`."""


def give_back() -> None:
    """Return large blocks to the system as soon as they are freed, whatever was freed before.

    glibc raises the size from which it does so to that of the largest block that was ever freed: after one upload of
    16 MiB the next ones would come from the heap, and stay. With few arenas threads share what is free. Nothing happens
    where the C library is another.
    """
    with suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_ARENA_MAX, 2)
        mallopt(_MMAP_THRESHOLD, 256 * 1024)
        mallopt(_TRIM_THRESHOLD, 1024 * 1024)
