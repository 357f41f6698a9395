"""The engine inside a process: fires schedules, brings jobs to be run, takes over from the dead, cleans up at night.

It starts DBOS with the first job, not before: its import costs seconds and some 30 MB.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy.engine import URL
from sqlalchemy.exc import SQLAlchemyError

from headimpact_service import memory
from headimpact_service.deps import uploads_of
from headimpact_service.intake.cron import next_due
from headimpact_service.jobs import runs
from headimpact_service.jobs.fit import Fit
from headimpact_service.jobs.import_file import ImportFile
from headimpact_service.jobs.rescore import Rescore
from headimpact_service.jobs.runs import House, Kind
from headimpact_service.jobs.slots import slot_of
from headimpact_service.settings import Settings
from headimpact_service.store import ids, job_runs, schedules
from headimpact_service.store.database import Database
from headimpact_service.store.jobs import Job
from headimpact_service.store.slot import Slot, SlotLostError, SlotsTakenError
from headimpact_service.store.uploads import job_folder

if TYPE_CHECKING:
    from headimpact_service.jobs.transact import Transact

logger = logging.getLogger(__name__)

TICK_S = 3.0
FREE_S = 10.0
"""A process whose slot was seen free so long ago and is free now is dead."""
STOP_S = 15.0
NIGHT = 3
"""The hour of the clean-up (UTC)."""
OTHERS_AGE_S = 24 * 3600.0
"""Another process may be receiving an upload; one this old is nobody's."""
KINDS: Mapping[str, Kind] = {kind.name: kind for kind in (ImportFile(), Fit(), Rescore())}


