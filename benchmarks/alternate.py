"""Two ways to do the same work, timed in turn: A B A B ..., so that a change of the machine's speed hits both."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Comparison:
    """Median process CPU seconds of each side per call, and the median of the ratio pair by pair."""

    ours: float
    peer: float
    ratio: float
    lowest: float
    highest: float

    def row(self, name: str, peer: str, reach: str) -> str:
        """One line of the table."""
        return (
            f"| {name} | {peer} | {_readable(self.ours)} | {_readable(self.peer)} | "
            f"{self.ratio:.2f} ({self.lowest:.2f} to {self.highest:.2f}) | {reach} |"
        )


def _readable(seconds: float) -> str:
    return f"{seconds * 1e6:.1f} us" if seconds < 1e-3 else f"{seconds * 1e3:.2f} ms"


def cpu_seconds(work: Callable[[], object], calls: int) -> float:
    """Process CPU time of one call, averaged over `calls`."""
    start = time.process_time()
    for _ in range(calls):
        work()
    return (time.process_time() - start) / calls


def _require_one_thread() -> None:
    """OpenBLAS's threads spin for a while after each call that used them, and whoever runs next would pay for it."""
    if os.environ.get("OPENBLAS_NUM_THREADS") != "1":
        raise SystemExit("Set OPENBLAS_NUM_THREADS=1: process CPU time counts threads that wait for work.")


def compare(
    ours: Callable[[], object], peer: Callable[[], object], *, calls: tuple[int, int], rounds: int = 15
) -> Comparison:
    """Time `ours` and `peer` in turn after one warm-up of each; ratios are peer over ours: above 1, ours is cheaper."""
    _require_one_thread()
    cpu_seconds(ours, calls[0])
    cpu_seconds(peer, calls[1])
    pairs = [(cpu_seconds(ours, calls[0]), cpu_seconds(peer, calls[1])) for _ in range(rounds)]
    ratios = sorted(b / a for a, b in pairs)
    return Comparison(
        statistics.median(a for a, _ in pairs),
        statistics.median(b for _, b in pairs),
        statistics.median(ratios),
        ratios[0],
        ratios[-1],
    )
