"""Labels: what was said of an impact, by whom and on what basis; each said thing is a row that stays.

A label belongs to the impact, not to its athlete or its revision: it stays with the impact that is corrected, moved to
another athlete, or whose athlete is merged into another. One that a diagnosis of a session put on its strongest impact
is said of the athlete: it does not follow an impact that turns out to be another's, or of another session.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from sqlalchemy import Connection, and_, bindparam, delete, insert, or_, select, update

from headimpact_service.errors import not_found
from headimpact_service.store.clock import next_change
from headimpact_service.store.impact_rows import external_id_digest
from headimpact_service.store.revision import require_revision
from headimpact_service.store.tables import diagnoses, impacts, labels

OutcomeWord = Literal["concussion", "no_concussion", "unknown"]
Basis = Literal[
    "physician_diagnosis",
    "trainer_assessment",
    "follow_up",
    "self_report",
    "video_review",
    "sideline_screening",
    "other",
]
Attribution = Literal["observed", "assumed_highest_alpha"]
Event = Literal["verified", "unverified", "false_positive"]


@dataclass(frozen=True, slots=True, kw_only=True)
class NewLabel:
    """What is said of an impact."""

    outcome: OutcomeWord
    basis: Basis
    attribution: Attribution | None = None
    event: Event | None = None
    labelled_by: str | None = None
    diagnosis_id: bytes | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """The same as stored. `outcome` is None where the label was taken back; `number` counts from 1."""

    impact_id: bytes
    number: int
    outcome: OutcomeWord | None
    basis: Basis | None
    attribution: Attribution | None
    event: Event | None
    labelled_by: str | None
    diagnosis_id: bytes | None
    key_id: bytes | None
    created_at: datetime
    superseded_at: datetime | None


_COLUMNS = [column for column in labels.c if column.name != "data_set_id"]
_HISTORY = (
    select(*_COLUMNS)
    .where(labels.c.data_set_id == bindparam("data_set_id"), labels.c.impact_id == bindparam("impact_id"))
    .order_by(labels.c.number)
)
_LIVE = select(impacts.c.id).where(impacts.c.data_set_id == bindparam("data_set_id"), impacts.c.deleted_at.is_(None))
_LIVE_BY_ID = _LIVE.where(impacts.c.id == bindparam("impact_id"))
_LIVE_BY_NAME = _LIVE.where(impacts.c.external_id_digest == bindparam("digest"))
_OF_ANOTHER = (
    select(labels.c.impact_id)
    .join(diagnoses, diagnoses.c.id == labels.c.diagnosis_id)
    .join(impacts, and_(impacts.c.data_set_id == labels.c.data_set_id, impacts.c.id == labels.c.impact_id))
    .where(
        labels.c.data_set_id == bindparam("data_set_id"),
        labels.c.impact_id == bindparam("impact_id"),
        labels.c.superseded_at.is_(None),
        labels.c.attribution == "assumed_highest_alpha",
        or_(
            impacts.c.athlete_id.is_distinct_from(diagnoses.c.athlete_id),
            impacts.c.session_id.is_distinct_from(diagnoses.c.session_id),
        ),
    )
)
_FORGET_DIAGNOSED = delete(labels).where(
    labels.c.diagnosis_id.in_(
        select(diagnoses.c.id).where(
            diagnoses.c.data_set_id == bindparam("data_set_id"), diagnoses.c.athlete_id == bindparam("athlete_id")
        )
    )
)
_SUPERSEDE = update(labels).where(labels.c.impact_id == bindparam("impact"), labels.c.superseded_at.is_(None))
_TOUCH = update(impacts).where(impacts.c.data_set_id == bindparam("of_data_set"), impacts.c.id == bindparam("impact"))


def history(conn: Connection, data_set_id: bytes, impact_id: bytes) -> list[Label]:
    """All that was said of an impact, oldest first; a `not-found` problem for none of the caller's."""
    _require_impact(conn, data_set_id, impact_id)
    rows = conn.execute(_HISTORY, {"data_set_id": data_set_id, "impact_id": impact_id})
    return [Label(**row._asdict()) for row in rows]


