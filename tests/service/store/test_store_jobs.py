"""Jobs as rows: ordered once, worked on once, ended once."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from hashlib import sha256
from typing import Any

import pytest

from headimpact_service.errors import Problem
from headimpact_service.store import ids, job_runs, jobs, keys, organisations
from headimpact_service.store.database import Database
from headimpact_service.store.jobs import Job, NewJob

WAYS = sha256(b"one request").digest()


@pytest.fixture
def job(database: Database, data_set: bytes) -> Job:
    return database.write(lambda conn: jobs.submit(conn, data_set, NewJob(kind="import", arguments={"file": "a"})))


def begun(database: Database, job: Job) -> None:
    assert database.write(lambda conn: job_runs.begin(conn, job.id, job.run)) is not None


def committed(database: Database, job: Job, chunk: int, written: list[int], run: int = 1) -> str:
    def write(_: Any) -> dict[str, int]:
        written.append(chunk)
        return {"created": chunk}

    return database.write(lambda conn: job_runs.commit(conn, job.id, run, chunk, 10, write))


def read(database: Database, job: Job) -> Job:
    with database.read() as conn:
        return jobs.require(conn, job.data_set_id, job.id)


class TestOrder:
    def test_a_job_is_there_if_and_only_if_the_rest_of_its_transaction_is(
        self, database: Database, data_set: bytes
    ) -> None:
        def fail(conn: Any) -> None:
            jobs.submit(conn, data_set, NewJob(kind="import", arguments={}))
            raise RuntimeError

        with pytest.raises(RuntimeError):
            database.write(fail)
        with database.read() as conn:
            assert job_runs.unfinished(conn) == []

    def test_one_idempotency_key_makes_one_job(self, database: Database, data_set: bytes) -> None:
        def order(request_hash: bytes) -> Job:
            new = NewJob(kind="import", arguments={}, idempotency_key="k-1", request_hash=request_hash)
            return database.write(lambda conn: jobs.submit(conn, data_set, new))

        assert order(WAYS).id == order(WAYS).id
        with pytest.raises(Problem) as raised:
            order(sha256(b"another").digest())
        assert raised.value.slug == "idempotency-conflict"

    def test_the_list_is_of_one_data_set_and_the_kinds_asked_for_newest_first(
        self, database: Database, data_set: bytes
    ) -> None:
        def order(conn: Any) -> list[Job]:
            other = organisations.ensure(conn, "Other").id
            jobs.submit(conn, organisations.ensure_data_set(conn, other, "live"), NewJob(kind="import", arguments={}))
            return [
                jobs.submit(conn, data_set, NewJob(kind=kind, arguments={})) for kind in ("import", "fit", "import")
            ]

        made = database.write(order)
        with database.read() as conn:
            first = jobs.page(conn, data_set, kinds={"import"}, limit=1)
            second = jobs.page(conn, data_set, kinds={"import"}, limit=1, after=first.next)
        assert [row.id for row in (*first.rows, *second.rows)] == [made[2].id, made[0].id]
        assert second.next is None


class TestParts:
    def test_a_part_is_done_once_however_often_it_is_committed(self, database: Database, job: Job) -> None:
        begun(database, job)
        written: list[int] = []
        assert [committed(database, job, chunk, written) for chunk in (0, 0, 1, 1, 0)] == ["stored"] * 5
        assert written == [0, 1]
        assert read(database, job).done == 20

    def test_an_older_run_changes_nothing(self, database: Database, job: Job) -> None:
        begun(database, job)
        database.write(lambda conn: job_runs.hand_back(conn, job.id, 1, crashes=0))
        written: list[int] = []
        assert committed(database, job, 0, written, run=1) == "superseded"
        assert not database.write(lambda conn: job_runs.finish(conn, job.id, 1, "succeeded", result={}))
        assert database.write(lambda conn: job_runs.begin(conn, job.id, 1)) is None
        assert (written, read(database, job).state) == ([], "queued")

    def test_crashes_are_counted_until_the_job_gets_on(self, database: Database, job: Job) -> None:
        begun(database, job)
        for _ in range(2):
            database.write(lambda conn: job_runs.risk(conn, job.id, 1))
        assert read(database, job).crashes == 2
        committed(database, job, 0, [])
        assert read(database, job).crashes == 1

    def test_a_run_that_is_handed_back_in_peace_is_no_crash(self, database: Database, job: Job) -> None:
        begun(database, job)
        database.write(lambda conn: job_runs.risk(conn, job.id, 1))
        database.write(lambda conn: job_runs.hand_back(conn, job.id, 1, crashes=-1))
        assert (read(database, job).crashes, read(database, job).run) == (0, 2)


class TestEnd:
    def test_a_job_that_never_began_is_cancelled_at_once(self, database: Database, job: Job) -> None:
        done = database.write(lambda conn: jobs.cancel(conn, job.data_set_id, job.id))
        assert (done.state, done.problem["type"]) == ("cancelled", "/problems/job-cancelled")
        assert database.write(lambda conn: job_runs.begin(conn, job.id, 1)) is None

    def test_a_job_under_way_stops_before_its_next_part(self, database: Database, job: Job) -> None:
        begun(database, job)
        written: list[int] = []
        committed(database, job, 0, written)
        assert database.write(lambda conn: jobs.cancel(conn, job.data_set_id, job.id)).state == "cancelling"
        assert committed(database, job, 1, written) == "cancelling"
        assert written == [0]

    def test_a_job_that_has_ended_is_not_cancelled(self, database: Database, job: Job) -> None:
        begun(database, job)
        database.write(lambda conn: job_runs.finish(conn, job.id, 1, "succeeded", result={"n": 1}))
        with pytest.raises(Problem) as raised:
            database.write(lambda conn: jobs.cancel(conn, job.data_set_id, job.id))
        assert raised.value.slug == "conflict"
        assert read(database, job).result == {"n": 1}

    def test_ended_jobs_are_deleted_once_they_are_old_and_others_never(self, database: Database, job: Job) -> None:
        other = database.write(lambda conn: jobs.submit(conn, job.data_set_id, NewJob(kind="import", arguments={})))
        begun(database, job)
        committed(database, job, 0, [])
        database.write(lambda conn: job_runs.finish(conn, job.id, 1, "failed", result=None, problem={"status": 422}))
        now = datetime.now(UTC)
        assert database.write(lambda conn: job_runs.delete_ended(conn, now - timedelta(days=1))) == 0
        assert database.write(lambda conn: job_runs.delete_ended(conn, now + timedelta(days=1))) == 1
        with database.read() as conn:
            assert [kept.id for kept in job_runs.unfinished(conn)] == [other.id]


class TestNames:
    """What jobs say of impacts that they refused, once these impacts are erased."""

    @staticmethod
    def failed(*names: str | None) -> dict[str, Any]:
        rows = [{"index": i, "external_id": name, "status": "failed"} for i, name in enumerate(names)]
        return {"summary": {"failed": len(rows)}, "failed": rows}

    def test_of_an_ended_job_and_one_under_way_the_erased_names_go_and_the_rows_stay(
        self, database: Database, data_set: bytes, job: Job
    ) -> None:
        other = database.write(lambda conn: jobs.submit(conn, data_set, NewJob(kind="import", arguments={})))
        for each in (job, other):
            begun(database, each)
            database.write(lambda conn, of=each: job_runs.commit(conn, of.id, 1, 0, 3, lambda _: self.failed("a", "b")))
            database.write(lambda conn, of=each: job_runs.commit(conn, of.id, 1, 1, 1, lambda _: self.failed("c")))
        details = self.failed("a", "b", None)
        database.write(lambda conn: job_runs.finish(conn, job.id, 1, "succeeded", result={}, details=details))
        stranger = database.write(lambda conn: keys.create_key(conn, "Stranger", ["all"]))[0].data_set_id
        database.write(lambda conn: jobs.forget_names(conn, stranger, {"a", "c"}))
        assert read(database, job).details == details
        database.write(lambda conn: jobs.forget_names(conn, data_set, {"a", "never"}))
        assert read(database, job).details == self.failed(None, "b", None)
        with database.read() as conn:
            assert job_runs.outcomes(conn, other.id) == [self.failed(None, "b"), self.failed("c")]


def test_another_data_set_s_job_is_not_there(database: Database, job: Job) -> None:
    stranger = database.write(lambda conn: keys.create_key(conn, "Stranger", ["all"]))[0]
    with database.read() as conn:
        assert jobs.get(conn, stranger.data_set_id, job.id) is None
        assert jobs.get(conn, job.data_set_id, ids.new()) is None
