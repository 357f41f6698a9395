"""Reads each file of a folder as the service does, and prints what came of it and what it took.

Run as a process of its own: ``python hostile_run.py FOLDER``; one line of JSON a file.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path

from headimpact_service.errors import Problem
from headimpact_service.ingest import guard
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.upload import read_upload, sample_count

MAX_IMPACTS = 1000
MAX_SAMPLES = 4_000_000
"""As in a request: more becomes a job, which holds no more of it."""


def resident(process: int | str) -> int:
    """Resident memory now [bytes]."""
    try:
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")
    except (OSError, IndexError):
        return 0


def children() -> list[str]:
    """Processes that this one has started."""
    found: list[str] = []
    for path in Path("/proc/self/task").glob("*/children"):
        try:
            found += path.read_text().split()
        except OSError:
            continue
    own = Path("/proc/self/cmdline").read_bytes()
    # A child that has not yet become a program of its own still shows the memory of this one; one that is about to has
    # no command line for a moment.
    return [child for child in found if _command(child) not in {own, b""}]


def _command(process: str) -> bytes:
    try:
        return Path(f"/proc/{process}/cmdline").read_bytes()
    except OSError:
        return b""


class Peak:
    """The most that this process and its children took together, looked at every few milliseconds."""

    def __init__(self) -> None:
        self.bytes = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> Peak:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._ended.is_set():
            self.bytes = max(self.bytes, resident("self") + sum(map(resident, children())))
            self._ended.wait(0.003)


def outcome(path: Path) -> str:
    """The status that the file is answered with, `read`, or `job` where it is too much for one answer."""
    options = ImportOptions(preset="stanford_mat" if path.suffix == ".mat" else None)
    # A small file is in memory when it is read, a large one on disk.
    content = path.read_bytes() if path.stat().st_size <= 16 * 1024**2 else path
    impacts = samples = 0
    refused: list[Problem] = []
    try:
        for item in read_upload(content, options):
            impacts, samples = impacts + 1, samples + sample_count(item)
            refused += [item] if isinstance(item, Problem) else []
            if impacts > MAX_IMPACTS or samples > MAX_SAMPLES:
                return "job"
    except Problem as problem:
        refused.append(problem)
    return f"{refused[0].status} {refused[0].detail}" if refused else "read"


def main() -> None:
    """Every file, each with a process that was not there before."""
    for path in sorted(Path(sys.argv[1]).iterdir()):
        guard.close()
        base, started = resident("self"), time.monotonic()
        with Peak() as peak:
            what = outcome(path)
        took = time.monotonic() - started
        print(json.dumps({"file": path.name, "what": what, "grown": peak.bytes - base, "seconds": took}), flush=True)


if __name__ == "__main__":
    main()