def find_impact(
    conn: Connection, data_set_id: bytes, *, impact_id: bytes | None = None, external_id: str | None = None
) -> bytes | None:
    """The id of an impact that is there, by our id or the sender's."""
    if impact_id is not None:
        found = conn.execute(_LIVE_BY_ID, {"data_set_id": data_set_id, "impact_id": impact_id})
    else:
        digest = external_id_digest(data_set_id, external_id)
        found = conn.execute(_LIVE_BY_NAME, {"data_set_id": data_set_id, "digest": digest})
    known: bytes | None = found.scalar()
    return known


def put(
    conn: Connection,
    data_set_id: bytes,
    impact_id: bytes,
    new: NewLabel,
    key_id: bytes | None = None,
    *,
    if_match: int | None = None,
) -> tuple[Label, bool]:
    """Say something of an impact, and whether it is news; what was said before is kept as history."""
    kept = history(conn, data_set_id, impact_id)
    present = kept[-1] if kept else None
    if present is not None and _says(present) == new:
        return present, False
    require_revision(0 if present is None else present.number, if_match, exists=_is_said(present))
    return _append(conn, data_set_id, impact_id, kept, new, key_id), True


def _is_said(present: Label | None) -> bool:
    """Whether an impact has a label: one that was taken back is none."""
    return present is not None and present.outcome is not None


def withdraw(
    conn: Connection, data_set_id: bytes, impact_id: bytes, key_id: bytes | None = None, *, if_match: int | None = None
) -> None:
    """Take a label back: the impact has none any more, and its history says so."""
    kept = history(conn, data_set_id, impact_id)
    if not _is_said(kept[-1] if kept else None):
        raise not_found("label")
    require_revision(kept[-1].number, if_match)
    _append(conn, data_set_id, impact_id, kept, None, key_id)


def withdraw_of_another(conn: Connection, data_set_id: bytes, impact_id: bytes, key_id: bytes | None = None) -> None:
    """Take the label of a diagnosis back from an impact that is no more of the diagnosed athlete and session."""
    if conn.execute(_OF_ANOTHER, {"data_set_id": data_set_id, "impact_id": impact_id}).first() is not None:
        withdraw(conn, data_set_id, impact_id, key_id)


def forget_diagnosed(conn: Connection, data_set_id: bytes, athlete_id: bytes) -> None:
    """Delete what an athlete's diagnoses said, also of impacts that are another's now."""
    conn.execute(_FORGET_DIAGNOSED, {"data_set_id": data_set_id, "athlete_id": athlete_id})


def _says(label: Label) -> NewLabel | None:
    if label.outcome is None or label.basis is None:
        return None
    return NewLabel(
        outcome=label.outcome,
        basis=label.basis,
        attribution=label.attribution,
        event=label.event,
        labelled_by=label.labelled_by,
        diagnosis_id=label.diagnosis_id,
    )


def _append(
    conn: Connection,
    data_set_id: bytes,
    impact_id: bytes,
    kept: Sequence[Label],
    new: NewLabel | None,
    key_id: bytes | None,
) -> Label:
    now = next_change(conn, impacts, data_set_id)
    conn.execute(_SUPERSEDE, {"impact": impact_id, "superseded_at": now})
    label = Label(
        impact_id=impact_id,
        number=kept[-1].number + 1 if kept else 1,
        outcome=None if new is None else new.outcome,
        basis=None if new is None else new.basis,
        attribution=None if new is None else new.attribution,
        event=None if new is None else new.event,
        labelled_by=None if new is None else new.labelled_by,
        diagnosis_id=None if new is None else new.diagnosis_id,
        key_id=key_id,
        created_at=now,
        superseded_at=None,
    )
    row = {name: getattr(label, name) for name in Label.__dataclass_fields__}
    conn.execute(insert(labels), row | {"data_set_id": data_set_id})
    # Whoever follows the list of impacts by `updated_since` learns of it; the revision is that of the recording.
    conn.execute(_TOUCH, {"of_data_set": data_set_id, "impact": impact_id, "updated_at": now})
    return label


def _require_impact(conn: Connection, data_set_id: bytes, impact_id: bytes) -> None:
    if find_impact(conn, data_set_id, impact_id=impact_id) is None:
        raise not_found("impact")
