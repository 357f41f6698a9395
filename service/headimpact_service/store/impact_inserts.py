"""The rows of new impacts and new revisions, and how they are written: three tables, many impacts at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, insert

from headimpact_service.store import ids
from headimpact_service.store.impact_rows import NewImpact, external_id_digest
from headimpact_service.store.prepared import Prepared
from headimpact_service.store.score_rows import row_of
from headimpact_service.store.tables import impact_revisions, impacts, scores

Row = dict[str, Any]
Rows = Sequence[tuple[NewImpact, Row]]
"""New contents, each with the columns of its impact."""

_INSERT_IMPACT = Prepared(insert(impacts), [column.name for column in impacts.c])
_INSERT_REVISION = Prepared(insert(impact_revisions), [column.name for column in impact_revisions.c])
_INSERT_SCORE = Prepared(insert(scores), [column.name for column in scores.c])


def first_row(
    data_set_id: bytes, new: NewImpact, athlete_id: bytes | None, device_id: bytes | None, now: datetime
) -> Row:
    """The columns of an impact that was never there, of content that was never there."""
    return content_members(new, athlete_id, device_id) | {
        "data_set_id": data_set_id,
        "id": ids.new(),
        "external_id": new.external_id,
        "external_id_digest": external_id_digest(data_set_id, new.external_id),
        "duplicate_of": None,
        "revision": 1,
        "score_number": 1,
        "created_at": now,
        "updated_at": now,
        "deleted_at": None,
    }


def content_members(new: NewImpact, athlete_id: bytes | None, device_id: bytes | None) -> Row:
    """The columns that a correction replaces."""
    return {
        "athlete_id": athlete_id,
        "device_id": device_id,
        "occurred_at": new.occurred_at,
        "session_id": new.session_id,
        "activity": new.activity,
        "sport": new.sport,
        "position": new.position,
        "context": new.context,
        "input_digest": new.input_digest,
    }


def insert_rows(conn: Connection, rows: Rows) -> None:
    """New impacts with their first revisions."""
    _INSERT_IMPACT.run_many(conn, [row for _, row in rows])
    insert_revisions(conn, rows)


def insert_revisions(conn: Connection, rows: Rows) -> None:
    """The revisions that the impacts' rows name, with their traces and scores, made when the impacts changed."""
    _INSERT_REVISION.run_many(conn, [_revision(new, row) for new, row in rows])
    _INSERT_SCORE.run_many(
        conn,
        [row_of(new.score, row["id"], row["score_number"], row["revision"], row["updated_at"]) for new, row in rows],
    )


def _revision(new: NewImpact, row: Mapping[str, Any]) -> Row:
    return {
        "impact_id": row["id"],
        "revision": row["revision"],
        "data_set_id": row["data_set_id"],
        "athlete_id": row["athlete_id"],
        "content_digest": new.content_digest,
        "input_digest": new.input_digest,
        "document": new.document,
        "key_id": new.key_id,
        "created_at": row["updated_at"],
        "superseded_at": None,
        "trace": new.trace,
    }
