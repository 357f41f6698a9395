"""DBOS Transact: the one module that knows it.

It keeps its records in a file of its own beside an SQLite database, in a schema of its own on PostgreSQL
(docs/adr/0017-jobs.md). One workflow is one run of a job; its arguments are JSON, its output is nothing, and all that
matters is in our own tables: were its records lost, every unfinished job would be brought to it again.
"""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Callable, Iterable
from contextlib import closing
from datetime import UTC, datetime, timedelta

from dbos import DBOS, DBOSConfig, SetEnqueueOptions, SetWorkflowID, WorkflowSerializationFormat
from sqlalchemy.engine import URL

Runner = Callable[[str, int], None]

VERSION = "1"
"""Constant: DBOS leaves the workflows of another version alone. A change of the workflow's shape is a `DBOS.patch`."""
QUEUE = "jobs"
ACTIVE = frozenset({"ENQUEUED", "DELAYED", "PENDING"})
ENDED = ["SUCCESS", "ERROR", "CANCELLED", "MAX_RECOVERY_ATTEMPTS_EXCEEDED"]
POLL_S = 0.5
POOL = 5
"""Connections to its records: for a queue, its notices and a run or two."""
KEEP = timedelta(days=1)
_AT_ONCE = 500

_runner: list[Runner] = []
"""Who does the work; DBOS itself is one for each process."""


# Whether it crashes too often is for `runs` to say, which knows whether it got any further.
@DBOS.workflow(name="job", max_recovery_attempts=None, serialization_type=WorkflowSerializationFormat.PORTABLE)
def _job(job: str, run: int) -> None:
    _run(job, run)


# Retried here only while the database cannot be written at all; every other retry is a run of its own.
@DBOS.step(name="run", retries_allowed=True, interval_seconds=1.0, max_attempts=3, backoff_rate=2.0)
def _run(job: str, run: int) -> None:
    _runner[0](job, run)


class Transact:
    """The engine of this process, from its launch to its close."""

    def __init__(self, records: URL, executor: str, runner: Runner, *, at_once: int) -> None:
        """Launch it; the runs that a process of the same name left behind are taken up at once."""
        if records.get_backend_name() == "sqlite":
            _open(records)
        # With a handler, DBOS adds none of its own and its lines come out as ours do.
        logging.getLogger("dbos").addHandler(logging.NullHandler())
        _runner[:] = [runner]
        config: DBOSConfig = {
            "name": "headimpact",
            "system_database_url": records.render_as_string(hide_password=False),
            "sys_db_pool_size": POOL,
            "application_version": VERSION,
            "executor_id": executor,
            "log_level": "WARNING",
        }
        self._executor = executor
        DBOS(config=config)
        DBOS.launch()
        DBOS.register_queue(QUEUE, worker_concurrency=at_once, polling_interval_sec=POLL_S, on_conflict="always_update")

    def enqueue(self, job: str, run: int, delay_s: float = 0.0) -> None:
        """Order a run of a job; the same run twice is one."""
        with SetWorkflowID(_id(job, run)), SetEnqueueOptions(delay_seconds=delay_s or None):
            DBOS.enqueue_workflow(QUEUE, _job, job, run)

    def known(self, runs: Iterable[tuple[str, int]]) -> dict[tuple[str, int], bool]:
        """Of these runs, those that were ordered, and whether each is still to be done or under way."""
        names = {_id(*run): run for run in runs}
        found = DBOS.list_workflows(workflow_ids=list(names), load_input=False, load_output=False)
        return {names[workflow.workflow_id]: workflow.status in ACTIVE for workflow in found}

    def pending_elsewhere(self) -> dict[str, list[str]]:
        """The workflows that other processes run, or ran when they died."""
        found: dict[str, list[str]] = {}
        for workflow in DBOS.list_workflows(status="PENDING", load_input=False, load_output=False):
            if workflow.executor_id is not None and workflow.executor_id != self._executor:
                found.setdefault(workflow.executor_id, []).append(workflow.workflow_id)
        return found

    def take_over(self, workflows: list[str]) -> None:
        """Let any living process run these."""
        DBOS.resume_workflows(workflows, queue_name=QUEUE)

    def forget_ended(self) -> None:
        """Delete what ended a day ago: DBOS keeps everything for ever."""
        before = (datetime.now(UTC) - KEEP).isoformat()
        while old := DBOS.list_workflows(
            status=ENDED, end_time=before, limit=_AT_ONCE, load_input=False, load_output=False
        ):
            DBOS.delete_workflows([workflow.workflow_id for workflow in old])

    def close(self) -> None:
        """Stop taking work up; runs under way must have ended."""
        DBOS.destroy()
        _runner.clear()


def _id(job: str, run: int) -> str:
    return f"{job}.{run}"


def _open(records: URL) -> None:
    """Readers and writers of the file do not block each other; DBOS leaves a new file in the mode where they do."""
    with closing(sqlite3.connect(records.database or "")) as driver:
        driver.execute("PRAGMA journal_mode = WAL")
