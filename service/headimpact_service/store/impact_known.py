"""What is stored already that a new impact touches: one query for all of it."""

from __future__ import annotations

from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import BindParameter, Connection, bindparam, func, null, select

from headimpact_service.errors import PayloadError, Problem
from headimpact_service.store.clock import last_change
from headimpact_service.store.impact_rows import NewImpact, Seen, external_id_digest
from headimpact_service.store.prepared import Prepared
from headimpact_service.store.tables import athletes, data_sets, devices, impacts, model_aliases, organisations

_DATA_SET: BindParameter[bytes] = bindparam("data_set_id")


class Known(NamedTuple):
    """The rows that there are, and what a score has to be made under."""

    last_change: datetime | None
    athlete_by_name: bytes | None
    merged_into: bytes | None
    athlete_by_id: bytes | None
    athlete_external_id: str | None
    device: bytes | None
    same_external_id: bytes | None
    same_content: bytes | None
    settings_revision: int | None
    model: str | None
    athlete_revision: int | None
    device_revision: int | None

    @property
    def seen(self) -> Seen:
        """What a score has to be made under."""
        return Seen(self.settings_revision, self.model, self.athlete_revision, self.device_revision)

    @property
    def athlete(self) -> bytes | None:
        """Whose the impact is, if that athlete is known: of one that was merged, into whom."""
        return self.athlete_by_id or self.merged_into or self.athlete_by_name


_SENT = athletes.alias("sent")
_ATHLETE_BY_ID = (
    athletes.c.id
    == func.coalesce(
        select(_SENT.c.merged_into)
        .where(_SENT.c.data_set_id == _DATA_SET, _SENT.c.id == bindparam("athlete_id"))
        .scalar_subquery(),
        bindparam("athlete_id", type_=athletes.c.id.type),
    ),
    athletes.c.data_set_id == _DATA_SET,
    athletes.c.deleted_at.is_(None),
)
_ATHLETE_BY_NAME = (
    athletes.c.data_set_id == _DATA_SET,
    athletes.c.external_id == bindparam("athlete_external_id"),
)
_TARGET = athletes.alias("target")
_MERGED_INTO = select(athletes.c.merged_into).where(*_ATHLETE_BY_NAME).scalar_subquery()
_DEVICE = (devices.c.data_set_id == _DATA_SET, devices.c.serial == bindparam("serial"))
_REVISION_BY_NAME = (
    select(_TARGET.c.revision)
    .where(_TARGET.c.data_set_id == _DATA_SET, _TARGET.c.id == _MERGED_INTO)
    .scalar_subquery(),
    select(athletes.c.revision).where(*_ATHLETE_BY_NAME).scalar_subquery(),
)


def _of_athlete(*, by_id: bool) -> tuple[Any, ...]:
    """Who the athlete of an id is; nobody where an impact names its athlete otherwise."""
    if not by_id:
        return null(), null(), func.coalesce(*_REVISION_BY_NAME)
    found, name, revision = (
        select(column).where(*_ATHLETE_BY_ID).scalar_subquery()
        for column in (athletes.c.id, athletes.c.external_id, athletes.c.revision)
    )
    return found, name, func.coalesce(revision, *_REVISION_BY_NAME)


def _known(*, by_id: bool) -> Prepared:
    """The query, for an impact that gives its athlete by our id or otherwise."""
    athlete_by_id, athlete_external_id, athlete_revision = _of_athlete(by_id=by_id)
    return Prepared(
        select(
            last_change(impacts),
            select(athletes.c.id).where(*_ATHLETE_BY_NAME).scalar_subquery(),
            _MERGED_INTO,
            athlete_by_id,
            athlete_external_id,
            select(devices.c.id).where(*_DEVICE).scalar_subquery(),
            select(impacts.c.id)
            .where(impacts.c.data_set_id == _DATA_SET, impacts.c.external_id_digest == bindparam("external_id_digest"))
            .scalar_subquery(),
            select(impacts.c.id)
            .where(impacts.c.data_set_id == _DATA_SET, impacts.c.input_digest == bindparam("input_digest"))
            .order_by(impacts.c.id)
            .limit(1)
            .scalar_subquery(),
            select(organisations.c.settings_revision)
            .join(data_sets, data_sets.c.organisation_id == organisations.c.id)
            .where(data_sets.c.id == _DATA_SET)
            .scalar_subquery(),
            select(model_aliases.c.version)
            .where(
                model_aliases.c.data_set_id == _DATA_SET,
                model_aliases.c.name == "active",
                model_aliases.c.superseded_at.is_(None),
            )
            .scalar_subquery(),
            athlete_revision,
            select(devices.c.revision).where(*_DEVICE).scalar_subquery(),
        )
    )


_KNOWN_BY_NAME, _KNOWN_BY_ID = _known(by_id=False), _known(by_id=True)


def look_up(conn: Connection, data_set_id: bytes, new: NewImpact) -> Known:
    """What a new impact touches; a `not-found` problem for an athlete's id that is none of the data set's."""
    parameters = {
        "data_set_id": data_set_id,
        "athlete_external_id": new.athlete_external_id,
        "serial": new.device_serial,
        "external_id_digest": external_id_digest(data_set_id, new.external_id),
        "input_digest": new.input_digest,
    }
    if new.athlete_id is None:
        return Known(*(_KNOWN_BY_NAME.first(conn, parameters) or ()))
    known = Known(*(_KNOWN_BY_ID.first(conn, parameters | {"athlete_id": new.athlete_id}) or ()))
    if known.athlete_by_id is None:
        detail = "There is no athlete with this id."
        raise Problem("not-found", detail, errors=[PayloadError(detail, "unknown-athlete", pointer="/athlete/id")])
    return known
