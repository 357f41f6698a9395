"""What deletion leaves of an impact: a row that says that something was here, and when it went."""

from __future__ import annotations

from typing import Any

from sqlalchemy import BindParameter, Connection, bindparam, delete, insert, select, update

from headimpact_service.store import duplicates, jobs
from headimpact_service.store.clock import next_change
from headimpact_service.store.columns import MICROSECOND
from headimpact_service.store.impact_rows import former_content, former_event, former_input
from headimpact_service.store.many import in_parts
from headimpact_service.store.tables import former_contents, impact_revisions, impacts, labels, scores

_NOTHING = {
    column.name: None
    for column in impacts.c
    if column.name not in {"id", "data_set_id", "external_id", "external_id_digest", "athlete_id"} and column.nullable
}
_ENTOMB = update(impacts).where(
    impacts.c.data_set_id == bindparam("of_data_set"), impacts.c.id == bindparam("impact_id")
)
_IDS: BindParameter[Any] = bindparam("impact_ids", expanding=True)
_DELIVERED = select(impact_revisions.c.impact_id, impact_revisions.c.content_digest).where(
    impact_revisions.c.impact_id.in_(_IDS)
)
_EVENTS = select(impacts.c.id, impacts.c.athlete_id, impacts.c.occurred_at, impacts.c.input_digest).where(
    impacts.c.data_set_id == bindparam("data_set_id"), impacts.c.id.in_(_IDS), impacts.c.input_digest.is_not(None)
)
_FORGET = delete(former_contents).where(former_contents.c.impact_id == bindparam("impact"))
_FORGET_ONE = _FORGET.where(former_contents.c.digest == bindparam("of_digest"))
_CONTENTS = [
    delete(table).where(table.c.impact_id == bindparam("impact")) for table in (labels, scores, impact_revisions)
]
_REVISION = [
    delete(table).where(table.c.impact_id == bindparam("impact"), table.c.revision == bindparam("number_of_revision"))
    for table in (scores, impact_revisions)
]
_NAMES = select(impacts.c.external_id).where(
    impacts.c.athlete_id == bindparam("athlete_id"), impacts.c.external_id.is_not(None)
)
_MOVED = select(
    impact_revisions.c.impact_id,
    impact_revisions.c.revision,
    impact_revisions.c.data_set_id,
    impact_revisions.c.content_digest,
).where(impact_revisions.c.athlete_id == bindparam("athlete_id"), impact_revisions.c.superseded_at.is_not(None))


def erase_impacts(conn: Connection, data_set_id: bytes, impact_ids: list[bytes], *, external_ids: bool) -> None:
    """Delete the traces, scores, labels and revisions of impacts and all they say; with `external_ids` their names too.

    The athlete's id stays, so that whoever follows one athlete's list sees the tombstone, and so does the digest of
    the external id, so that a redelivery does not bring the impact back; where the names stay, also those of what was
    delivered.
    """
    if not impact_ids:
        return
    if external_ids:
        conn.execute(_FORGET, [{"impact": impact_id} for impact_id in impact_ids])
    else:
        remember(conn, data_set_id, impact_ids)
        _remember_events(conn, data_set_id, impact_ids)
    duplicates.release(conn, data_set_id, impact_ids)
    for statement in _CONTENTS:
        conn.execute(statement, [{"impact": impact_id} for impact_id in impact_ids])
    first = next_change(conn, impacts, data_set_id)
    nothing = _NOTHING | ({"external_id": None} if external_ids else {})
    tombs = []
    for number, impact_id in enumerate(impact_ids):
        now = first + number * MICROSECOND
        tombs.append(
            nothing | {"of_data_set": data_set_id, "impact_id": impact_id, "updated_at": now, "deleted_at": now}
        )
    conn.execute(_ENTOMB.values(revision=impacts.c.revision + 1), tombs)


def remember(conn: Connection, data_set_id: bytes, impact_ids: list[bytes]) -> None:
    """Keep what tells each content that impacts have, or had before they were corrected, from any other."""
    conn.execute(_FORGET, [{"impact": impact_id} for impact_id in impact_ids])
    for part in in_parts(impact_ids):
        delivered = conn.execute(_DELIVERED, {"impact_ids": part}).all()
        kept = {(former_content(data_set_id, content), impact_id) for impact_id, content in delivered}
        rows = [{"data_set_id": data_set_id, "digest": digest, "impact_id": of} for digest, of in sorted(kept)]
        conn.execute(insert(former_contents), rows)


def _remember_events(conn: Connection, data_set_id: bytes, impact_ids: list[bytes]) -> None:
    """Keep what tells the events that are deleted from any other: a file may say less or more of their context."""
    for part in in_parts(impact_ids):
        events = conn.execute(_EVENTS, {"data_set_id": data_set_id, "impact_ids": part}).all()
        kept = [(former_input(data_set_id, digest), impact_id) for impact_id, _, _, digest in events]
        kept += [
            (former_event(data_set_id, whose, when, digest), impact_id) for impact_id, whose, when, digest in events
        ]
        rows = [{"data_set_id": data_set_id, "digest": digest, "impact_id": of} for digest, of in kept]
        if rows:
            conn.execute(insert(former_contents), rows)


def erase_athletes_impacts(conn: Connection, data_set_id: bytes, athlete_id: bytes) -> None:
    """Erase an athlete's impacts, and their revisions of impacts that were corrected to another athlete.

    What jobs say of deliveries under the impacts' external ids is left without these.
    """
    names = frozenset(conn.execute(_NAMES, {"athlete_id": athlete_id}).scalars())
    if names:
        jobs.forget_names(conn, data_set_id, names)
    mine = select(impacts.c.id).where(impacts.c.athlete_id == athlete_id)
    known = conn.execute(mine.where(impacts.c.deleted_at.is_(None))).scalars().all()
    erase_impacts(conn, data_set_id, list(known), external_ids=True)
    # Those deleted one by one before kept their external ids, and what they were known by.
    conn.execute(update(impacts).where(impacts.c.athlete_id == athlete_id).values(external_id=None))
    conn.execute(delete(former_contents).where(former_contents.c.impact_id.in_(mine)))
    moved = conn.execute(_MOVED, {"athlete_id": athlete_id}).all()
    if moved:
        for statement in _REVISION:
            conn.execute(statement, [{"impact": row.impact_id, "number_of_revision": row.revision} for row in moved])
        conn.execute(
            _FORGET_ONE,
            [
                {"impact": row.impact_id, "of_digest": former_content(row.data_set_id, row.content_digest)}
                for row in moved
            ],
        )
