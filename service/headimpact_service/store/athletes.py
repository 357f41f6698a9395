"""Athletes: pseudonymous people, made on first sight, erased for good."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from typing import Any, Literal

from sqlalchemy import Connection, RowMapping, bindparam, delete, insert, or_, select, update

from headimpact_service.errors import Problem, not_found
from headimpact_service.store import erasure, ids, labels
from headimpact_service.store.clock import next_change
from headimpact_service.store.columns import MICROSECOND
from headimpact_service.store.many import in_parts
from headimpact_service.store.paging import Page, Position, keyset, page_of
from headimpact_service.store.revision import require_revision
from headimpact_service.store.tables import athletes, diagnoses, impact_revisions, impacts

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
    merged_into: bytes | None = None


_NOTHING: dict[str, Any] = asdict(AthleteFields())
_COLUMNS = [column for column in athletes.c if column.name != "data_set_id"]
_ATHLETE = select(*_COLUMNS).where(athletes.c.data_set_id == bindparam("data_set_id"))
_BY_ID = _ATHLETE.where(athletes.c.id == bindparam("athlete_id"), athletes.c.deleted_at.is_(None))
_MERGED_INTO = select(athletes.c.merged_into).where(
    athletes.c.data_set_id == bindparam("data_set_id"), athletes.c.id == bindparam("athlete_id")
)
_FORGET_MERGED = (
    update(athletes)
    .where(athletes.c.data_set_id == bindparam("of_data_set"), athletes.c.merged_into == bindparam("athlete"))
    .values(external_id=None)
)
_FORGET_DIAGNOSES = delete(diagnoses).where(
    diagnoses.c.data_set_id == bindparam("of_data_set"), diagnoses.c.athlete_id == bindparam("athlete")
)
_MOVE = [
    update(table)
    .where(table.c.data_set_id == bindparam("of_data_set"), table.c.athlete_id == bindparam("source"))
    .values(athlete_id=bindparam("target"))
    for table in (impact_revisions, diagnoses)
]
_FOLLOW = (
    update(athletes)
    .where(athletes.c.data_set_id == bindparam("of_data_set"), athletes.c.merged_into == bindparam("source"))
    .values(merged_into=bindparam("target"))
)
_IMPACTS_OF = (
    select(impacts.c.id)
    .where(impacts.c.data_set_id == bindparam("data_set_id"), impacts.c.athlete_id == bindparam("athlete_id"))
    .order_by(impacts.c.id)
)
_MOVE_IMPACT = (
    update(impacts)
    .where(impacts.c.data_set_id == bindparam("of_data_set"), impacts.c.id == bindparam("impact"))
    .values(athlete_id=bindparam("target"))
)
_BY_EXTERNAL_ID = _ATHLETE.where(athletes.c.external_id == bindparam("external_id"))
_BY_EXTERNAL_IDS = _ATHLETE.where(athletes.c.external_id.in_(bindparam("asked", expanding=True)))


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


def present(conn: Connection, data_set_id: bytes, athlete_id: bytes) -> Athlete | None:
    """The athlete of an id; of one that was merged, who has the impacts now."""
    into = conn.execute(_MERGED_INTO, {"data_set_id": data_set_id, "athlete_id": athlete_id}).scalar()
    return get(conn, data_set_id, into or athlete_id)


def find(conn: Connection, data_set_id: bytes, external_id: str) -> Athlete | None:
    """The athlete of an external id."""
    query = {"data_set_id": data_set_id, "external_id": external_id}
    row = conn.execute(_BY_EXTERNAL_ID, query).mappings().first()
    return None if row is None else _athlete(row)


def find_many(conn: Connection, data_set_id: bytes, external_ids: Iterable[str]) -> dict[str, Athlete]:
    """The athletes of external ids, as far as they are known."""
    found: dict[str, Athlete] = {}
    for asked in in_parts(external_ids):
        rows = conn.execute(_BY_EXTERNAL_IDS, {"data_set_id": data_set_id, "asked": asked}).mappings()
        found |= {row["external_id"]: _athlete(row) for row in rows}
    return found


def ensure(conn: Connection, data_set_id: bytes, external_id: str) -> bytes:
    """The id of the athlete of an external id, made on first sight; of a merged one that of whom it was merged into."""
    found = find(conn, data_set_id, external_id) or create(conn, data_set_id, AthleteFields(external_id=external_id))
    return found.merged_into or found.id


def page(
    conn: Connection,
    data_set_id: bytes,
    *,
    external_id: str | None = None,
    updated_since: datetime | None = None,
    limit: int = 100,
    after: Position | None = None,
) -> Page[Athlete]:
    """A page of the list: newest first, or by change with tombstones if `updated_since` is given.

    Who bears an external id is also the athlete whom that one was merged into.
    """
    query = _ATHLETE
    if external_id is not None:
        named = athletes.c.external_id == external_id
        merged = select(athletes.c.merged_into).where(athletes.c.data_set_id == data_set_id, named).scalar_subquery()
        query = query.where(or_(named, athletes.c.id == merged))
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
    present = require(conn, data_set_id, athlete_id)
    require_revision(present.revision, if_match)
    changed = replace(present, **_known(changes))
    if changed == present:
        return present
    if changed.external_id != present.external_id:
        _require_free(conn, data_set_id, changed.external_id, of=athlete_id)
    return _changed(conn, data_set_id, present, changed)


def _changed(conn: Connection, data_set_id: bytes, present: Athlete, changed: Athlete) -> Athlete:
    """Keep other fields of an athlete; impacts show some of them, so these change with them."""
    if (changed.external_id, changed.consent) != (present.external_id, present.consent):
        _move_impacts(conn, data_set_id, present.id, present.id)
    now = next_change(conn, athletes, data_set_id)
    return _update(conn, replace(changed, revision=present.revision + 1, updated_at=now))


def erase(conn: Connection, data_set_id: bytes, athlete_id: bytes, *, if_match: int | None = None) -> Athlete:
    """Erase an athlete: identity, impacts, traces and scores, also those of corrections that moved an impact away.

    What stays are rows that say that something was here and when it went, so that other systems can follow. The
    external id is free for somebody else.
    """
    present = require(conn, data_set_id, athlete_id)
    require_revision(present.revision, if_match)
    erasure.erase_athletes_impacts(conn, data_set_id, athlete_id)
    conn.execute(_FORGET_MERGED, {"of_data_set": data_set_id, "athlete": athlete_id})
    labels.forget_diagnosed(conn, data_set_id, athlete_id)
    conn.execute(_FORGET_DIAGNOSES, {"of_data_set": data_set_id, "athlete": athlete_id})
    now = next_change(conn, athletes, data_set_id)
    gone = replace(present, **_NOTHING, revision=present.revision + 1, updated_at=now, deleted_at=now)
    return _update(conn, gone)


def merge(
    conn: Connection, data_set_id: bytes, athlete_id: bytes, into: bytes, *, if_match: int | None = None
) -> Athlete:
    """Two athletes turn out to be one: impacts with their history and labels, and diagnoses, go over to `into`.

    What `into` does not say of itself is taken from the other. The other leaves a tombstone that keeps its external
    id, so that impacts that are sent under it find their way. A consent that either withdrew is withdrawn.
    """
    target = require(conn, data_set_id, into)
    if athlete_id == into:
        raise Problem("conflict", "An athlete cannot be merged into itself.")
    if present(conn, data_set_id, athlete_id) == target:
        return target  # it was done before, and its answer may not have arrived
    source = require(conn, data_set_id, athlete_id)
    require_revision(source.revision, if_match)
    _move_all(conn, data_set_id, athlete_id, into)
    now = next_change(conn, athletes, data_set_id)
    nothing = _NOTHING | {"external_id": source.external_id}
    gone = replace(source, **nothing, revision=source.revision + 1, updated_at=now, deleted_at=now, merged_into=into)
    _update(conn, gone)
    conn.execute(_FOLLOW, {"of_data_set": data_set_id, "source": athlete_id, "target": into})
    merged = replace(target, **_completed(target, source))
    if merged == target:
        return target
    return _changed(conn, data_set_id, target, merged)


def _move_all(conn: Connection, data_set_id: bytes, source: bytes, target: bytes) -> None:
    for statement in _MOVE:
        conn.execute(statement, {"of_data_set": data_set_id, "source": source, "target": target})
    _move_impacts(conn, data_set_id, source, target)


def _move_impacts(conn: Connection, data_set_id: bytes, source: bytes, target: bytes) -> None:
    """Make an athlete's impacts another's, or touch them if both are one: who follows the list sees them again."""
    moved = conn.execute(_IMPACTS_OF, {"data_set_id": data_set_id, "athlete_id": source}).scalars().all()
    first = next_change(conn, impacts, data_set_id)
    rows = [
        {"of_data_set": data_set_id, "impact": impact, "target": target, "updated_at": first + number * MICROSECOND}
        for number, impact in enumerate(moved)
    ]
    if rows:
        conn.execute(_MOVE_IMPACT, rows)


def _completed(target: Athlete, source: Athlete) -> dict[str, Any]:
    """What the target takes over."""
    taken = {name: getattr(target, name) or getattr(source, name) for name in _NOTHING if name != "external_id"}
    taken["tags"] = tuple(dict.fromkeys((*target.tags, *source.tags)))
    if "withdrawn" in {target.consent, source.consent}:
        taken["consent"] = "withdrawn"
    return taken


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


def require(conn: Connection, data_set_id: bytes, athlete_id: bytes) -> Athlete:
    """An athlete who was not erased, or a `not-found` problem, which says into whom one was merged."""
    found = get(conn, data_set_id, athlete_id)
    if found is not None:
        return found
    merged = present(conn, data_set_id, athlete_id)
    if merged is None:
        raise not_found("athlete")
    raise Problem("not-found", f"This athlete was merged into {ids.encode('ath', merged.id)}.")


def _require_free(conn: Connection, data_set_id: bytes, external_id: str | None, of: bytes | None = None) -> None:
    found = None if external_id is None else find(conn, data_set_id, external_id)
    if found is None:
        return
    if of is not None and found.merged_into == of:
        detail = "This external_id came to the athlete with a merge: what is sent under it is this athlete's."
        raise Problem("external-id-conflict", detail)
    raise Problem("external-id-conflict", "Another athlete has this external_id.")


def _athlete(row: RowMapping) -> Athlete:
    return Athlete(**dict(row) | {"tags": tuple(row["tags"])})
