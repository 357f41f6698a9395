"""What the parsing process may use: set by itself, before it sees a byte of a stranger's file."""

from __future__ import annotations

import gc
import os
import resource

MAX_RESIDENT = 110 * 1024 * 1024
"""Bytes of memory of the whole process, its libraries included, while it reads a file."""
LEAST_ALLOWANCE = 48 * 1024 * 1024
GROWTH = 16 * 1024 * 1024
CPU_BASE_S = 4
CPU_S_PER_MIB = 1
_PAGE = resource.getpagesize()


def close_doors() -> None:
    """No core dumps, no writing to files, and no file can be opened but the one that is handed over.

    Descriptors below the limit are taken but for one: whatever path or link a file names, there is no way to open it.
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    probe = os.dup(0)
    os.close(probe)
    resource.setrlimit(resource.RLIMIT_NOFILE, (probe + 1, probe + 1))


class Memory:
    """What the process takes, as the system tells; opened before the doors are closed."""

    def __init__(self) -> None:
        """Keep the system's account of this process open."""
        try:
            self._account: int | None = os.open("/proc/self/statm", os.O_RDONLY)
        except OSError:
            self._account = None
        self._before = 0

    def before_file(self, size: int) -> None:
        """Bound the memory and the processor time of the next file, `size` bytes long."""
        gc.collect()
        self._before, resident = self._now()
        if self._account is not None:
            allowance = max(LEAST_ALLOWANCE, MAX_RESIDENT - resident)
            _set_soft(resource.RLIMIT_AS, self._before + allowance)
        spent = resource.getrusage(resource.RUSAGE_SELF)
        seconds = CPU_BASE_S + CPU_S_PER_MIB * size // 1024**2
        _set_soft(resource.RLIMIT_CPU, int(spent.ru_utime + spent.ru_stime) + 1 + seconds)

    def has_grown(self) -> bool:
        """Whether the last file left the process notably larger."""
        gc.collect()
        return self._now()[0] - self._before > GROWTH

    def _now(self) -> tuple[int, int]:
        """Address space and resident memory [bytes]."""
        if self._account is None:
            return 0, 0
        total, resident = os.pread(self._account, 100, 0).split()[:2]
        return int(total) * _PAGE, int(resident) * _PAGE


def _set_soft(limit: int, value: int) -> None:
    resource.setrlimit(limit, (value, resource.getrlimit(limit)[1]))
