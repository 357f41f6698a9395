"""Runs: every part once, and one end, whatever happens on the way."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from job_kinds import Counting, now

from headimpact_service.errors import Problem
from headimpact_service.jobs.computing import ChildDiedError
from headimpact_service.jobs.runs import MAX_CRASHES, House, Work, run
from headimpact_service.store import jobs
from headimpact_service.store.jobs import Job


def at(number: int, action: object) -> Counting:
    """Three parts; something happens before one of them."""

    def before(reached: int, work: Work) -> None:
        if reached == number:
            if isinstance(action, BaseException):
                raise action
            assert callable(action)
            action(work)

    return Counting(before=before)


def attempt(house: House, job: Job, kind: Counting) -> Job:
    run(house, {"count": kind}, job.id, now(house, job).run)
    return now(house, job)


class Killed(BaseException):
    """Stands for the end of the process: nothing catches it."""


def crash(house: House, job: Job, kind: Counting) -> None:
    with pytest.raises(Killed):
        attempt(house, job, kind)


class TestSuccess:
    def test_a_job_counts_its_parts_and_keeps_its_result(self, house: House, job: Job) -> None:
        kind = Counting()
        done = attempt(house, job, kind)
        assert (done.state, done.done, done.total, done.result, done.problem) == ("succeeded", 30, 30, {"n": 30}, None)
        assert kind.cleaned == [job.id]

    def test_a_job_that_has_ended_is_not_run_again(self, house: House, job: Job) -> None:
        attempt(house, job, Counting())
        again = Counting()
        assert attempt(house, job, again).state == "succeeded"
        assert (again.written, again.cleaned) == ([], [])


class TestDeath:
    def test_after_a_crash_the_next_run_goes_on_behind_what_is_committed(self, house: House, job: Job) -> None:
        kind = at(2, Killed())
        crash(house, job, kind)
        assert now(house, job).state == "running"
        rest = Counting()
        assert attempt(house, job, rest).result == {"n": 30}
        assert (kind.written, rest.written) == ([0, 1], [2])

    def test_three_crashes_at_one_place_cancel_the_job_and_its_problem_says_so(self, house: House, job: Job) -> None:
        crash(house, job, at(1, Killed()))
        for _ in range(MAX_CRASHES - 1):
            crash(house, job, at(1, Killed()))
        never = Counting()
        done = attempt(house, job, never)
        assert (done.state, done.result) == ("cancelled", {"n": 10})
        assert done.problem is not None
        assert done.problem["type"] == "/problems/job-crashed"
        assert "10 of 30" in done.problem["detail"]
        assert "3 times" in done.problem["detail"]
        assert (never.written, never.cleaned) == ([], [job.id])

    def test_a_job_that_gets_on_between_crashes_is_not_given_up(self, house: House, job: Job) -> None:
        for _ in range(MAX_CRASHES - 1):
            crash(house, job, at(0, Killed()))
        for number in (1, 2):
            crash(house, job, at(number, Killed()))
        assert attempt(house, job, Counting()).state == "succeeded"

    def test_a_child_that_died_is_another_run_after_a_growing_pause(self, house: House, job: Job) -> None:
        pauses = []
        for crashes in range(1, MAX_CRASHES + 1):
            before = datetime.now(UTC)
            waiting = attempt(house, job, at(0, ChildDiedError()))
            assert (waiting.state, waiting.crashes, waiting.run) == ("queued", crashes, crashes + 1)
            assert waiting.not_before is not None
            pauses.append(round((waiting.not_before - before).total_seconds()))
        assert pauses == [2, 4, 8]
        assert attempt(house, job, Counting()).state == "cancelled"

    def test_a_run_that_ended_before_it_got_to_work_is_not_the_job_s_fault(self, house: House, job: Job) -> None:
        def end(_: Work) -> None:
            raise Killed

        kind = Counting()
        kind.run = end  # type: ignore[method-assign]  # what the test replaces
        for _ in range(MAX_CRASHES + 1):
            crash(house, job, kind)
        assert attempt(house, job, Counting()).state == "succeeded"

    def test_a_run_that_another_process_has_taken_over_stops_without_a_trace(self, house: House, job: Job) -> None:
        other = Counting()

        def overtake(work: Work) -> None:
            attempt(house, job, other)

        kind = at(1, overtake)
        run(house, {"count": kind}, job.id, 1)
        assert (kind.written, other.written, kind.cleaned) == ([0], [1, 2], [])
        assert now(house, job).result == {"n": 30}


class TestStop:
    def test_a_cancelled_job_keeps_what_is_stored_and_says_so(self, house: House, job: Job) -> None:
        kind = at(2, lambda work: work.house.database.write(lambda conn: jobs.cancel(conn, job.data_set_id, job.id)))
        done = attempt(house, job, kind)
        assert (done.state, done.result, kind.written, kind.cleaned) == ("cancelled", {"n": 20}, [0, 1], [job.id])
        assert done.problem is not None
        assert done.problem["detail"] == "Cancelled after 20 of 30; what was stored until then stays stored."

    def test_a_job_that_was_cancelled_between_two_runs_ends_in_the_next(self, house: House, job: Job) -> None:
        crash(house, job, at(1, Killed()))
        assert house.database.write(lambda conn: jobs.cancel(conn, job.data_set_id, job.id)).state == "cancelling"
        assert attempt(house, job, Counting()).state == "cancelled"

    def test_a_process_that_stops_hands_the_job_back_and_that_is_no_crash(self, house: House, job: Job) -> None:
        kind = at(1, lambda work: work.house.stopping.set())
        waiting = attempt(house, job, kind)
        assert (waiting.state, waiting.crashes, waiting.run, waiting.done) == ("queued", 0, 2, 10)
        assert kind.cleaned == []
        house.stopping.clear()
        assert attempt(house, job, Counting()).result == {"n": 30}


class TestFailure:
    def test_a_problem_ends_the_job_and_is_kept(self, house: House, job: Job) -> None:
        kind = at(0, Problem("unreadable-file", "The file is not one."))
        done = attempt(house, job, kind)
        assert (done.state, done.result, kind.cleaned) == ("failed", None, [job.id])
        assert done.problem is not None
        assert (done.problem["status"], done.problem["detail"]) == (422, "The file is not one.")

    def test_a_fault_is_logged_under_the_job_s_name_and_says_nothing_else(
        self, house: House, job: Job, caplog: pytest.LogCaptureFixture
    ) -> None:
        done = attempt(house, job, at(1, ValueError("very secret")))
        assert done.problem is not None
        assert (done.state, done.problem["status"], done.result) == ("failed", 500, {"n": 10})
        assert "secret" not in done.problem["detail"]
        assert next(record.job for record in caplog.records) in done.problem["detail"]  # type: ignore[attr-defined]  # set by our log filter

    def test_a_database_that_cannot_be_written_now_is_another_run(self, house: House, job: Job) -> None:
        waiting = attempt(house, job, at(0, Problem("unavailable", "The database cannot take this write now.")))
        assert (waiting.state, waiting.crashes) == ("queued", 1)
        assert attempt(house, job, Counting()).state == "succeeded"
