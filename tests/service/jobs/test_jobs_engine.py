"""The engine in a process: what is ordered is run, whatever DBOS knows of it; what is old is cleaned up."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from job_kinds import Counting, now
from sqlalchemy import Connection

from headimpact_service.jobs import engine as engine_module
from headimpact_service.jobs.engine import Engine, next_night
from headimpact_service.jobs.runs import House
from headimpact_service.store import ids, job_runs, jobs
from headimpact_service.store.jobs import Job, NewJob
from headimpact_service.store.slot import SlotsTakenError
from headimpact_service.store.tables import jobs as job_table

Start = Callable[[], Engine]
PATIENCE_S = 30.0


@pytest.fixture
def kind(monkeypatch: pytest.MonkeyPatch) -> Counting:
    counting = Counting()
    monkeypatch.setattr(engine_module, "KINDS", {"count": counting})
    monkeypatch.setattr(engine_module, "TICK_S", 0.2)
    return counting


@pytest.fixture
def start(house: House, tmp_path: Path) -> Iterator[Start]:
    """Starts engines, as processes that follow each other would."""
    started: list[Engine] = []

    def start() -> Engine:
        house.stopping.clear()
        engine = Engine(house, tmp_path / "engine", retention_days=30)
        started.append(engine)
        engine.start()
        return engine

    yield start
    for engine in started:
        engine.stop()


def ended(house: House, job: Job) -> Job:
    """The job, once it has ended."""
    waiting = threading.Event()
    for _ in range(int(PATIENCE_S / 0.05)):
        found = now(house, job)
        if found.ended:
            return found
        waiting.wait(0.05)
    raise TimeoutError(found)


@pytest.mark.backend("sqlite")
def test_nothing_is_launched_before_there_is_a_job(start: Start, kind: Counting, tmp_path: Path) -> None:
    start().stop()
    assert [path.name for path in (tmp_path / "engine").iterdir()] == ["slot-0.lock"]


def test_a_job_that_is_ordered_is_run(start: Start, kind: Counting, house: House, data_set: bytes) -> None:
    engine = start()
    new = NewJob(kind="count", arguments={})
    job = house.database.write(lambda conn: jobs.submit(conn, data_set, new))
    engine.wake()
    assert ended(house, job).result == {"n": 30}
    assert kind.cleaned == [job.id]


def test_what_was_under_way_when_the_engine_s_records_were_lost_is_run_to_its_end(
    start: Start, kind: Counting, house: House, job: Job
) -> None:
    house.database.write(lambda conn: job_runs.begin(conn, job.id, 1))
    house.database.write(lambda conn: job_runs.commit(conn, job.id, 1, 0, 10, lambda _: {"n": 10}))
    start()
    assert ended(house, job).result == {"n": 30}
    assert kind.written == [1, 2]


def test_a_run_that_ended_without_ending_its_job_is_followed_by_another(
    start: Start, kind: Counting, house: House, job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs: list[int] = []
    real = engine_module.runs.run

    def once_in_vain(house: House, kinds: Any, job_id: bytes, number: int) -> None:
        runs.append(number)
        if number > 1:
            real(house, kinds, job_id, number)

    monkeypatch.setattr(engine_module.runs, "run", once_in_vain)
    start()
    assert ended(house, job).state == "succeeded"
    assert runs == [1, 2]


def test_a_stop_hands_the_job_back_and_the_next_start_ends_it(
    start: Start, kind: Counting, house: House, job: Job
) -> None:
    reached = threading.Event()

    def wait_for_stop(number: int, work: Any) -> None:
        if number == 1:
            reached.set()
            assert work.house.stopping.wait(PATIENCE_S)

    kind.before = wait_for_stop
    engine = start()
    assert reached.wait(PATIENCE_S)
    engine.stop()
    assert (now(house, job).state, now(house, job).done, now(house, job).crashes) == ("queued", 10, 0)
    kind.before = lambda number, work: None
    start()
    assert ended(house, job).result == {"n": 30}
    assert kind.written == [0, 1, 2]


def test_jobs_that_ended_long_ago_are_deleted_at_the_start(
    start: Start, kind: Counting, house: House, job: Job
) -> None:
    start()
    ended(house, job)
    old = datetime.now(UTC) - timedelta(days=31)
    house.database.write(lambda conn: conn.execute(job_table.update().values(finished_at=old)))
    start()
    waiting = threading.Event()
    for _ in range(int(PATIENCE_S / 0.05)):
        with house.database.read() as conn:
            if job_runs.get(conn, job.id) is None:
                return
        waiting.wait(0.05)
    raise AssertionError("the job is still there")


def upload(house: House, name: str) -> None:
    with house.uploads.receive(0) as incoming:
        incoming.write(b"x")
        incoming.keep(name)


def test_what_no_job_has_is_deleted_at_the_start_and_what_arrives_then_is_not(
    start: Start, kind: Counting, house: House, job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload(house, "job_of_nobody")
    upload(house, ids.encode("job", job.id))
    real = job_runs.unfinished
    before: list[set[str]] = []

    def one_arrives(conn: Connection) -> list[Job]:
        """An upload whose job is ordered just after the engine has looked at the jobs."""
        found = real(conn)
        if not before:
            upload(house, "job_that_arrives")
        before.append(house.uploads.names())
        return found

    monkeypatch.setattr(job_runs, "unfinished", one_arrives)
    start()
    ended(house, job)
    assert "job_of_nobody" in before[0]
    assert house.uploads.names() == {"job_that_arrives", ids.encode("job", job.id)}


def test_without_a_place_no_job_runs_and_a_stop_is_quiet(
    start: Start, kind: Counting, house: House, job: Job, monkeypatch: pytest.MonkeyPatch
) -> None:
    def taken(*_: Any) -> None:
        raise SlotsTakenError("all taken")

    monkeypatch.setattr(engine_module, "slot_of", taken)
    start().stop()
    assert now(house, job).state == "queued"


@pytest.mark.parametrize(
    ("moment", "night"),
    [("2026-11-20T02:59:59", "2026-11-20T03:00:00"), ("2026-11-20T03:00:00", "2026-11-21T03:00:00")],
)
def test_the_next_night_is_at_three(moment: str, night: str) -> None:
    assert next_night(datetime.fromisoformat(moment + "+00:00")) == datetime.fromisoformat(night + "+00:00")
