"""The scores of an impact: the one that stands for it, those of other models, those of revisions before."""

from __future__ import annotations

from sqlalchemy import Connection, bindparam, func, insert, select, update

from headimpact_service.errors import not_found
from headimpact_service.store.clock import next_change
from headimpact_service.store.score_rows import COLUMNS, NewScore, Score, row_of, score_of, stored
from headimpact_service.store.tables import impacts, scores

__all__ = ["NewScore", "Score", "add", "list_all", "next_number"]

_PRESENT = select(impacts.c.revision, impacts.c.score_number).where(
    impacts.c.data_set_id == bindparam("data_set_id"),
    impacts.c.id == bindparam("impact_id"),
    impacts.c.deleted_at.is_(None),
)
_ALL = (
    select(*COLUMNS)
    .join(impacts, impacts.c.id == scores.c.impact_id)
    .where(impacts.c.data_set_id == bindparam("data_set_id"), impacts.c.id == bindparam("impact_id"))
    .order_by(scores.c.number)
)
_LAST_NUMBER = select(func.max(scores.c.number)).where(scores.c.impact_id == bindparam("impact_id"))


def list_all(conn: Connection, data_set_id: bytes, impact_id: bytes) -> list[Score]:
    """Every score of an impact in the order of their making, those of revisions before too."""
    return [score_of(row) for row in conn.execute(_ALL, {"data_set_id": data_set_id, "impact_id": impact_id})]


def add(
    conn: Connection, data_set_id: bytes, impact_id: bytes, new: NewScore, *, make_current: bool = False
) -> tuple[Score, bool]:
    """Another score of an impact's present revision, and whether it was stored now.

    One that is there already in every digit is given back. The score that stands for the impact stays the same unless
    `make_current` says otherwise; a `not-found` problem for an impact that is none of the data set's.
    """
    present = conn.execute(_PRESENT, {"data_set_id": data_set_id, "impact_id": impact_id}).first()
    if present is None:
        raise not_found("impact")
    score, made = _find_or_insert(conn, data_set_id, impact_id, new, present.revision)
    if make_current and score.number != present.score_number:
        now = next_change(conn, impacts, data_set_id)
        values = {"score_number": score.number, "updated_at": now}
        conn.execute(update(impacts).where(impacts.c.data_set_id == data_set_id, impacts.c.id == impact_id), values)
    return score, made


def _find_or_insert(
    conn: Connection, data_set_id: bytes, impact_id: bytes, new: NewScore, revision: int
) -> tuple[Score, bool]:
    """The same score if there is one, else a new row."""
    for kept in list_all(conn, data_set_id, impact_id):
        if kept == stored(new, impact_id, kept.number, revision, kept.created_at):
            return kept, False
    number = next_number(conn, impact_id)
    now = next_change(conn, impacts, data_set_id)
    conn.execute(insert(scores), row_of(new, impact_id, number, revision, now))
    return stored(new, impact_id, number, revision, now), True


def next_number(conn: Connection, impact_id: bytes) -> int:
    """The number that the next score of an impact gets."""
    last: int | None = conn.execute(_LAST_NUMBER, {"impact_id": impact_id}).scalar()
    return (last or 0) + 1
