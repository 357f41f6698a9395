"""Fits and re-scores whose processes are killed at random moments: each ends right, nothing twice, nothing missing."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from cohorts import fill, spring_document
from running import Service, on, rows

from headimpact_service.store import keys
from headimpact_service.store.database import Database

PATIENCE_S = 600.0
ENDED = {"succeeded", "failed", "cancelled"}


class Worker:
    """`headimpact work` on the service's database."""

    def __init__(self, folder: Path, url: str) -> None:
        command = [sys.executable, "-m", "headimpact_service", "work", "--database-url", url]
        self._process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == b"Working.\n"

    def kill(self) -> None:
        self._process.send_signal(signal.SIGKILL)
        self._ended()

    def stop(self) -> int:
        self._process.send_signal(signal.SIGTERM)
        return self._ended()

    def _ended(self) -> int:
        assert self._process.stdout is not None
        with self._process.stdout:
            return self._process.wait(60)


class House:
    """A service with labelled impacts and a registered model; it and a worker are killed as a test wants it."""

    def __init__(self, folder: Path, url: str, impacts: int) -> None:
        self.folder, self.url = folder, url
        self.service = self.start()
        self.key = self.service.key
        database = Database(url)
        with database.read() as conn:
            found = keys.find_key(conn, self.key)
        assert found is not None
        for first in range(0, impacts, 1000):
            fill(database, found.data_set_id, min(1000, impacts - first), seed=first + 1, first=first)
        database.close()
        self.post("/v1/models", spring_document())

    def start(self) -> Service:
        return Service(self.folder, on(self.url, self.folder))

    def post(self, path: str, body: dict[str, Any]) -> dict[str, Any]:
        with self.service.client(self.key) as client:
            answer = client.post(path, json=body)
        assert answer.is_success, answer.text
        return dict(answer.json())

    def look(self, job: str) -> dict[str, Any]:
        with self.service.client(self.key) as client:
            return dict(client.get(f"/v1/jobs/{job}").json())

    def restart(self) -> None:
        self.service.kill()
        self.service = self.start()

    def ended(self, job: str) -> dict[str, Any]:
        deadline = time.monotonic() + PATIENCE_S
        while (found := self.look(job))["state"] not in ENDED and time.monotonic() < deadline:
            time.sleep(0.3)
        return found

    def rows(self, query: str) -> list[tuple[Any, ...]]:
        return rows(self.url, query)


@pytest.fixture
def house(empty_url: str, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[House]:
    made = House(tmp_path, empty_url, request.param)
    yield made
    made.service.stop()


def check_rescored(house: House, job: dict[str, Any], impacts: int) -> None:
    assert job["state"] == "succeeded", job
    assert job["result"]["summary"] == {"scored": impacts, "unchanged": 0, "changed": 0, "failed": 0}
    scores = Counter(house.rows("SELECT impact_id, model FROM scores"))
    assert set(scores.values()) == {1}
    assert Counter(model for _, model in scores) == {"laksari-2020": impacts, "spring": impacts}


@pytest.mark.campaign
@pytest.mark.parametrize("house", [600], indirect=True)
def test_a_re_score_and_a_fit_survive_a_kill_of_the_service(house: House) -> None:
    rescore = house.post("/v1/models/spring/scores", {})["id"]
    fit = house.post("/v1/models/fits", {"criteria": ["bam"], "replicas": 10, "version": "fitted"})["id"]
    deadline = time.monotonic() + PATIENCE_S
    while house.look(rescore)["state"] == "queued" and time.monotonic() < deadline:
        time.sleep(0.05)
    house.restart()
    check_rescored(house, house.ended(rescore), 600)
    assert house.ended(fit)["result"]["version"] == "fitted"
    assert house.rows("SELECT version FROM models ORDER BY version") == [("fitted",), ("spring",)]


@pytest.mark.campaign
@pytest.mark.parametrize("house", [20_000], indirect=True)
def test_twenty_kills_of_service_and_worker_in_a_re_score_of_20_000(house: House) -> None:
    chance = random.Random(1)
    worker = Worker(house.folder, house.url)
    job = house.post("/v1/models/spring/scores", {})["id"]
    for number in range(20):
        time.sleep(chance.uniform(0.2, 3.0))
        if number % 2:
            worker.kill()
            worker = Worker(house.folder, house.url)
        else:
            house.restart()
    check_rescored(house, house.ended(job), 20_000)
    assert worker.stop() == 0


@pytest.mark.campaign
@pytest.mark.parametrize("house", [2_000], indirect=True)
def test_twenty_kills_of_service_and_worker_in_fits(house: House) -> None:
    chance = random.Random(2)
    worker = Worker(house.folder, house.url)
    names = []
    for number in range(20):
        name = f"fit-{number}"
        names.append(house.post("/v1/models/fits", {"criteria": ["bam"], "replicas": 50, "version": name})["id"])
        time.sleep(chance.uniform(0.2, 6.0))
        if number % 2:
            worker.kill()
            worker = Worker(house.folder, house.url)
        else:
            house.restart()
    found = [house.ended(job) for job in names]
    assert [job["state"] for job in found] == ["succeeded"] * 20
    assert [job["result"]["version"] for job in found] == [f"fit-{number}" for number in range(20)]
    with house.service.client(house.key) as client:
        answers = [client.get(f"/v1/models/fit-{number}") for number in range(20)]
    assert [answer.status_code for answer in answers] == [200] * 20, answers[0].text
    documents = [answer.json()["curves"] for answer in answers]
    assert all(document == documents[0] for document in documents)
    assert worker.stop() == 0


@pytest.mark.campaign
@pytest.mark.parametrize("house", [300], indirect=True)
def test_two_processes_fire_one_schedule_once(house: House) -> None:
    worker = Worker(house.folder, house.url)
    schedule = {"cron": "* * * * *", "fit": {"criteria": ["bam"], "replicas": 10}}
    with house.service.client(house.key) as client:
        assert client.put("/v1/schedules/often", json=schedule).status_code == 201
        time.sleep(130)
        jobs = client.get("/v1/jobs", params={"kind": "fit"}).json()["data"]
    minutes = Counter(job["created_at"][:16] for job in jobs)
    assert set(minutes.values()) == {1}
    assert len(minutes) >= 2
    assert worker.stop() == 0
