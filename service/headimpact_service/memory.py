"""How memory that is no longer needed is given back to the system."""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.abc import MetaPathFinder
from pathlib import Path

_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8
"""The numbers of glibc's `mallopt`."""
_LARGE = 1024 * 1024
"""Bytes of a block that goes back at once; a block of impacts is computed in smaller ones, which are used again."""
_DONT_NEED = 4
"""The advice `MADV_DONTNEED` of Linux."""
_COLLECT_AFTER = 10_000
"""New objects after which the youngest are looked through for cycles: Python's 700 are not those of two requests."""


def give_back() -> None:
    """Return large blocks to the system as soon as they are freed, whatever was freed before.

    glibc raises the size from which it does so to that of the largest block that was ever freed: after one upload of
    16 MiB the next ones would come from the heap, and stay. With few arenas threads share what is free. Nothing happens
    where the C library is another.
    """
    with suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_ARENA_MAX, 2)
        mallopt(_MMAP_THRESHOLD, _LARGE)
        mallopt(_TRIM_THRESHOLD, 4 * _LARGE)


def spare_the_collector() -> None:
    """Have garbage collections look at what is new only, and less often.

    What is loaded now stays; a collection that looks through all of it holds every request for 0.2 s, and one after
    every 700 objects takes a quarter of the time of an upload.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(_COLLECT_AFTER)


class _WithoutPandas(MetaPathFinder):
    def find_spec(self, fullname: str, path: object, target: object = None) -> None:  # noqa: ARG002 - its shape
        """There is no pandas; everything else is somebody else's to find."""
        if fullname == "pandas":
            raise ModuleNotFoundError(fullname, name=fullname)


@contextmanager
def without_pandas() -> Iterator[None]:
    """Let pyarrow find no pandas, which it loads with its first array wherever it is installed, as statsmodels has it.

    It looks once, and 50 MiB that no table needs here are spared.
    """
    finder = _WithoutPandas()
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)


def let_go_of_code() -> None:
    """Unmap the pages of program code that loading has touched; what is needed again comes back from the file.

    A large library runs much of its code once, as it is loaded, and every page of it counts from then on:
    half of what a process takes that has loaded pyarrow. Code is never written to, so nothing is lost. Nothing happens
    where the system is another than Linux.
    """
    with suppress(OSError, AttributeError):
        madvise = ctypes.CDLL(None).madvise
        for start, length in _code():
            madvise(ctypes.c_void_p(start), ctypes.c_size_t(length), _DONT_NEED)


def _code() -> list[tuple[int, int]]:
    """Where files are mapped as code that nobody can write to: start and length [bytes]."""
    found: list[tuple[int, int]] = []
    for line in Path("/proc/self/maps").read_text().splitlines():
        span, access, _offset, _device, inode, *_ = line.split()
        if access == "r-xp" and inode != "0":
            start, end = (int(edge, 16) for edge in span.split("-"))
            found.append((start, end - start))
    return found
