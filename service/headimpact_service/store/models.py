"""Versions of the risk model that belong to a data set: written once, never changed."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from pydantic_core import from_json, to_json
from sqlalchemy import Connection, bindparam, insert, select

from headimpact_service.errors import Problem
from headimpact_service.store import ids
from headimpact_service.store.tables import models


@dataclass(frozen=True, slots=True, kw_only=True)
class NewModel:
    """A version to be registered.

    `report` is what a fit found out and `page` the same for people; `cohort` says who it was fitted on, a line for
    each impact with its revision and outcome.
    """

    version: str
    document: Mapping[str, Any]
    report: Mapping[str, Any] | None = None
    page: str | None = None
    cohort: str | None = None
    schedule: str | None = None
    job_id: bytes | None = None
    key_id: bytes | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredModel:
    """A version as stored, without its report."""

    version: str
    document: Mapping[str, Any]
    schedule: str | None
    job_id: bytes | None
    key_id: bytes | None
    created_at: datetime


_MODEL = select(
    models.c.version,
    models.c.document,
    models.c.schedule,
    models.c.job_id,
    models.c.key_id,
    models.c.created_at,
).where(models.c.data_set_id == bindparam("data_set_id"))
_ONE = _MODEL.where(models.c.version == bindparam("version"))
_ALL = _MODEL.order_by(models.c.id.desc())
_PART = {
    name: select(models.c[name]).where(
        models.c.data_set_id == bindparam("data_set_id"), models.c.version == bindparam("version")
    )
    for name in ("report", "page", "cohort")
}


def get(conn: Connection, data_set_id: bytes, version: str) -> StoredModel | None:
    """A version of the data set."""
    row = conn.execute(_ONE, {"data_set_id": data_set_id, "version": version}).first()
    return None if row is None else StoredModel(**row._asdict())


def list_all(conn: Connection, data_set_id: bytes) -> list[StoredModel]:
    """Every version of the data set, newest first."""
    return [StoredModel(**row._asdict()) for row in conn.execute(_ALL, {"data_set_id": data_set_id})]


def report(conn: Connection, data_set_id: bytes, version: str) -> Mapping[str, Any] | None:
    """What the fit of a version found out; None of a version that was not fitted here."""
    found = _inflated(conn, data_set_id, version, "report")
    return None if found is None else from_json(found)


def page(conn: Connection, data_set_id: bytes, version: str) -> bytes | None:
    """The same for people, as HTML."""
    return _inflated(conn, data_set_id, version, "page")


def add(conn: Connection, data_set_id: bytes, new: NewModel) -> tuple[StoredModel, bool]:
    """Register a version, and whether it is new; a `conflict` problem if its name is taken by another document."""
    known = get(conn, data_set_id, new.version)
    if known is not None:
        if known.document == new.document:
            return known, False
        raise Problem("conflict", "There is a model of this version, and versions do not change: choose another name.")
    made = StoredModel(
        version=new.version,
        document=new.document,
        schedule=new.schedule,
        job_id=new.job_id,
        key_id=new.key_id,
        created_at=datetime.now(UTC),
    )
    row = {
        "id": ids.new(),
        "data_set_id": data_set_id,
        "version": new.version,
        "document": dict(new.document),
        "report": None if new.report is None else zlib.compress(to_json(new.report)),
        "page": None if new.page is None else zlib.compress(new.page.encode()),
        "cohort": None if new.cohort is None else zlib.compress(new.cohort.encode()),
        "schedule": new.schedule,
        "job_id": new.job_id,
        "key_id": new.key_id,
        "created_at": made.created_at,
    }
    conn.execute(insert(models), row)
    return made, True


def _inflated(conn: Connection, data_set_id: bytes, version: str, part: str) -> bytes | None:
    found: bytes | None = conn.execute(_PART[part], {"data_set_id": data_set_id, "version": version}).scalar()
    return None if found is None else zlib.decompress(found)
