"""A service that imports a file, killed and started again as a test wants it."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from running import Service, on, rows
from sending import half_sine

PATIENCE_S = 120.0
PEAKS = {"linear_acceleration": ("g", (50, -20, 10)), "angular_velocity": ("rad/s", (5, 20, 8))}


def ndjson(count: int, prefix: str = "e") -> bytes:
    """Some impacts of 32 samples, no two alike, each with a name."""
    lines = []
    for number in range(count):
        scale = 1 + number / count
        signals = {
            name: {"unit": unit, "sample_rate_hz": 1000}
            | dict(zip("xyz", (half_sine(peak * scale, 32) for peak in peaks), strict=True))
            for name, (unit, peaks) in PEAKS.items()
        }
        impact = {"external_id": f"{prefix}-{number}", "athlete": {"external_id": f"{prefix}-{number % 40}"}}
        lines.append(json.dumps(impact | {"occurred_at": "2026-11-20T19:04:05Z", "kinematics": signals}))
    return "\n".join(lines).encode()


class Importer:
    """The service, its key, and the one job that it does."""

    def __init__(self, folder: Path, url: str) -> None:
        self.folder, self.url = folder, url
        self.service = self.start()
        self.key = self.service.key
        self.job = ""
        self.seen = [0]

    def start(self) -> Service:
        """Another process on the same database."""
        return Service(self.folder, on(self.url, self.folder))

    def order(self, data: bytes, **headers: str) -> dict[str, Any]:
        """Send the file; the job."""
        wanted = {"Content-Type": "application/x-ndjson", "Prefer": "respond-async"} | headers
        with self.service.client(self.key) as client:
            answer = client.post("/v1/imports", content=data, headers=wanted)
        assert answer.status_code == 202, answer.text
        if answer.json()["id"] != self.job:
            self.job, self.seen = answer.json()["id"], [0]
        return dict(answer.json())

    def look(self) -> dict[str, Any]:
        """The job now; what is done never gets less."""
        with self.service.client(self.key) as client:
            job = dict(client.get(f"/v1/jobs/{self.job}").json())
        assert job["progress"]["done"] >= self.seen[-1]
        self.seen.append(job["progress"]["done"])
        return job

    def until(self, reached: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """The job, once it has come so far or has ended."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            job = self.look()
            if job["finished_at"] is not None or reached(job):
                return job
            time.sleep(0.05)
        raise TimeoutError(job)

    def end(self) -> dict[str, Any]:
        """The job, once it has ended."""
        return self.until(lambda job: False)

    def again(self, *, kill: bool) -> None:
        """End the process, in peace or not, and start another."""
        if kill:
            self.service.kill()
        else:
            assert self.service.stop() in {0, -signal.SIGTERM}
        self.service = self.start()

    def stored(self, prefix: str = "e") -> list[str]:
        """The names of the impacts that begin so; and the tables agree."""
        if self.url.startswith("sqlite"):
            assert rows(self.url, "PRAGMA integrity_check") == [("ok",)]
            assert rows(self.url, "PRAGMA foreign_key_check") == []
        assert rows(self.url, "SELECT count(*) FROM job_chunks") == [(0,)]
        impacts = [name for (name,) in rows(self.url, "SELECT external_id FROM impacts ORDER BY id")]
        for table in ("impact_revisions", "scores"):
            assert rows(self.url, f"SELECT count(*) FROM {table}") == [(len(impacts),)]
        return [name for name in impacts if name.startswith(f"{prefix}-")]

    def uploads(self) -> list[str]:
        """What lies in the folder of uploads, once a job that has just ended had its moment to clean up."""
        folder = self.folder / "uploads"
        deadline = time.monotonic() + PATIENCE_S
        while (names := [path.name for path in folder.iterdir()]) and time.monotonic() < deadline:
            time.sleep(0.05)
        return names
