"""One run of a job: taken up, done part by part, ended with a result or a problem, or handed back to a later run."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any, Protocol

from headimpact_service.errors import Problem
from headimpact_service.jobs.computing import ChildDiedError, computing
from headimpact_service.store import ids, job_runs
from headimpact_service.store.database import Database
from headimpact_service.store.jobs import Job, State
from headimpact_service.store.uploads import Uploads

logger = logging.getLogger(__name__)

MAX_CRASHES = 3
"""A job whose runs died so often without getting any further is given up."""
LOOK_S = 1.0
"""A job under way notices this soon that it is to stop, even in the midst of a part."""

Outcome = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Result:
    """What a job came to: what lists show of it, and what may be long."""

    short: Mapping[str, Any]
    details: Mapping[str, Any] = field(default_factory=dict)


class Kind(Protocol):
    """A kind of job."""

    name: str

    def run(self, work: Work) -> None:
        """Do the job, from the first part that is not committed yet."""

    def result(self, outcomes: Sequence[Outcome]) -> Result:
        """What the committed parts come to, all of them or those until the job stopped."""

    def clean(self, job: Job, house: House) -> None:
        """Let go of what the job kept outside the database, once it has ended."""


@dataclass(frozen=True, slots=True)
class House:
    """What jobs stand on."""

    database: Database
    uploads: Uploads
    memory: int
    """What a child process may hold [bytes]."""
    stopping: threading.Event = field(default_factory=threading.Event)


class _StopRunError(Exception):
    """This run ends here."""


class CancelledError(_StopRunError):
    """Somebody cancelled the job."""


class SupersededError(_StopRunError):
    """The job has ended, or another process runs it."""


class ShutdownError(_StopRunError):
    """This process is about to end."""


class Work:
    """A job in this run, as its kind sees it."""

    def __init__(self, house: House, job: Job) -> None:
        """Of a job that this run has taken up."""
        self.house = house
        self.job = job
        with house.database.read() as conn:
            self.outcomes = job_runs.outcomes(conn, job.id)
            """What the parts that are committed came to; their number is that of the first that is not."""
        self.risked = False
        self._looked = -LOOK_S

    def risk(self) -> None:
        """Count this run as a crash until it ends or gets on: from here on it may be the job that ends the process."""
        if not self.risked:
            self.house.database.write(lambda conn: job_runs.risk(conn, self.job.id, self.job.run))
            self.risked = True

    def expect(self, total: int) -> None:
        """Say how many parts progress is counted in."""
        self.house.database.write(lambda conn: job_runs.expect(conn, self.job.id, self.job.run, total))

    def commit(self, chunk: int, done: int, write: Callable[[Any], Outcome]) -> None:
        """Run `write` in a transaction, with the mark that this part is done: once, whatever is killed when.

        `done` is added to the progress; what `write` returns is the part's outcome, small and JSON. `write` gets the
        connection, does nothing but read and write the database, and may run more than once.
        """
        self.check()
        job, outcomes = self.job, []

        def once(conn: Any) -> Outcome:  # noqa: ANN401 - a connection of the store
            outcomes.append(write(conn))
            return outcomes[-1]

        committed = self.house.database.write(lambda conn: job_runs.commit(conn, job.id, job.run, chunk, done, once))
        if committed == "cancelling":
            raise CancelledError
        if committed == "superseded":
            raise SupersededError
        self.outcomes.extend(outcomes[-1:])

    def computing(
        self, task: str, arguments: Mapping[str, Any], *, strange: bool = True
    ) -> AbstractContextManager[Iterator[Any]]:
        """What `task` yields in a child process. Until that has started, the job is not to blame for an end.

        A job that reads nothing `strange`, only what is stored, is to blame for the end of its child alone: however
        often this process is killed, it goes on.
        """
        begins = self.risk if strange else _nothing
        return computing(task, arguments, memory=self.house.memory, check=self.check, begins=begins)

    def check(self) -> None:
        """Raise if this run is to stop."""
        if self.house.stopping.is_set():
            raise ShutdownError
        if time.monotonic() - self._looked < LOOK_S:
            return
        with self.house.database.read() as conn:
            now = job_runs.get(conn, self.job.id)
        self._looked = time.monotonic()
        if now is None or now.ended or now.run != self.job.run:
            raise SupersededError
        if now.state == "cancelling":
            raise CancelledError


def _nothing() -> None:
    """Do nothing."""


def run(house: House, kinds: Mapping[str, Kind], job_id: bytes, number: int) -> None:
    """Do what is left of a job, unless it has ended or is in another run.

    Raises whatever keeps the database from being written; the run then counts as a crash.
    """
    job = house.database.write(lambda conn: job_runs.begin(conn, job_id, number))
    if job is None:
        return
    kind = kinds[job.kind]
    if job.crashes >= MAX_CRASHES:
        _end(house, kind, job, "cancelled", _crashed)
        return
    work = Work(house, job)
    try:
        work.check()
        kind.run(work)
    except SupersededError:
        return
    except ShutdownError:
        _hand_back(work, crashes=-1 if work.risked else 0)
    except CancelledError:
        _end(house, kind, job, "cancelled", _cancelled)
    except ChildDiedError:
        logger.warning("A job's process died.", extra={"job": ids.encode("job", job.id)})
        _again(work)
    except Problem as problem:
        if problem.slug == "unavailable":
            _again(work)
        else:
            _end(house, kind, job, "failed", problem)
    except Exception:
        name = ids.encode("job", job.id)
        logger.exception("A job failed.", extra={"job": name})
        _end(house, kind, job, "failed", Problem("internal-error", f"The fault is logged under {name}."))
    else:
        _end(house, kind, job, "succeeded", None)


def _again(work: Work) -> None:
    """Another run, after a pause that doubles each time."""
    later = datetime.now(UTC) + timedelta(seconds=2.0 ** (work.job.crashes + 1))
    _hand_back(work, crashes=0 if work.risked else 1, not_before=later)


def _hand_back(work: Work, *, crashes: int, not_before: datetime | None = None) -> None:
    job = work.job
    work.house.database.write(
        lambda conn: job_runs.hand_back(conn, job.id, job.run, crashes=crashes, not_before=not_before)
    )


Ending = Problem | Callable[[Job], Problem] | None


def _end(house: House, kind: Kind, job: Job, state: State, ending: Ending) -> None:
    """End the job with what its parts came to."""

    def finish(conn: Any) -> bool:  # noqa: ANN401 - a connection of the store
        outcomes = job_runs.outcomes(conn, job.id)
        result = kind.result(outcomes) if outcomes or state != "failed" else None
        short, details = (None, None) if result is None else (result.short, result.details)
        now = job_runs.get(conn, job.id)
        problem = ending(now or job) if callable(ending) else ending
        document = None if problem is None else problem.as_dict()
        return job_runs.finish(conn, job.id, job.run, state, result=short, details=details, problem=document)

    if house.database.write(finish):
        kind.clean(job, house)


def _cancelled(job: Job) -> Problem:
    of_total = "" if job.total is None else f" of {job.total}"
    return Problem("job-cancelled", f"Cancelled after {job.done}{of_total}; what was stored until then stays stored.")


def _crashed(job: Job) -> Problem:
    of_total = "" if job.total is None else f" of {job.total}"
    detail = f"Given up after {job.done}{of_total}: its process ended {MAX_CRASHES} times without getting any further."
    return Problem("job-crashed", f"{detail} What was stored until then stays stored.")
