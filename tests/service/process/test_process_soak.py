"""The service under a steady mixture of requests for minutes: no fault, nothing lost, and nothing that grows."""

from __future__ import annotations

import os
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest
from running import Service
from sending import impact_body

SENDERS = 4
MINUTES = float(os.environ.get("HEADIMPACT_SOAK_MINUTES", "10"))
WARM = 0.25
"""The share of the time after which what the service holds is taken for all that it needs."""


@dataclass(frozen=True)
class Held:
    """What a process holds: resident memory [MiB], open files, threads."""

    memory_mib: float
    files: int
    threads: int

    @classmethod
    def by(cls, pid: int) -> Held:
        status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
        files = len(list(Path(f"/proc/{pid}/fd").iterdir()))
        return cls(int(status["VmRSS"].split()[0]) / 1024, files, int(status["Threads"]))


class Sender:
    """One client with its own athletes; keeps what was answered 201."""

    def __init__(self, service: Service, number: int, until: float) -> None:
        self.service, self.number, self.until = service, number, until
        self.statuses: Counter[int] = Counter()
        self.stored: set[str] = set()

    def run(self) -> None:
        with self.service.client(self.service.key) as client:
            turn = 0
            while time.monotonic() < self.until:
                turn += 1
                self._take_turn(client, turn)

    def _take_turn(self, client: httpx.Client, turn: int) -> None:
        name = f"soak-{self.number}-{turn}"
        body = impact_body(name, scale=0.5 + turn % 97 / 100)
        body["athlete"] = {"external_id": f"p-{self.number}-{turn % 20}"}
        created = self._count(client.post("/v1/impacts", json=body))
        if created.status_code == 201:
            self.stored.add(created.json()["id"])
        self._count(client.post("/v1/score", json={"kinematics": body["kinematics"]}))
        self._count(client.get("/v1/impacts", params={"limit": 20}))
        if turn % 5 == 0:
            self._count(client.post("/v1/impacts", json=body))
            self._count(client.post("/v1/impacts", json=body | {"athlete": {}}))
        if turn % 50 == 0:
            lines = [impact_body(f"{name}-{n}", scale=1 + n / 100) for n in range(20)]
            rows = self._count(client.post("/v1/imports", json=lines)).json()["data"]
            self.stored |= {row["id"] for row in rows if row["status"] == "created"}
            csv = client.get("/v1/impacts", params={"limit": 200}, headers={"Accept": "text/csv"})
            self._count(csv)

    def _count(self, answer: httpx.Response) -> httpx.Response:
        self.statuses[answer.status_code] += 1
        return answer


@pytest.mark.campaign
def test_a_mixture_of_requests_leaves_nothing_behind_but_what_it_stored(tmp_path: Path) -> None:
    service = Service(tmp_path)
    try:
        start = time.monotonic()
        senders = [Sender(service, number, start + 60 * MINUTES) for number in range(SENDERS)]
        with ThreadPoolExecutor(SENDERS) as pool:
            running = [pool.submit(sender.run) for sender in senders]
            time.sleep(60 * MINUTES * WARM)
            warm = Held.by(service.process.pid)
            for sender in running:
                sender.result()
        at_end = Held.by(service.process.pid)
        statuses = sum((sender.statuses for sender in senders), Counter[int]())
        answered = set[str]().union(*(sender.stored for sender in senders))
        print(f"{dict(statuses)}, {len(answered)} stored, {warm} to {at_end}")
        assert set(statuses) == {200, 201, 207, 422}
        assert answered == listed(service)
        assert at_end.memory_mib - warm.memory_mib < 16.0
        assert at_end.files - warm.files <= 2
        assert at_end.threads - warm.threads <= 2
    finally:
        service.stop()


def listed(service: Service) -> set[str]:
    """Every impact that the service lists."""
    found: set[str] = set()
    with service.client(service.key) as client:
        cursor: dict[str, str] = {}
        while True:
            page = client.get("/v1/impacts", params={"limit": "1000"} | cursor).json()
            found |= {row["id"] for row in page["data"]}
            if page["next_cursor"] is None:
                return found
            cursor = {"cursor": page["next_cursor"]}