class Engine:
    """Runs the jobs of one database in this process until it is stopped."""

    def __init__(self, house: House, folder: Path, *, retention_days: int, at_once: int = 1) -> None:
        """`folder` holds what the processes of this database share; `at_once` jobs run in this one together."""
        self._house = house
        self._folder = folder
        self._retention = timedelta(days=retention_days)
        self._at_once = at_once
        self._woken = threading.Event()
        self._active = 0
        self._lock = threading.Lock()
        self._transact: Transact | None = None
        self._seen_free: dict[str, float] = {}
        self._next_night = datetime.now(UTC)
        self._left_over: set[str] = set()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Take a place among the processes that work, then begin, beside the caller.

        A process that serves must not take uploads before: what others find in the folder while they are alone is
        nobody's, unless a job has it.
        """
        try:
            slot = slot_of(self._house.database, self._folder)
        except (OSError, SQLAlchemyError, SlotsTakenError):
            logger.exception("No jobs run in this process: it could not take a place among those that work.")
            return
        self._left_over = self._house.uploads.names()
        self._thread = threading.Thread(target=self._work, args=(slot,), name="headimpact-jobs", daemon=True)
        self._thread.start()

    def wake(self) -> None:
        """Look at the jobs now: there is a new one, or one was cancelled."""
        self._woken.set()

    def stop(self) -> None:
        """Hand back what is under way and end; blocks until that is done."""
        self._house.stopping.set()
        self._woken.set()
        if self._thread is not None:
            self._thread.join()

    def _work(self, slot: Slot) -> None:
        with slot:
            while not self._house.stopping.is_set():
                self._woken.clear()
                self._round(slot)
                self._woken.wait(TICK_S)
            self._close()

    def _round(self, slot: Slot) -> None:
        try:
            slot.keep()
            self._tick(slot)
        except SlotLostError:
            logger.exception("No jobs run in this process any more; start it again.")
            self._house.stopping.set()
        except Exception:
            logger.exception("The job engine could not do its round; it tries again.")

    def _tick(self, slot: Slot) -> None:
        if datetime.now(UTC) >= self._next_night:
            self._clean_up(slot)
            self._next_night = next_night(datetime.now(UTC))
        with self._house.database.read() as conn:
            due = schedules.next_due(conn)
        if due is not None and due <= (now := datetime.now(UTC)):
            self._house.database.write(lambda conn: schedules.fire(conn, now, next_due))
        with self._house.database.read() as conn:
            unfinished = job_runs.unfinished(conn)
        if unfinished and self._transact is None:
            self._transact = self._launch(slot)
        if self._transact is not None:
            self._bring(self._transact, unfinished)
            self._take_over(self._transact, slot)

    def _launch(self, slot: Slot) -> Transact:
        from headimpact_service.jobs.transact import Transact  # costs seconds: not before there is a job

        launched = Transact(self._records(), slot.name, self._run, at_once=self._at_once)
        memory.spare_the_collector()
        memory.let_go_of_code()
        return launched

    def _records(self) -> URL:
        """Where DBOS keeps what it knows of the runs."""
        database = self._house.database
        return URL.create("sqlite", database=str(self._folder / "engine.db")) if database.is_file else database.url

    def _bring(self, transact: Transact, unfinished: Iterable[Job]) -> None:
        """Order a run of every job that has none; one whose run ended without ending the job gets another."""
        wanted = {(ids.encode("job", job.id), job.run): job for job in unfinished}
        known = transact.known(wanted) if wanted else {}
        for run, job in wanted.items():
            if run not in known:
                transact.enqueue(*run, delay_s=_seconds_until(job.not_before))
            elif not known[run]:
                self._house.database.write(
                    lambda conn, job=job: job_runs.hand_back(conn, job.id, job.run, crashes=1)  # type: ignore[misc]  # the default binds the loop's job
                )
                self._woken.set()

    def _run(self, job: str, run: int) -> None:
        """What a thread of DBOS does."""
        job_id = ids.decode("job", job)
        assert job_id is not None
        with self._lock:
            self._active += 1
        try:
            runs.run(self._house, KINDS, job_id, run)
        finally:
            with self._lock:
                self._active -= 1
            self._woken.set()

    def _take_over(self, transact: Transact, slot: Slot) -> None:
        """Take up what processes left that are seen to be dead twice."""
        pending = transact.pending_elsewhere()
        free = {name for name in pending if slot.is_free(name)}
        self._seen_free = {name: self._seen_free.get(name, time.monotonic()) for name in free}
        for name, since in self._seen_free.items():
            if time.monotonic() - since >= FREE_S:
                transact.take_over(pending[name])

    def _clean_up(self, slot: Slot) -> None:
        """Delete jobs that ended long ago, DBOS's records of ended runs, and uploads of no job."""
        before = datetime.now(UTC) - self._retention
        while self._house.database.write(lambda conn: job_runs.delete_ended(conn, before)):
            pass
        if self._transact is not None:
            self._transact.forget_ended()
        self._clean_uploads(slot)

    def _clean_uploads(self, slot: Slot) -> None:
        """Delete files of no job: what lay there when this process began, if it is alone, and what is very old.

        The jobs are read after the files: one that arrives meanwhile has its job by then or is not among them.
        """
        found = self._house.uploads.names(older_than_s=OTHERS_AGE_S)
        if slot.is_alone():
            found |= self._left_over
        with self._house.database.read() as conn:
            found -= {ids.encode("job", job.id) for job in job_runs.unfinished(conn)}
        for name in found:
            self._house.uploads.remove(name)
        self._left_over = set()

    def _close(self) -> None:
        """Wait for the runs to hand their jobs back, then close."""
        if self._transact is None:
            return
        deadline = time.monotonic() + STOP_S
        while self._active and time.monotonic() < deadline:
            self._woken.wait(0.1)
            self._woken.clear()
        self._transact.close()


def engine_of(settings: Settings, database: Database) -> Engine:
    """The engine of a process with these settings."""
    house = House(database, uploads_of(settings, database), settings.job_memory)
    return Engine(house, job_folder(database.url), retention_days=settings.job_retention_days)


def next_night(now: datetime) -> datetime:
    """When the next clean-up is due."""
    tonight = now.replace(hour=NIGHT, minute=0, second=0, microsecond=0)
    return tonight if tonight > now else tonight + timedelta(days=1)


def _seconds_until(moment: datetime | None) -> float:
    return 0.0 if moment is None else max(0.0, (moment - datetime.now(UTC)).total_seconds())
