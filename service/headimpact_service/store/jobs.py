"""Jobs as their owners see them: ordered in the caller's own transaction, read, listed, told to stop.

What a process does that works on one is in :mod:`.job_runs`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Set
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Literal

from sqlalchemy import Connection, bindparam, insert, select, update

from headimpact_service.errors import Problem, not_found
from headimpact_service.store import ids
from headimpact_service.store.paging import Page, Position, keyset, page_of
from headimpact_service.store.tables import job_chunks, jobs

State = Literal["queued", "running", "cancelling", "succeeded", "failed", "cancelled"]
ENDED: frozenset[str] = frozenset({"succeeded", "failed", "cancelled"})


@dataclass(frozen=True, slots=True, kw_only=True)
class NewJob:
    """A job to be done. `request_hash` says what was asked for, so that an idempotency key names one request only."""

    kind: str
    arguments: Mapping[str, Any]
    key_id: bytes | None = None
    idempotency_key: str | None = None
    request_hash: bytes | None = None
    id: bytes = field(default_factory=ids.new)


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A job as stored. `done` of `total` are committed; `total` is None until it is known.

    `result` is short, `details` may be long: what is read for a list leaves them out, and the arguments. A job that
    has ended has no arguments any more.
    """

    id: bytes
    data_set_id: bytes
    key_id: bytes | None
    kind: str
    idempotency_key: str | None
    request_hash: bytes | None
    arguments: Mapping[str, Any] = field(default_factory=dict)
    state: State
    run: int
    crashes: int
    not_before: datetime | None
    done: int
    total: int | None
    result: Mapping[str, Any] | None
    details: Mapping[str, Any] | None = None
    problem: Mapping[str, Any] | None
    created_at: datetime
    updated_at: datetime
    started_at: datetime | None
    finished_at: datetime | None

    @property
    def ended(self) -> bool:
        """Whether nothing more will happen to it."""
        return self.state in ENDED


_JOB = select(jobs)
_OF_DATA_SET = _JOB.where(jobs.c.data_set_id == bindparam("data_set_id"))
_LIST = select(*(column for column in jobs.c if column.name not in {"arguments", "details"})).where(
    jobs.c.data_set_id == bindparam("data_set_id")
)
_ONE = _OF_DATA_SET.where(jobs.c.id == bindparam("job_id"))
_BY_KEY = _OF_DATA_SET.where(jobs.c.idempotency_key == bindparam("idempotency_key"))
_CANCEL = update(jobs).where(jobs.c.id == bindparam("job"))
_REFUSED = select(jobs.c.id, jobs.c.details).where(
    jobs.c.data_set_id == bindparam("data_set_id"), jobs.c.details.is_not(None)
)
_REFUSED_SO_FAR = (
    select(job_chunks.c.job_id, job_chunks.c.number, job_chunks.c.outcome)
    .join(jobs, jobs.c.id == job_chunks.c.job_id)
    .where(jobs.c.data_set_id == bindparam("data_set_id"))
)
_SET_DETAILS = update(jobs).where(jobs.c.id == bindparam("of_job")).values(details=bindparam("document"))
_SET_OUTCOME = (
    update(job_chunks)
    .where(job_chunks.c.job_id == bindparam("of_job"), job_chunks.c.number == bindparam("of_number"))
    .values(outcome=bindparam("document"))
)


def submit(conn: Connection, data_set_id: bytes, new: NewJob) -> Job:
    """Order a job in this transaction: it exists if and only if the rest of the transaction does.

    The idempotency key of a job that exists gives that job, or an `idempotency-conflict` problem if it was ordered
    by another request.
    """
    existing = find_same_request(conn, data_set_id, new.idempotency_key, new.request_hash)
    if existing is not None:
        return existing
    now = datetime.now(UTC)
    row = {
        "id": new.id,
        "data_set_id": data_set_id,
        "key_id": new.key_id,
        "kind": new.kind,
        "idempotency_key": new.idempotency_key,
        "request_hash": new.request_hash,
        "arguments": dict(new.arguments),
        "state": "queued",
        "run": 1,
        "crashes": 0,
        "done": 0,
        "created_at": now,
        "updated_at": now,
    }
    conn.execute(insert(jobs), row)
    return require(conn, data_set_id, new.id)


