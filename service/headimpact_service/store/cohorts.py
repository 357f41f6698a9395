"""Labelled impacts with the values of their criteria: what a fit is made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, Connection, Select, and_, bindparam, func, select

from headimpact_service.store.tables import VALUE_COLUMNS, athletes, devices, impacts, labels, scores


@dataclass(frozen=True, slots=True, kw_only=True)
class CohortFilter:
    """Which impacts; `occurred_from` is inclusive, `occurred_to` is not."""

    occurred_from: datetime | None = None
    occurred_to: datetime | None = None
    sport: str | None = None
    activity: str | None = None
    session_id: str | None = None
    device_serial: str | None = None
    athlete_level: str | None = None
    athlete_sex: str | None = None


@dataclass(frozen=True, slots=True)
class LabelledImpact:
    """An impact that somebody has labelled; `values` are those of its present score in the order of VALUE_COLUMNS."""

    id: bytes
    revision: int
    athlete_id: bytes | None
    consent: str | None
    outcome: str
    event: str | None
    context: Mapping[str, Any] | None
    device: str | None
    occurred_at: datetime | None
    input_digest: bytes | None
    values: tuple[float | None, ...]


_JOINED = (
    impacts.outerjoin(athletes, athletes.c.id == impacts.c.athlete_id)
    .outerjoin(devices, devices.c.id == impacts.c.device_id)
    .outerjoin(scores, and_(scores.c.impact_id == impacts.c.id, scores.c.number == impacts.c.score_number))
)
_LIVE = (impacts.c.data_set_id == bindparam("data_set_id"), impacts.c.deleted_at.is_(None))
_LABELLED = (
    select(
        impacts.c.id,
        impacts.c.revision,
        impacts.c.athlete_id,
        athletes.c.consent,
        labels.c.outcome,
        labels.c.event,
        impacts.c.context,
        func.coalesce(devices.c.model, "") + " " + func.coalesce(devices.c.firmware, ""),
        impacts.c.occurred_at,
        impacts.c.input_digest,
        *(scores.c[name] for name in VALUE_COLUMNS),
    )
    .select_from(
        _JOINED.join(
            labels,
            and_(labels.c.impact_id == impacts.c.id, labels.c.superseded_at.is_(None), labels.c.outcome.is_not(None)),
        )
    )
    .where(*_LIVE)
    .order_by(impacts.c.id)
)
_COUNT = select(func.count()).select_from(_JOINED).where(*_LIVE)
_IDS = select(impacts.c.id, impacts.c.revision).select_from(_JOINED).where(*_LIVE).order_by(impacts.c.id)
_FIRST_VALUE = 10


def labelled(conn: Connection, data_set_id: bytes, wanted: CohortFilter) -> list[LabelledImpact]:
    """The labelled impacts of a cohort, in the order of their ids."""
    rows = conn.execute(_filtered(_LABELLED, wanted), {"data_set_id": data_set_id})
    return [LabelledImpact(*(*row[:_FIRST_VALUE], tuple(row[_FIRST_VALUE:]))) for row in rows]


def count(conn: Connection, data_set_id: bytes, wanted: CohortFilter, *, until: bytes | None = None) -> int:
    """How many impacts a cohort has, labelled or not; with `until` those up to that id."""
    query = _filtered(_COUNT, wanted)
    if until is not None:
        query = query.where(impacts.c.id <= until)
    found: int = conn.execute(query, {"data_set_id": data_set_id}).scalar_one()
    return found


def next_ids(
    conn: Connection, data_set_id: bytes, wanted: CohortFilter, *, after: bytes, until: bytes, limit: int
) -> dict[bytes, int]:
    """The next impacts of a cohort, labelled or not, in the order of their ids, with their revisions."""
    query = _filtered(_IDS, wanted).where(impacts.c.id > after, impacts.c.id <= until).limit(limit)
    return {row.id: row.revision for row in conn.execute(query, {"data_set_id": data_set_id})}


def _filtered(query: Select[Any], wanted: CohortFilter) -> Select[Any]:
    conditions: list[ColumnElement[bool]] = []
    if wanted.occurred_from is not None:
        conditions.append(impacts.c.occurred_at >= wanted.occurred_from)
    if wanted.occurred_to is not None:
        conditions.append(impacts.c.occurred_at < wanted.occurred_to)
    equal = {
        impacts.c.sport: wanted.sport,
        impacts.c.activity: wanted.activity,
        impacts.c.session_id: wanted.session_id,
        devices.c.serial: wanted.device_serial,
        athletes.c.level: wanted.athlete_level,
        athletes.c.sex: wanted.athlete_sex,
    }
    conditions += [column == value for column, value in equal.items() if value is not None]
    return query.where(*conditions)
