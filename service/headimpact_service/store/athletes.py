"""Athletes: pseudonymous people, made on first sight, erased for good."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from typing import Any, Literal

from sqlalchemy import Connection, RowMapping, bindparam, insert, select, update

from headimpact_service.errors import Problem, not_found
from headimpact_service.store import erasure, ids
from headimpact_service.store.clock import next_change
from headimpact_service.store.paging import Page, Position, keyset, page_of
from headimpact_service.store.revision import require_revision
from headimpact_service.store.tables import athletes

Consent = Literal["granted", "withdrawn"]


@dataclass(frozen=True, slots=True, kw_only=True)
class AthleteFields:
    """What a client says of an athlete."""

    external_id: str | None = None
    tags: tuple[str, ...] = ()
    sport: str | None = None
    level: str | None = None
    position: str | None = None
    sex: str | None = None
    birth_year: int | None = None
    time_zone: str | None = None
    consent: Consent | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Athlete(AthleteFields):
    """An athlete as stored; of an erased one only the times are left."""

    id: bytes
    revision: int
    created_at: datetime
    updated_at: datetime
    deleted_at: datetime | None


_NOTHING: dict[str, Any] = asdict(AthleteFields())
_COLUMNS = [column for column in athletes.c if column.name != "data_set_id"]
_ATHLETE = select(*_COLUMNS).where(athletes.c.data_set_id == bindparam("data_set_id"))
_BY_ID = _ATHLETE.where(athletes.c.id == bindparam("athlete_id"), athletes.c.deleted_at.is_(None))
_BY_EXTERNAL_ID = _ATHLETE.where(athletes.c.external_id == bindparam("external_id"))


def create(conn: Connection, data_set_id: bytes, new: AthleteFields) -> Athlete:
    """A new athlete; an `external-id-conflict` problem if the external id is taken."""
    now = next_change(conn, athletes, data_set_id)
    made = Athlete(**asdict(new), id=ids.new(), revision=1, created_at=now, updated_at=now, deleted_at=None)
    _require_free(conn, data_set_id, new.external_id)
    conn.execute(insert(athletes), asdict(made) | {"data_set_id": data_set_id})
    return made


def get(conn: Connection, data_set_id: bytes, athlete_id: bytes) -> Athlete | None:
    """An athlete who was not erased."""
    row = conn.execute(_BY_ID, {"data_set_id": data_set_id, "athlete_id": athlete_id}).mappings().first()
    return None if row is None else _athlete(row)


def find(conn: Connection, data_set_id: bytes, external_id: str) -> Athlete | None:
    """The athlete of an external id."""
    query = {"data_set_id": data_set_id, "external_id": external_id}
    row = conn.execute(_BY_EXTERNAL_ID, query).mappings().first()
    return None if row is None else _athlete(row)


def ensure(conn: Connection, data_set_id: bytes, external_id: str) -> bytes:
    """The id of the athlete of an external id, made on first sight."""
    found = find(conn, data_set_id, external_id)
    return (found or create(conn, data_set_id, AthleteFields(external_id=external_id))).id


def page(
    conn: Connection,
    data_set_id: bytes,
    *,
    external_id: str | None = None,
    updated_since: datetime | None = None,
    limit: int = 100,
    after: Position | None = None,
) -> Page[Athlete]:
    """A page of the list: newest first, or by change with tombstones if `updated_since` is given."""
    query = _ATHLETE
    if external_id is not None:
        query = query.where(athletes.c.external_id == external_id)
    query = keyset(query, athletes, updated_since=updated_since, after=after, limit=limit)
    rows = conn.execute(query, {"data_set_id": data_set_id}).mappings()
    return page_of([_athlete(row) for row in rows], limit)


def patch(
    conn: Connection,
    data_set_id: bytes,
    athlete_id: bytes,
    changes: Mapping[str, object],
    *,
    if_match: int | None = None,
) -> Athlete:
    """Change the fields of :class:`AthleteFields` that are named; the revision grows only if something changes."""
    present = _require(conn, data_set_id, athlete_id)
    require_revision(present.revision, if_match)
    changed = replace(present, **_known(changes))
    if changed == present:
        return present
    if changed.external_id != present.external_id:
        _require_free(conn, data_set_id, changed.external_id)
    now = next_change(conn, athletes, data_set_id)
    return _update(conn, replace(changed, revision=present.revision + 1, updated_at=now))


def erase(conn: Connection, data_set_id: bytes, athlete_id: bytes, *, if_match: int | None = None) -> Athlete:
    """Erase an athlete: identity, impacts, traces and scores, also those of corrections that moved an impact away.

    What stays are rows that say that something was here and when it went, so that other systems can follow. The
    external id is free for somebody else.
    """
    present = _require(conn, data_set_id, athlete_id)
    require_revision(present.revision, if_match)
    erasure.erase_athletes_impacts(conn, data_set_id, athlete_id)
    now = next_change(conn, athletes, data_set_id)
    gone = replace(present, **_NOTHING, revision=present.revision + 1, updated_at=now, deleted_at=now)
    return _update(conn, gone)


def _known(changes: Mapping[str, object]) -> dict[str, Any]:
    """The changes by field; a name that is no field is a mistake of the caller."""
    unknown = changes.keys() - _NOTHING.keys()
    if unknown:
        raise ValueError(f"no fields of an athlete: {sorted(unknown)}")
    known: dict[str, Any] = dict(changes)
    if "tags" in known:
        known["tags"] = tuple(known["tags"] or ())
    return known


def _update(conn: Connection, athlete: Athlete) -> Athlete:
    values = asdict(athlete)
    conn.execute(update(athletes).where(athletes.c.id == athlete.id), values)
    return athlete


def _require(conn: Connection, data_set_id: bytes, athlete_id: bytes) -> Athlete:
    found = get(conn, data_set_id, athlete_id)
    if found is None:
        raise not_found("athlete")
    return found


def _require_free(conn: Connection, data_set_id: bytes, external_id: str | None) -> None:
    if external_id is not None and find(conn, data_set_id, external_id) is not None:
        raise Problem("external-id-conflict", "Another athlete has this external_id.")


def _athlete(row: RowMapping) -> Athlete:
    return Athlete(**dict(row) | {"tags": tuple(row["tags"])})
