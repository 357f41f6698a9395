"""What requests notice of a large import, and what the import costs.

    uv run python benchmarks/import_job.py [--impacts 50000] [--format ndjson|csv|parquet] [--rate 20]

Starts `headimpact serve` in a temporary folder, sends requests at a steady rate, first to the idle service, then while
a job imports one large file, and prints the times of both, the import's impacts per second, and the most memory that
the service and the job's process took.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import pi, sin
from pathlib import Path
from typing import Any

import httpx
import numpy as np

SAMPLES, ONSET, WIDTH = 100, 10, 12
PEAKS = {"linear_acceleration": ("g", (50, -20, 10)), "angular_velocity": ("rad/s", (5, 20, 8))}
TYPES = {"ndjson": "application/x-ndjson", "csv": "text/csv", "parquet": "application/vnd.apache.parquet"}
CSV_MAPPING: dict[str, Any] = {
    "group_by": ["impact"],
    "external_id": "impact",
    "linear_acceleration": {"unit": "g", "x": "ax", "y": "ay", "z": "az"},
    "angular_velocity": {"unit": "rad/s", "x": "wx", "y": "wy", "z": "wz"},
    "sample_rate_hz": 1000,
}


def wave(peak: float) -> list[float]:
    """One half sine, rounded as a device would send it."""
    inside = range(ONSET, ONSET + WIDTH + 1)
    return [round(peak * sin(pi * (i - ONSET) / WIDTH), 3) if i in inside else 0.0 for i in range(SAMPLES)]


def kinematics(scale: float) -> dict[str, Any]:
    """One impact's signals."""
    return {
        name: {"unit": unit, "sample_rate_hz": 1000} | {a: wave(p * scale) for a, p in zip("xyz", peaks, strict=True)}
        for name, (unit, peaks) in PEAKS.items()
    }


def write_file(path: Path, count: int, kind: str, least: float = 1.0) -> None:
    """Many impacts, no two alike; their sizes begin with `least`."""
    if kind == "parquet":
        write_parquet(path, count, least)
        return
    with path.open("w") as file:
        if kind == "csv":
            file.write("impact,ax,ay,az,wx,wy,wz\n")
        for number in range(count):
            signals = kinematics(least + number / count)
            if kind == "ndjson":
                file.write(json.dumps({"external_id": f"e-{number}", "kinematics": signals}) + "\n")
                continue
            columns = [signals[name][axis] for name in PEAKS for axis in "xyz"]
            file.writelines(f"e-{number},{','.join(map(str, row))}\n" for row in zip(*columns, strict=True))


