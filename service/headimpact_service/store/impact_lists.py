"""Reading impacts: one, a page of them, their revisions, their traces, those of the same content."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import BindParameter, ColumnElement, Connection, Select, bindparam, or_, select

from headimpact_service.store.impact_rows import IMPACT, OF_REVISION, Impact, Revision, external_id_digest, impact_of
from headimpact_service.store.paging import Page, Position, keyset, page_of
from headimpact_service.store.prepared import Prepared
from headimpact_service.store.tables import devices, impact_revisions, impacts, scores

DUPLICATE = "duplicate_content"
"""The note of an impact whose signals came before: what it says is `duplicate_of`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactFilters:
    """Which impacts a list holds; `occurred_from` is inclusive, `occurred_to` is not.

    `min_probability` is a criterion's key and the probability that its present score reaches.
    """

    athlete_id: bytes | None = None
    external_id: str | None = None
    device_serial: str | None = None
    session_id: str | None = None
    occurred_from: datetime | None = None
    occurred_to: datetime | None = None
    quality_code: str | None = None
    min_probability: tuple[str, float] | None = None


@dataclass(frozen=True, slots=True)
class Trace:
    """The samples of one revision, as `traces.encode` made them."""

    revision: int
    signals: bytes


_DATA_SET: BindParameter[bytes] = bindparam("data_set_id")
_BY_ID = Prepared(IMPACT.where(impacts.c.id == bindparam("impact_id")))
_REVISIONS = (
    select(
        impact_revisions.c.revision,
        impact_revisions.c.athlete_id,
        impact_revisions.c.content_digest,
        impact_revisions.c.input_digest,
        impact_revisions.c.document,
        impact_revisions.c.key_id,
        impact_revisions.c.created_at,
        impact_revisions.c.superseded_at,
    )
    .join(impacts, OF_REVISION)
    .where(impacts.c.data_set_id == _DATA_SET, impacts.c.id == bindparam("impact_id"))
    .order_by(impact_revisions.c.revision)
)
_TRACE = (
    select(impact_revisions.c.revision, impact_revisions.c.trace)
    .join(impacts, OF_REVISION)
    .where(impacts.c.data_set_id == _DATA_SET, impacts.c.id == bindparam("impact_id"))
)
_PRESENT_TRACE = _TRACE.where(impact_revisions.c.revision == impacts.c.revision)
_KEPT_TRACE = _TRACE.where(impact_revisions.c.revision == bindparam("revision"))
_TRACED = (
    select(impacts.c.id, impact_revisions.c.document, impact_revisions.c.trace)
    .join(impacts, OF_REVISION)
    .where(impacts.c.data_set_id == _DATA_SET, impact_revisions.c.revision == impacts.c.revision)
    .where(impacts.c.id.in_(bindparam("impact_ids", expanding=True)))
)
_SAME_CONTENT = (
    select(impacts.c.id)
    .where(impacts.c.data_set_id == _DATA_SET, impacts.c.input_digest == bindparam("input_digest"))
    .where(impacts.c.id != bindparam("exclude"))
    .order_by(impacts.c.id)
    .limit(1)
)


def get(conn: Connection, data_set_id: bytes, impact_id: bytes) -> Impact | None:
    """An impact that was not deleted, with its present score."""
    found = get_any(conn, data_set_id, impact_id)
    return found if found is not None and found.deleted_at is None else None


def get_any(conn: Connection, data_set_id: bytes, impact_id: bytes) -> Impact | None:
    """An impact or its tombstone."""
    row = _BY_ID.first(conn, {"data_set_id": data_set_id, "impact_id": impact_id})
    return None if row is None else impact_of(row)


def page(
    conn: Connection,
    data_set_id: bytes,
    filters: ImpactFilters | None = None,
    *,
    updated_since: datetime | None = None,
    limit: int = 100,
    after: Position | None = None,
) -> Page[Impact]:
    """A page of the list: newest first, or by change with tombstones if `updated_since` is given.

    A tombstone has kept its athlete and external id only; whatever else is filtered for, it is listed, since a client
    that holds the impact must learn of it.
    """
    query = _filtered(IMPACT, data_set_id, filters or ImpactFilters())
    query = keyset(query, impacts, updated_since=updated_since, after=after, limit=limit)
    rows = conn.execute(query, {"data_set_id": data_set_id})
    return page_of([impact_of(row) for row in rows], limit)


def _filtered(query: Select[Any], data_set_id: bytes, filters: ImpactFilters) -> Select[Any]:
    if filters.athlete_id is not None:
        query = query.where(impacts.c.athlete_id == filters.athlete_id)
    if filters.external_id is not None:
        query = query.where(impacts.c.external_id_digest == external_id_digest(data_set_id, filters.external_id))
    for condition in _conditions(filters):
        query = query.where(or_(condition, impacts.c.deleted_at.is_not(None)))
    return query


def _conditions(filters: ImpactFilters) -> list[ColumnElement[bool]]:
    """The filters on what a tombstone has not kept."""
    conditions: list[ColumnElement[bool]] = []
    if filters.device_serial is not None:
        conditions.append(devices.c.serial == filters.device_serial)
    if filters.session_id is not None:
        conditions.append(impacts.c.session_id == filters.session_id)
    if filters.occurred_from is not None:
        conditions.append(impacts.c.occurred_at >= filters.occurred_from)
    if filters.occurred_to is not None:
        conditions.append(impacts.c.occurred_at < filters.occurred_to)
    if filters.quality_code is not None:
        conditions.append(_noted(filters.quality_code))
    if filters.min_probability is not None:
        criterion, least = filters.min_probability
        conditions.append(scores.c[f"{criterion}_probability"] >= least)
    return conditions


def _noted(code: str) -> ColumnElement[bool]:
    """Whether a note is one of the present score's; that of a duplicate is the impact's own."""
    if code == DUPLICATE:
        return impacts.c.duplicate_of.is_not(None)
    return scores.c.quality_codes.contains(f" {code} ", autoescape=True)


def revisions(conn: Connection, data_set_id: bytes, impact_id: bytes) -> list[Revision]:
    """The kept revisions of an impact, oldest first; none of a deleted one."""
    rows = conn.execute(_REVISIONS, {"data_set_id": data_set_id, "impact_id": impact_id})
    return [Revision(**row._asdict()) for row in rows]


def trace(conn: Connection, data_set_id: bytes, impact_id: bytes, revision: int | None = None) -> Trace | None:
    """The samples of an impact as they came, of its present revision or a kept one."""
    query = _PRESENT_TRACE if revision is None else _KEPT_TRACE
    parameters = {"data_set_id": data_set_id, "impact_id": impact_id}
    row = conn.execute(query, parameters | ({} if revision is None else {"revision": revision})).first()
    return None if row is None else Trace(*row)


def traced(conn: Connection, data_set_id: bytes, impact_ids: Sequence[bytes]) -> dict[bytes, tuple[Any, bytes]]:
    """The present document and samples of impacts, by id; none of a deleted one."""
    rows = conn.execute(_TRACED, {"data_set_id": data_set_id, "impact_ids": list(impact_ids)})
    return {impact_id: (document, trace) for impact_id, document, trace in rows}


def find_same_content(conn: Connection, data_set_id: bytes, input_digest: bytes, exclude: bytes = b"") -> bytes | None:
    """The id of the earliest impact with the same input, other than `exclude`."""
    parameters = {"data_set_id": data_set_id, "input_digest": input_digest, "exclude": exclude}
    found: bytes | None = conn.execute(_SAME_CONTENT, parameters).scalar()
    return found
