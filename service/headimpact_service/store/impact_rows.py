"""Impacts as the store takes them and gives them back, and the one query that reads them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from hashlib import blake2b
from typing import Any, Literal

from sqlalchemy import and_, bindparam, select

from headimpact_service.errors import Problem
from headimpact_service.store import score_rows
from headimpact_service.store.score_rows import NewScore, Score
from headimpact_service.store.tables import athletes, devices, impact_revisions, impacts, labels, scores


@dataclass(frozen=True, slots=True)
class Seen:
    """What a score was made under beside the record, by its revisions; None for what was not known."""

    settings: int | None
    model: str | None
    athlete: int | None
    device: int | None


class ScoreOutdated(Problem):
    """The 503 for an impact whose score was made under what is no longer so: it has to be scored anew."""

    def __init__(self) -> None:
        """Nothing was written."""
        super().__init__(
            "unavailable", "What the score depends on was changed meanwhile.", headers={"Retry-After": "1"}
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class NewImpact:
    """An impact to be stored, with its trace and its score.

    `document` is everything about the record but its samples; `trace` is what `traces.encode` made of those.
    `content_digest` covers all that the client sent, `input_digest` what the score depends on. The athlete is given
    by id, or by an external id that is made on first sight; so is the device by its serial. `seen` is what the score
    was made under where that came from memory: it is held against what is stored.
    """

    content_digest: bytes
    input_digest: bytes
    document: Mapping[str, Any]
    trace: bytes
    score: NewScore
    external_id: str | None = None
    athlete_id: bytes | None = None
    athlete_external_id: str | None = None
    device_serial: str | None = None
    occurred_at: datetime | None = None
    session_id: str | None = None
    activity: str | None = None
    sport: str | None = None
    position: str | None = None
    context: Mapping[str, Any] | None = None
    key_id: bytes | None = None
    seen: Seen | None = None
    mounted_by_device: bool = False
    """Whether the page of its device says where the sensor sits: then `input_digest` covers that, too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Impact:
    """An impact as stored. Of a deleted one only ids, revision and times are left; `document` and `score` are None."""

    id: bytes
    external_id: str | None
    athlete_id: bytes | None
    athlete_external_id: str | None
    device_id: bytes | None
    device_serial: str | None
    occurred_at: datetime | None
    session_id: str | None
    activity: str | None
    sport: str | None
    position: str | None
    context: Mapping[str, Any] | None
    input_digest: bytes | None
    duplicate_of: bytes | None
    revision: int
    created_at: datetime
    updated_at: datetime
    deleted_at: datetime | None
    document: Mapping[str, Any] | None
    score: Score | None
    outcome: str | None = None
    """What the present label says; None where there is none."""
    event: str | None = None
    athlete_consent: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Revision:
    """One kept revision of an impact."""

    revision: int
    athlete_id: bytes | None
    content_digest: bytes
    input_digest: bytes
    document: Mapping[str, Any]
    key_id: bytes | None
    created_at: datetime
    superseded_at: datetime | None


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of an impact that was sent: made or corrected now, or there already with the same content."""

    status: Literal["created", "corrected", "unchanged"]
    impact: Impact


_NAMES = (
    impacts.c.id,
    impacts.c.external_id,
    impacts.c.athlete_id,
    athletes.c.external_id.label("athlete_external_id"),
    impacts.c.device_id,
    devices.c.serial.label("device_serial"),
    impacts.c.occurred_at,
    impacts.c.session_id,
    impacts.c.activity,
    impacts.c.sport,
    impacts.c.position,
    impacts.c.context,
    impacts.c.input_digest,
    impacts.c.duplicate_of,
    impacts.c.revision,
    impacts.c.created_at,
    impacts.c.updated_at,
    impacts.c.deleted_at,
    impact_revisions.c.document,
    labels.c.outcome,
    labels.c.event,
    athletes.c.consent.label("athlete_consent"),
)
OF_REVISION = impacts.c.id == impact_revisions.c.impact_id
"""Joins an impact and its revisions."""
_KEYS = [column.key for column in _NAMES]
_FIRST_SCORE = len(_NAMES)
_STATE = _FIRST_SCORE + [column.name for column in score_rows.COLUMNS].index("state")

IMPACT = (
    select(*_NAMES, *score_rows.COLUMNS)
    .select_from(impacts)
    .outerjoin(athletes, athletes.c.id == impacts.c.athlete_id)
    .outerjoin(devices, devices.c.id == impacts.c.device_id)
    .outerjoin(
        impact_revisions,
        and_(OF_REVISION, impact_revisions.c.revision == impacts.c.revision),
    )
    .outerjoin(labels, and_(labels.c.impact_id == impacts.c.id, labels.c.superseded_at.is_(None)))
    .outerjoin(scores, and_(scores.c.impact_id == impacts.c.id, scores.c.number == impacts.c.score_number))
    .where(impacts.c.data_set_id == bindparam("data_set_id"))
)
"""Every impact of a data set with its present revision and its present score: what :func:`impact_of` reads."""


def impact_of(row: Sequence[Any]) -> Impact:
    """The impact in a row of :data:`IMPACT`."""
    score = None if row[_STATE] is None else score_rows.score_of(row[_FIRST_SCORE:])
    return Impact(**dict(zip(_KEYS, row, strict=False)), score=score)


def external_id_digest(data_set_id: bytes, external_id: str | None) -> bytes | None:
    """What makes an external id unique in its data set, and outlives the erasure of the id itself."""
    if external_id is None:
        return None
    return blake2b(external_id.encode(), key=data_set_id, digest_size=16).digest()


def former_content(data_set_id: bytes, content_digest: bytes) -> bytes:
    """What is kept of a former content: who has the content can tell that it was there, and nobody else."""
    return blake2b(content_digest, key=data_set_id, digest_size=16).digest()


def former_input(data_set_id: bytes, input_digest: bytes) -> bytes:
    """The same of what a deleted impact's score was computed from, whosever it was."""
    return former_content(data_set_id, b"input" + input_digest)


def former_event(
    data_set_id: bytes, athlete_id: bytes | None, occurred_at: datetime | None, input_digest: bytes
) -> bytes:
    """The same of a deleted impact of an athlete and an instant."""
    when = b"" if occurred_at is None else occurred_at.isoformat().encode()
    return former_content(data_set_id, b"event" + (athlete_id or b"").ljust(16, b"\0") + when + input_digest)
