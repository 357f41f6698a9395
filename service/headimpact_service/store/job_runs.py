"""What a process does that works on a job: take it up, commit its parts once, end it or hand it back.

Every function is fenced by the number of the run: a process that was taken for dead, and is not, changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, Literal

from sqlalchemy import Connection, bindparam, delete, insert, select, update

from headimpact_service.store.jobs import Job, State
from headimpact_service.store.tables import job_chunks, jobs

Committed = Literal["stored", "cancelling", "superseded"]

_JOB = select(jobs).where(jobs.c.id == bindparam("job_id"))
_UNFINISHED = select(jobs).where(jobs.c.finished_at.is_(None)).order_by(jobs.c.id)
_UPDATE = update(jobs).where(jobs.c.id == bindparam("job"))
_CHUNKS = select(job_chunks.c.outcome).where(job_chunks.c.job_id == bindparam("job_id")).order_by(job_chunks.c.number)
_CHUNK = select(job_chunks.c.number).where(
    job_chunks.c.job_id == bindparam("job_id"), job_chunks.c.number == bindparam("chunk")
)
_FORGET = delete(job_chunks).where(job_chunks.c.job_id == bindparam("job"))
_OLD = select(jobs.c.id).where(jobs.c.finished_at < bindparam("before")).order_by(jobs.c.finished_at)


def unfinished(conn: Connection) -> list[Job]:
    """Every job of every organisation that has not ended, the oldest first."""
    return [Job(**row) for row in conn.execute(_UNFINISHED).mappings()]


def get(conn: Connection, job_id: bytes) -> Job | None:
    """A job, whoever's it is."""
    row = conn.execute(_JOB, {"job_id": job_id}).mappings().first()
    return None if row is None else Job(**row)


def begin(conn: Connection, job_id: bytes, run: int) -> Job | None:
    """Take a run up; None if the job has ended or is in another run."""
    found = _of_run(conn, job_id, run)
    if found is None:
        return None
    now = datetime.now(UTC)
    state = "running" if found.state == "queued" else found.state
    _change(conn, job_id, now, {"state": state, "started_at": found.started_at or now})
    return found


def risk(conn: Connection, job_id: bytes, run: int) -> None:
    """Count this run as a crash until it ends or gets on."""
    found = _of_run(conn, job_id, run)
    if found is not None:
        _change(conn, job_id, datetime.now(UTC), {"crashes": found.crashes + 1})


def expect(conn: Connection, job_id: bytes, run: int, total: int) -> None:
    """Say how many parts there are."""
    if _of_run(conn, job_id, run) is not None:
        _change(conn, job_id, datetime.now(UTC), {"total": total})


def commit(
    conn: Connection,
    job_id: bytes,
    run: int,
    chunk: int,
    done: int,
    write: Callable[[Connection], Mapping[str, Any]],
) -> Committed:
    """Do a part of a job and mark it as done, in one transaction and once, however often it is called."""
    found = _of_run(conn, job_id, run)
    if found is None:
        return "superseded"
    if found.state == "cancelling":
        return "cancelling"
    if conn.execute(_CHUNK, {"job_id": job_id, "chunk": chunk}).first() is None:
        outcome = dict(write(conn))
        conn.execute(insert(job_chunks), {"job_id": job_id, "number": chunk, "outcome": outcome})
        # The job got on: of all its runs only this one may still turn out to crash here.
        _change(conn, job_id, datetime.now(UTC), {"done": found.done + done, "crashes": 1})
    return "stored"


def outcomes(conn: Connection, job_id: bytes) -> list[Mapping[str, Any]]:
    """What each committed part came to, in order."""
    return list(conn.execute(_CHUNKS, {"job_id": job_id}).scalars())


def finish(
    conn: Connection,
    job_id: bytes,
    run: int,
    state: State,
    *,
    result: Mapping[str, Any] | None,
    details: Mapping[str, Any] | None = None,
    problem: Mapping[str, Any] | None = None,
) -> bool:
    """End the job, and forget its parts and arguments; False if it had ended, or went on in another run."""
    if _of_run(conn, job_id, run) is None:
        return False
    now = datetime.now(UTC)
    ending = {"state": state, "result": result, "details": details, "problem": problem}
    # What was sent beside a file may name people; who looks at the job later needs none of it.
    _change(conn, job_id, now, {**ending, "arguments": {}, "finished_at": now})
    conn.execute(_FORGET, {"job": job_id})
    return True


def hand_back(conn: Connection, job_id: bytes, run: int, *, crashes: int, not_before: datetime | None = None) -> bool:
    """Let another run take the job up; `crashes` is added to their count. False if the job is not in this run."""
    found = _of_run(conn, job_id, run)
    if found is None:
        return False
    changes: dict[str, Any] = {"run": run + 1, "not_before": not_before, "crashes": found.crashes + crashes}
    if found.state == "running":
        changes["state"] = "queued"
    _change(conn, job_id, datetime.now(UTC), changes)
    return True


def delete_ended(conn: Connection, before: datetime, limit: int = 1000) -> int:
    """Delete up to `limit` jobs that ended before an instant; how many they were."""
    old: Sequence[bytes] = conn.execute(_OLD.limit(limit), {"before": before}).scalars().all()
    if old:
        conn.execute(delete(jobs).where(jobs.c.id.in_(old)))
    return len(old)


def _of_run(conn: Connection, job_id: bytes, run: int) -> Job | None:
    """The job, if it has not ended and this is its present run."""
    found = get(conn, job_id)
    return None if found is None or found.ended or found.run != run else found


def _change(conn: Connection, job_id: bytes, now: datetime, values: Mapping[str, Any]) -> None:
    conn.execute(_UPDATE, {"job": job_id, "updated_at": now, **values})
