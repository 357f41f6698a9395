"""Diagnoses of a session whose impact nobody saw: the impact of highest peak angular acceleration is taken for it.

That is the rule of Laksari et al. 2020 for concussions that no single impact was seen to cause.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from typing import Any, NamedTuple

from sqlalchemy import Connection, and_, bindparam, insert, select, update

from headimpact.eligibility import exclusion_reason
from headimpact_service.errors import Problem
from headimpact_service.store import athletes as athlete_store
from headimpact_service.store import ids, labels
from headimpact_service.store.labels import Basis, Event, NewLabel
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


class _Candidate(NamedTuple):
    """An impact of the session, its peak angular acceleration, and what its label says."""

    id: bytes
    context: Mapping[str, Any] | None
    state: str
    alpha: float | None
    outcome: str | None
    event: Event | None
    diagnosis_id: bytes | None


_ALPHA = scores.c.resultant_angular_acceleration_rad_s2
_OF_SESSION = (
    select(
        impacts.c.id,
        impacts.c.context,
        scores.c.state,
        _ALPHA.label("alpha"),
        label_rows.c.outcome,
        label_rows.c.event,
        label_rows.c.diagnosis_id,
    )
    .join(scores, and_(scores.c.impact_id == impacts.c.id, scores.c.number == impacts.c.score_number))
    .outerjoin(label_rows, and_(label_rows.c.impact_id == impacts.c.id, label_rows.c.superseded_at.is_(None)))
    .where(
        impacts.c.data_set_id == bindparam("data_set_id"),
        impacts.c.athlete_id == bindparam("athlete_id"),
        impacts.c.session_id == bindparam("session_id"),
        impacts.c.deleted_at.is_(None),
    )
    .order_by(_ALPHA.desc(), impacts.c.id)
)
_COLUMNS = [column for column in diagnoses.c if column.name != "data_set_id"]
_LIST = (
    select(*_COLUMNS)
    .where(diagnoses.c.data_set_id == bindparam("data_set_id"), diagnoses.c.athlete_id == bindparam("athlete_id"))
    .order_by(diagnoses.c.id)
)
_REATTRIBUTE = update(diagnoses).where(diagnoses.c.id == bindparam("diagnosis"))


def of_athlete(conn: Connection, data_set_id: bytes, athlete_id: bytes) -> list[Diagnosis]:
    """All diagnoses of an athlete, oldest first."""
    athlete_store.require(conn, data_set_id, athlete_id)
    rows = conn.execute(_LIST, {"data_set_id": data_set_id, "athlete_id": athlete_id})
    return [Diagnosis(**row._asdict()) for row in rows]


def add(
    conn: Connection, data_set_id: bytes, athlete_id: bytes, new: NewDiagnosis, key_id: bytes | None = None
) -> tuple[Diagnosis, bool]:
    """Attribute a diagnosis to an impact of its session and label that; whether an impact was labelled now.

    The same diagnosis again is the one that is there. It is attributed anew if none of the session's impacts carries
    its label any more, or if another is the strongest now. A `label-conflict` problem where the session has no impact
    that could be it, where one is labelled a concussion already, or where the one that it would be was judged
    otherwise.
    """
    known = _known(conn, data_set_id, athlete_id, new)
    session = {"data_set_id": data_set_id, "athlete_id": athlete_id, "session_id": new.session_id}
    rows = [_Candidate(*row) for row in conn.execute(_OF_SESSION, session)]
    carriers = {row.id: one for row in rows for one in known if _carries(row, one)}
    found = _attributable(rows, carriers)
    kept = next(iter(carriers), None) if isinstance(found, Problem) else found.id
    for carrier in carriers.keys() - {kept}:
        labels.withdraw(conn, data_set_id, carrier, key_id)
    if kept in carriers:
        return carriers[kept], False
    if isinstance(found, Problem):
        raise found
    if known:
        conn.execute(_REATTRIBUTE, {"diagnosis": known[0].id, "impact_id": found.id})
        made = replace(known[0], impact_id=found.id)
    else:
        made = _insert(conn, data_set_id, athlete_id, new, found.id, key_id)
    label = NewLabel(
        outcome="concussion",
        basis=new.basis,
        attribution="assumed_highest_alpha",
        event=found.event,
        labelled_by=new.diagnosed_by,
        diagnosis_id=made.id,
    )
    labels.put(conn, data_set_id, found.id, label, key_id)
    return made, True


def join(conn: Connection, data_set_id: bytes, athlete_id: bytes, key_id: bytes | None = None) -> None:
    """Attribute to one impact what was reported of an athlete under two registrations: one concussion, not two."""
    counted = Counter(
        NewDiagnosis(
            session_id=one.session_id, basis=one.basis, diagnosed_at=one.diagnosed_at, diagnosed_by=one.diagnosed_by
        )
        for one in of_athlete(conn, data_set_id, athlete_id)
    )
    for said, times in counted.items():
        if times > 1:
            with suppress(Problem):  # none of the session's impacts carries it
                add(conn, data_set_id, athlete_id, said, key_id)
    for session_id in {said.session_id for said in counted}:
        session = {"data_set_id": data_set_id, "athlete_id": athlete_id, "session_id": session_id}
        rows = [_Candidate(*row) for row in conn.execute(_OF_SESSION, session)]
        diagnosed = [row.id for row in rows if row.outcome == "concussion" and row.diagnosis_id is not None]
        for weaker in diagnosed[1:]:  # a session has one that nobody saw, whoever diagnosed it
            labels.withdraw(conn, data_set_id, weaker, key_id)


def _known(conn: Connection, data_set_id: bytes, athlete_id: bytes, new: NewDiagnosis) -> list[Diagnosis]:
    """The diagnoses that say the same of the same session: one, or those of athletes who turned out to be one."""
    return [
        known
        for known in of_athlete(conn, data_set_id, athlete_id)
        if known.session_id == new.session_id and _said(known) == _said(new)
    ]


def _carries(row: _Candidate, known: Diagnosis) -> bool:
    return row.diagnosis_id == known.id and row.outcome == "concussion"


def _attributable(rows: Sequence[_Candidate], carriers: Container[bytes]) -> _Candidate | Problem:
    """The impact of a session that a diagnosis is attributed to, or why there is none.

    `carriers` carry the diagnosis' label already: one, or more where athletes turned out to be one.
    """
    injured = next((row for row in rows if row.outcome == "concussion" and row.id not in carriers), None)
    if injured is not None:
        name = ids.encode("imp", injured.id)
        return Problem("label-conflict", f"{name} of this session is labelled a concussion already.")
    highest = next((row for row in rows if _may_be_it(row)), None)
    if highest is None:
        return Problem(
            "label-conflict", "The athlete has no impact with rotation in this session that may enter a cohort."
        )
    if highest.outcome == "no_concussion":
        name = ids.encode("imp", highest.id)
        return Problem(
            "label-conflict",
            f"{name}, of the highest peak angular acceleration in this session, is labelled no_concussion: take that "
            "label back, or label the impact that it was.",
        )
    return highest


def _may_be_it(row: _Candidate) -> bool:
    """Whether an impact was one of a head, and has what is compared.

    An unverified event may be it: a diagnosis is reported where nobody saw the impact.
    """
    reason = exclusion_reason(
        1.0, event=row.event or "", worn=(row.context or {}).get("worn"), include=frozenset({"unverified"})
    )
    return reason is None and row.state == "scored" and row.alpha is not None


def _insert(
    conn: Connection, data_set_id: bytes, athlete_id: bytes, new: NewDiagnosis, impact_id: bytes, key_id: bytes | None
) -> Diagnosis:
    made = Diagnosis(
        **asdict(new),
        id=ids.new(),
        athlete_id=athlete_id,
        impact_id=impact_id,
        key_id=key_id,
        created_at=datetime.now(UTC),
    )
    conn.execute(insert(diagnoses), asdict(made) | {"data_set_id": data_set_id})
    return made


def _said(diagnosis: NewDiagnosis) -> tuple[object, ...]:
    return diagnosis.basis, diagnosis.diagnosed_at, diagnosis.diagnosed_by
