"""Schedules of fits: when each is due next, and how a due one becomes one job, however many processes look."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, bindparam, delete, insert, select, update

from headimpact_service.errors import not_found
from headimpact_service.store import jobs
from headimpact_service.store.jobs import Job, NewJob
from headimpact_service.store.revision import require_revision
from headimpact_service.store.tables import schedules

NextDue = Callable[[str, str, datetime], datetime | None]
"""When a cron expression in a zone is due next after an instant."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewSchedule:
    """When to fit, what, and what the model must pass; with `promote` it becomes active if it does."""

    cron: str
    time_zone: str
    enabled: bool
    fit: Mapping[str, Any]
    gates: Mapping[str, Any]
    promote: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule(NewSchedule):
    """The same as stored. `next_due` is None while it is not enabled, or where its days never come."""

    data_set_id: bytes
    name: str
    next_due: datetime | None
    last_fired: datetime | None
    last_job_id: bytes | None
    last_digest: str | None
    revision: int
    key_id: bytes | None
    created_at: datetime
    updated_at: datetime


_ALL = select(schedules)
_OF_DATA_SET = _ALL.where(schedules.c.data_set_id == bindparam("data_set_id"))
_ONE = _OF_DATA_SET.where(schedules.c.name == bindparam("name"))
_DUE = _ALL.where(schedules.c.enabled, schedules.c.next_due <= bindparam("now")).order_by(schedules.c.next_due)
_NEXT = select(schedules.c.next_due).where(schedules.c.enabled).order_by(schedules.c.next_due).limit(1)
_UPDATE = update(schedules).where(
    schedules.c.data_set_id == bindparam("of_data_set"), schedules.c.name == bindparam("of_name")
)


def get(conn: Connection, data_set_id: bytes, name: str) -> Schedule | None:
    """A schedule of the data set."""
    row = conn.execute(_ONE, {"data_set_id": data_set_id, "name": name}).first()
    return None if row is None else Schedule(**row._asdict())


def list_all(conn: Connection, data_set_id: bytes) -> list[Schedule]:
    """All schedules of the data set, by name."""
    rows = conn.execute(_OF_DATA_SET.order_by(schedules.c.name), {"data_set_id": data_set_id})
    return [Schedule(**row._asdict()) for row in rows]


def put(
    conn: Connection,
    data_set_id: bytes,
    name: str,
    new: NewSchedule,
    key_id: bytes | None,
    next_due: NextDue,
    *,
    if_match: int | None = None,
) -> tuple[Schedule, bool]:
    """Make or replace a schedule, and whether it is new; the same again changes nothing."""
    present = get(conn, data_set_id, name)
    require_revision(0 if present is None else present.revision, if_match, exists=present is not None)
    now = datetime.now(UTC)
    if present is None:
        row = asdict(new) | {
            "data_set_id": data_set_id,
            "name": name,
            "next_due": next_due(new.cron, new.time_zone, now) if new.enabled else None,
            "revision": 1,
            "key_id": key_id,
            "created_at": now,
            "updated_at": now,
        }
        conn.execute(insert(schedules), row)
        return _require(conn, data_set_id, name), True
    if all(getattr(present, field) == value for field, value in asdict(new).items()):
        return present, False
    changes = asdict(new) | {
        "next_due": next_due(new.cron, new.time_zone, now) if new.enabled else None,
        "revision": present.revision + 1,
        "key_id": key_id,
        "updated_at": now,
    }
    conn.execute(_UPDATE, changes | {"of_data_set": data_set_id, "of_name": name})
    return _require(conn, data_set_id, name), False


def remove(conn: Connection, data_set_id: bytes, name: str, *, if_match: int | None = None) -> None:
    """Delete a schedule; the models that it made stay."""
    require_revision(_require(conn, data_set_id, name).revision, if_match)
    conn.execute(delete(schedules).where(schedules.c.data_set_id == data_set_id, schedules.c.name == name))


NOTHING_NEW = "No impact was labelled, corrected or withdrawn since the last fit."
"""Why a schedule skips a cohort that it has seen."""


def last_seen(conn: Connection, data_set_id: bytes, name: str | None) -> str | None:
    """The digest of the cohort that a schedule has seen last; none of no schedule."""
    found = None if name is None else get(conn, data_set_id, name)
    return None if found is None else found.last_digest


def note_fit(conn: Connection, data_set_id: bytes, name: str, digest: str) -> None:
    """Remember which cohort the schedule has seen last."""
    conn.execute(_UPDATE, {"of_data_set": data_set_id, "of_name": name, "last_digest": digest})


def next_due(conn: Connection) -> datetime | None:
    """When any schedule is due next."""
    found: datetime | None = conn.execute(_NEXT).scalar()
    return found


def fire(conn: Connection, now: datetime, next_due: NextDue) -> list[Job]:
    """Order the job of every schedule that is due, and say when each is due again.

    Both happen in one transaction, so of several processes one orders the job. Times that were missed while nothing
    ran are made up for by one job.
    """
    ordered = []
    for row in conn.execute(_DUE, {"now": now}).all():
        schedule = Schedule(**row._asdict())
        job = jobs.submit(conn, schedule.data_set_id, _job(schedule))
        changes = {
            "next_due": next_due(schedule.cron, schedule.time_zone, now),
            "last_fired": now,
            "last_job_id": job.id,
        }
        conn.execute(_UPDATE, changes | {"of_data_set": schedule.data_set_id, "of_name": schedule.name})
        ordered.append(job)
    return ordered


def _job(schedule: Schedule) -> NewJob:
    assert schedule.next_due is not None
    return NewJob(
        kind="fit",
        arguments={
            "fit": dict(schedule.fit),
            "gates": dict(schedule.gates),
            "promote": schedule.promote,
            "schedule": schedule.name,
        },
        key_id=schedule.key_id,
    )


def _require(conn: Connection, data_set_id: bytes, name: str) -> Schedule:
    found = get(conn, data_set_id, name)
    if found is None:
        raise not_found("schedule")
    return found