def write_parquet(path: Path, count: int, least: float) -> None:
    """The same impacts as a table with a row a sample, a row group a thousand impacts."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    unit = np.array([wave(peak) for _, peaks in PEAKS.values() for peak in peaks])
    names = [name for name in CSV_MAPPING["linear_acceleration"] if name in "xyz"]
    columns = [CSV_MAPPING[name][axis] for name in PEAKS for axis in names]
    writer = None
    for first in range(0, count, 1000):
        numbers = np.arange(first, min(first + 1000, count))
        values = np.round((least + numbers / count)[:, None, None] * unit, 3)
        table = pa.table(
            {"impact": np.repeat([f"e-{number}" for number in numbers], SAMPLES)}
            | {column: values[:, at].ravel() for at, column in enumerate(columns)}
        )
        writer = writer or pq.ParquetWriter(path, table.schema)
        writer.write_table(table)
    if writer is not None:
        writer.close()


@contextmanager
def serving(folder: Path) -> Iterator[tuple[str, str, int]]:
    """Address, key and process id of a service."""
    command = [sys.executable, "-m", "headimpact_service", "serve", "--port", "0"]
    with (
        (folder / "log.jsonl").open("w") as log,
        subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=log, text=True) as process,
    ):
        assert process.stdout is not None
        key = ""
        try:
            for line in process.stdout:
                key = line.strip() if line.startswith("him_") else key
                if found := re.match(r"Listening on (\S+)", line):
                    yield found[1], key, process.pid
                    break
        finally:
            process.terminate()


@dataclass
class Load:
    """Requests at a steady rate, however long each takes."""

    client: httpx.Client
    path: str
    rate: float
    times_ms: list[float] = field(default_factory=list)
    stopped: threading.Event = field(default_factory=threading.Event)

    def run(self) -> None:
        """Until stopped."""
        due, number = time.monotonic(), 0
        while not self.stopped.wait(max(0.0, due - time.monotonic())):
            due += 1 / self.rate
            number += 1
            body: dict[str, Any] = {"kinematics": kinematics(1 + number % 97 / 100)}
            if self.path == "/v1/impacts":
                body |= {"athlete": {"external_id": "p-1"}}
            start = time.perf_counter()
            self.client.post(self.path, json=body).raise_for_status()
            self.times_ms.append((time.perf_counter() - start) * 1e3)


@contextmanager
def loaded(address: str, headers: dict[str, str], rate: float) -> Iterator[list[Load]]:
    """Both kinds of request, for the time of a block."""
    paths = PATHS if rate else ()
    loads = [Load(httpx.Client(base_url=address, headers=headers, timeout=60), path, rate) for path in paths]
    threads = [threading.Thread(target=load.run) for load in loads]
    for thread in threads:
        thread.start()
    yield loads
    for load, thread in zip(loads, threads, strict=True):
        load.stopped.set()
        thread.join()


PATHS = ("/v1/score", "/v1/impacts")


def show(when: str, loads: list[Load]) -> None:
    """The times of one phase."""
    for load in loads:
        p50, p99, most = np.percentile(load.times_ms, [50, 99, 100])
        print(
            f"{when:14} POST {load.path:12} {len(load.times_ms):6} p50 {p50:7.1f} ms  p99 {p99:7.1f}  max {most:7.1f}"
        )


def resident_mib(pid: int) -> tuple[float, float]:
    """The most memory that a process took, and its children take now."""
    own = _status(pid, "VmHWM")
    listed = [path.read_text().split() for path in Path(f"/proc/{pid}/task").glob("*/children")]
    return own, max((_status(int(child), "VmHWM") for children in listed for child in children), default=0.0)


def _status(pid: int, name: str) -> float:
    try:
        found = re.search(rf"{name}:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    except FileNotFoundError:
        return 0.0
    return int(found[1]) / 1024 if found else 0.0


def main() -> None:
    """Run both phases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--impacts", type=int, default=50_000)
    parser.add_argument("--format", choices=list(TYPES), default="ndjson")
    parser.add_argument("--rate", type=float, default=20.0, help="requests a second of each kind; 0 for none")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / f"impacts.{options.format}"
        write_file(file, options.impacts, options.format)
        print(f"{options.impacts} impacts, {file.stat().st_size / 2**20:.0f} MiB {options.format}")
        with serving(folder) as (address, key, pid):
            headers = {"Authorization": f"Bearer {key}"}
            with loaded(address, headers, options.rate) as idle:
                time.sleep(20 if options.rate else 0)
            show("idle", idle)
            print(f"memory of the service: {resident_mib(pid)[0]:.0f} MiB")
            with loaded(address, headers, options.rate) as busy:
                job, memory, child = run_import(address, headers, file, options.format, pid)
            show("while it runs", busy)
            report(job, options.impacts, memory, child)


def run_import(
    address: str, headers: dict[str, str], file: Path, kind: str, pid: int
) -> tuple[dict[str, Any], float, float]:
    """Order the import and wait for its end; the job, and the most memory of the service and of the child."""
    sent = headers | {"Content-Type": TYPES[kind]}
    params = {} if kind == "ndjson" else {"mapping": json.dumps(CSV_MAPPING)}
    child = 0.0
    with httpx.Client(base_url=address, headers=headers, timeout=120) as client, file.open("rb") as data:
        answer = client.post("/v1/imports", content=data, headers=sent, params=params).raise_for_status()
        while (job := client.get(answer.headers["location"]).json())["finished_at"] is None:
            time.sleep(0.5)
            child = max(child, resident_mib(pid)[1])
    return job, resident_mib(pid)[0], child


def report(job: dict[str, Any], impacts: int, memory: float, child: float) -> None:
    """What the import cost."""

    def at(name: str) -> float:
        return float(np.datetime64(job[name].rstrip("Z")).astype("datetime64[ms]").astype(np.int64)) / 1e3

    print(job["state"], job["result"]["summary"] if job["result"] else job["problem"])
    running, waiting = at("finished_at") - at("started_at"), at("started_at") - at("created_at")
    print(f"{impacts / running:.0f} impacts/s in {running:.1f} s, begun {waiting:.1f} s after it was ordered")
    print(f"memory: service {memory:.0f} MiB, the job's process {child:.0f} MiB")


if __name__ == "__main__":
    main()