def find_same_request(
    conn: Connection, data_set_id: bytes, idempotency_key: str | None, request_hash: bytes | None
) -> Job | None:
    """The job that this idempotency key has made already; 409 if another request made it."""
    found = keyed(conn, data_set_id, idempotency_key)
    if found is not None and found.request_hash != request_hash:
        raise Problem("idempotency-conflict", "This Idempotency-Key was sent before with another request.")
    return found


def keyed(conn: Connection, data_set_id: bytes, idempotency_key: str | None) -> Job | None:
    """The job that an idempotency key has made."""
    if idempotency_key is None:
        return None
    row = conn.execute(_BY_KEY, {"data_set_id": data_set_id, "idempotency_key": idempotency_key}).mappings().first()
    return None if row is None else Job(**row)


def get(conn: Connection, data_set_id: bytes, job_id: bytes) -> Job | None:
    """A job of the data set."""
    row = conn.execute(_ONE, {"data_set_id": data_set_id, "job_id": job_id}).mappings().first()
    return None if row is None else Job(**row)


def require(conn: Connection, data_set_id: bytes, job_id: bytes) -> Job:
    """The same, or a `not-found` problem."""
    found = get(conn, data_set_id, job_id)
    if found is None:
        raise not_found("job")
    return found


def page(
    conn: Connection,
    data_set_id: bytes,
    *,
    kinds: Collection[str],
    state: str | None = None,
    limit: int = 100,
    after: Position | None = None,
) -> Page[Job]:
    """A page of the jobs of these kinds, newest first."""
    query = _LIST.where(jobs.c.kind.in_(sorted(kinds)))
    if state is not None:
        query = query.where(jobs.c.state == state)
    query = keyset(query, jobs, updated_since=None, after=after, limit=limit)
    rows = conn.execute(query, {"data_set_id": data_set_id}).mappings()
    return page_of([Job(**row) for row in rows], limit)


def cancel(conn: Connection, data_set_id: bytes, job_id: bytes) -> Job:
    """Tell a job to stop. One that never began is over at once; another stops before its next part.

    A job that is stopping or was cancelled stays as it is; one that has ended otherwise is a `conflict`.
    """
    found = require(conn, data_set_id, job_id)
    if found.state in {"cancelling", "cancelled"}:
        return found
    if found.ended:
        raise Problem("conflict", "The job has ended; nothing is left to cancel.")
    now = datetime.now(UTC)
    values: dict[str, Any] = {"state": "cancelling", "not_before": None, "updated_at": now}
    if found.started_at is None:
        problem = Problem("job-cancelled", "Cancelled before it began; nothing was changed.")
        values |= {"state": "cancelled", "finished_at": now, "problem": problem.as_dict(), "arguments": {}}
    conn.execute(_CANCEL, {"job": job_id, **values})
    return require(conn, data_set_id, job_id)


def forget_names(conn: Connection, data_set_id: bytes, external_ids: Set[str]) -> None:
    """Take external ids out of what jobs say of the impacts that they refused; the rows stay, and count."""
    parameters = {"data_set_id": data_set_id}
    ended = [
        {"of_job": job, "document": document}
        for job, details in conn.execute(_REFUSED, parameters)
        if (document := _without_names(details, external_ids)) is not None
    ]
    under_way = [
        {"of_job": job, "of_number": number, "document": document}
        for job, number, outcome in conn.execute(_REFUSED_SO_FAR, parameters)
        if (document := _without_names(outcome, external_ids)) is not None
    ]
    if ended:
        conn.execute(_SET_DETAILS, ended)
    if under_way:
        conn.execute(_SET_OUTCOME, under_way)


def _without_names(document: Mapping[str, Any], external_ids: Set[str]) -> dict[str, Any] | None:
    """The document with these names as null; None where it has none of them."""
    refused = document.get("failed")
    if not isinstance(refused, list) or not any(row["external_id"] in external_ids for row in refused):
        return None
    rows = [row | {"external_id": None} if row["external_id"] in external_ids else row for row in refused]
    return {**document, "failed": rows}
