"""Kinds of job for tests, and tasks for their child processes."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from headimpact_service.errors import Problem
from headimpact_service.jobs.runs import House, Outcome, Result, Work
from headimpact_service.store import job_runs
from headimpact_service.store.jobs import Job


class Counting:
    """Commits `parts` parts of ten; `before` is called with the number of each that is about to be committed."""

    name = "count"

    def __init__(self, parts: int = 3, before: Callable[[int, Work], None] = lambda number, work: None) -> None:
        self.parts, self.before = parts, before
        self.written: list[int] = []
        self.cleaned: list[bytes] = []

    def run(self, work: Work) -> None:
        work.risk()
        work.expect(self.parts * 10)
        for number in range(len(work.outcomes), self.parts):
            self.before(number, work)
            work.commit(number, 10, lambda _, number=number: self._write(number))

    def _write(self, number: int) -> Outcome:
        self.written.append(number)
        return {"n": 10}

    def result(self, outcomes: Sequence[Outcome]) -> Result:
        return Result({"n": sum(outcome["n"] for outcome in outcomes)}, {"parts": [dict(o) for o in outcomes]})

    def clean(self, job: Job, house: House) -> None:
        self.cleaned.append(job.id)


def count(arguments: dict[str, Any]) -> Iterator[int]:
    """Some numbers."""
    yield from range(arguments["n"])


def refuse(arguments: dict[str, Any]) -> Iterator[int]:
    """One number, then a problem."""
    yield 1
    raise Problem("unreadable-file", "The file is not one.")


def fail(arguments: dict[str, Any]) -> Iterator[int]:
    """A fault."""
    yield 1
    raise ValueError(arguments["text"])


def die(arguments: dict[str, Any]) -> Iterator[int]:
    """What the system does when memory is short."""
    yield 1
    os.kill(os.getpid(), signal.SIGKILL)


def grow(arguments: dict[str, Any]) -> Iterator[int]:
    """More memory than is allowed."""
    yield len(bytearray(arguments["n"]))


def stay(arguments: dict[str, Any]) -> Iterator[int]:
    """Its own process id, then nothing for long."""
    yield os.getpid()
    time.sleep(600)


def now(house: House, job: Job) -> Job:
    """The job as it is stored."""
    with house.database.read() as conn:
        found = job_runs.get(conn, job.id)
    assert found is not None
    return found
