"""Diagnoses of a session whose impact nobody saw: the impact of highest peak angular acceleration is taken for it.

That is the rule of Laksari et al. 2020 for concussions that no single impact was seen to cause.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime

from sqlalchemy import Connection, and_, bindparam, insert, select

from headimpact_service.errors import Problem
from headimpact_service.store import athletes as athlete_store
from headimpact_service.store import ids, labels
from headimpact_service.store.labels import Basis, NewLabel
from headimpact_service.store.tables import diagnoses, impacts, scores
from headimpact_service.store.tables import labels as label_rows


@dataclass(frozen=True, slots=True, kw_only=True)
class NewDiagnosis:
    """A concussion that was diagnosed after a session."""

    session_id: str
    basis: Basis
    diagnosed_at: datetime | None = None
    diagnosed_by: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis(NewDiagnosis):
    """The same as stored, with the impact that it was attributed to."""

    id: bytes
    athlete_id: bytes
    impact_id: bytes
    key_id: bytes | None
    created_at: datetime


_ALPHA = scores.c.resultant_angular_acceleration_rad_s2
_OF_SESSION = (
    select(impacts.c.id, _ALPHA.label("alpha"), label_rows.c.outcome, label_rows.c.attribution, label_rows.c.event)
    .join(scores, and_(scores.c.impact_id == impacts.c.id, scores.c.number == impacts.c.score_number))
    .outerjoin(label_rows, and_(label_rows.c.impact_id == impacts.c.id, label_rows.c.superseded_at.is_(None)))
    .where(
        impacts.c.data_set_id == bindparam("data_set_id"),
        impacts.c.athlete_id == bindparam("athlete_id"),
        impacts.c.session_id == bindparam("session_id"),
        impacts.c.deleted_at.is_(None),
    )
)
_HIGHEST = _OF_SESSION.where(_ALPHA.is_not(None)).order_by(_ALPHA.desc(), impacts.c.id)
_COLUMNS = [column for column in diagnoses.c if column.name != "data_set_id"]
_LIST = (
    select(*_COLUMNS)
    .where(diagnoses.c.data_set_id == bindparam("data_set_id"), diagnoses.c.athlete_id == bindparam("athlete_id"))
    .order_by(diagnoses.c.id)
)


def of_athlete(conn: Connection, data_set_id: bytes, athlete_id: bytes) -> list[Diagnosis]:
    """All diagnoses of an athlete, oldest first."""
    athlete_store.require(conn, data_set_id, athlete_id)
    rows = conn.execute(_LIST, {"data_set_id": data_set_id, "athlete_id": athlete_id})
    return [Diagnosis(**row._asdict()) for row in rows]


def add(
    conn: Connection, data_set_id: bytes, athlete_id: bytes, new: NewDiagnosis, key_id: bytes | None = None
) -> tuple[Diagnosis, bool]:
    """Attribute a diagnosis to an impact of its session and label that; whether the diagnosis is new.

    The same diagnosis again is there already. A `label-conflict` problem where the session has no impact that could be
    it, where one is labelled a concussion already, or where the one that it would be was judged otherwise.
    """
    for known in of_athlete(conn, data_set_id, athlete_id):
        if known.session_id == new.session_id and _said(known) == _said(new):
            return known, False
    session = {"data_set_id": data_set_id, "athlete_id": athlete_id, "session_id": new.session_id}
    rows = conn.execute(_HIGHEST, session).all()
    candidates = [row for row in rows if row.event != "false_positive"]
    if not candidates:
        raise Problem("label-conflict", "The athlete has no impact with rotation in this session.")
    injured = next((row for row in rows if row.outcome == "concussion"), None)
    if injured is not None:
        name = ids.encode("imp", injured.id)
        raise Problem("label-conflict", f"{name} of this session is labelled a concussion already.")
    highest = candidates[0]
    if highest.outcome == "no_concussion":
        name = ids.encode("imp", highest.id)
        raise Problem(
            "label-conflict",
            f"{name}, of the highest peak angular acceleration in this session, is labelled no_concussion: take that "
            "label back, or label the impact that it was.",
        )
    made = Diagnosis(
        **asdict(new),
        id=ids.new(),
        athlete_id=athlete_id,
        impact_id=highest.id,
        key_id=key_id,
        created_at=datetime.now(UTC),
    )
    conn.execute(insert(diagnoses), asdict(made) | {"data_set_id": data_set_id})
    label = NewLabel(
        outcome="concussion",
        basis=new.basis,
        attribution="assumed_highest_alpha",
        event=highest.event,
        labelled_by=new.diagnosed_by,
        diagnosis_id=made.id,
    )
    labels.put(conn, data_set_id, highest.id, label, key_id)
    return made, True


def _said(diagnosis: NewDiagnosis) -> tuple[object, ...]:
    return diagnosis.basis, diagnosis.diagnosed_at, diagnosis.diagnosed_by
