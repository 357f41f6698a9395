"""Impacts per second and peak memory of reading many impacts of one file, and the share of the bare parser.

    uv run python benchmarks/bulk_read.py [--impacts 50000]

Makes its files in a temporary folder: impacts of 100 samples x 6 channels as Parquet with a row a sample, Parquet with
a row an impact, and CSV. Each is read in a process of its own into records that are dropped one by one; the bare parser
(pyarrow's, NumPy's for CSV) reads the same columns and drops them. CPU is that of the process and its children; memory
is the most that both took together, less what the process took before it opened the file.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path

SAMPLES = 100
CHANNELS = ("ax_g", "ay_g", "az_g", "wx_rad_s", "wy_rad_s", "wz_rad_s")
FILES = ("wide.parquet", "nested.parquet", "wide.csv")


def make(folder: Path, impacts: int) -> None:
    """The three files, of the same samples."""
    import numpy as np
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet as pq

    rng = np.random.default_rng(1)
    offsets = pa.array(np.arange(impacts + 1) * SAMPLES, pa.int32())
    times = np.tile(np.arange(SAMPLES) * 1.0, impacts)
    flat = {"t_ms": times} | {name: np.round(20.0 * rng.normal(size=times.size), 4) for name in CHANNELS}
    names = np.array([f"impact-{number}" for number in range(impacts)])
    wide = pa.table({"external_id": np.repeat(names, SAMPLES), **flat})
    lists = {name: pa.ListArray.from_arrays(offsets, pa.array(values)) for name, values in flat.items()}
    pq.write_table(wide, folder / "wide.parquet")
    pq.write_table(pa.table({"external_id": names, **lists}), folder / "nested.parquet")
    pyarrow.csv.write_csv(wide, folder / "wide.csv", pyarrow.csv.WriteOptions(quoting_style="none"))


def records(path: Path) -> int:
    """Impacts read into records, none kept."""
    from headimpact_service.ingest import guard
    from headimpact_service.ingest.options import ImportOptions
    from headimpact_service.ingest.record import ImpactRecord
    from headimpact_service.ingest.upload import read_upload

    found = sum(isinstance(item, ImpactRecord) for item in read_upload(path, ImportOptions()))
    guard.close()
    return found


def bare(path: Path) -> int:
    """The columns read and dropped by the parser alone, block by block."""
    if path.suffix == ".csv":
        import numpy as np

        with path.open() as lines:
            next(lines)
            rows = 0
            while block := list(islice(lines, 4096)):
                rows += len(np.loadtxt(block, delimiter=",", usecols=range(1, 8), ndmin=2, comments=None))
        return rows // SAMPLES
    import pyarrow.parquet as pq

    rows = 0
    for batch in pq.ParquetFile(path, pre_buffer=False, buffer_size=65536).iter_batches(16384, use_threads=False):
        rows += batch.num_rows
    return rows if path.name.startswith("nested") else rows // SAMPLES


READERS: dict[str, Callable[[Path], int]] = {"records": records, "bare": bare}


def measure(how: str, path: Path) -> dict[str, float]:
    """One reading in this process: impacts, CPU and wall seconds, and the growth of memory."""
    if how == "records":
        import headimpact_service.ingest.upload  # noqa: F401 - what the service has loaded before a file comes
    base = _resident("self")
    started, spent = time.monotonic(), _cpu()
    with _Peak() as peak:
        impacts = READERS[how](path)
    return {
        "impacts": impacts,
        "wall_s": time.monotonic() - started,
        "cpu_s": _cpu() - spent,
        "service_mib": (peak.own - base) / 1024**2,
        "together_mib": (peak.together - base) / 1024**2,
    }


def _cpu() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in used)


def _resident(process: str) -> int:
    try:
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")
    except (OSError, IndexError):
        return 0


def _children() -> Iterator[str]:
    own = Path("/proc/self/cmdline").read_bytes()
    for path in Path("/proc/self/task").glob("*/children"):
        try:
            # A child that is not yet a program of its own still shows the memory of this one.
            yield from (c for c in path.read_text().split() if Path(f"/proc/{c}/cmdline").read_bytes() != own)
        except OSError:
            continue


class _Peak:
    """The most that was resident, looked at every ten milliseconds."""

    def __init__(self) -> None:
        self.own = self.together = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> _Peak:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._ended.is_set():
            own = _resident("self")
            self.own = max(self.own, own)
            self.together = max(self.together, own + sum(map(_resident, _children())))
            self._ended.wait(0.01)


def _in_a_process(how: str, path: Path) -> dict[str, float]:
    command = [sys.executable, __file__, "--measure", how, str(path)]
    found: dict[str, float] = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    return found


def main() -> None:
    """Each file once by each reader."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--impacts", type=int, default=50_000)
    arguments.add_argument("--measure", nargs=2, metavar=("HOW", "PATH"))
    given = arguments.parse_args()
    if given.measure:
        print(json.dumps(measure(given.measure[0], Path(given.measure[1]))))
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make(folder, given.impacts)
        titles = (
            "file",
            "MB",
            "impacts per CPU s",
            "per wall s",
            "bare parser's share of CPU",
            "service",
            "with parser",
        )
        print(f"| {' | '.join(titles)} |\n|{'---|' * len(titles)}")
        for file in FILES:
            path = folder / file
            ours, parser = (_in_a_process(how, path) for how in READERS)
            assert ours["impacts"] == parser["impacts"] == given.impacts
            print(
                f"| {file} | {path.stat().st_size / 1e6:.0f} | {given.impacts / ours['cpu_s']:,.0f} "
                f"| {given.impacts / ours['wall_s']:,.0f} | {parser['cpu_s'] / ours['cpu_s']:.0%} "
                f"| + {ours['service_mib']:.0f} MiB | + {ours['together_mib']:.0f} MiB |"
            )


if __name__ == "__main__":
    main()
