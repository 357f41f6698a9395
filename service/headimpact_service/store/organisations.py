"""Organisations and their data sets, one live and one for tests."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal

from sqlalchemy import Connection, bindparam, insert, select

from headimpact_service.errors import PayloadError, Problem
from headimpact_service.store import ids
from headimpact_service.store.tables import api_keys, data_sets, organisations

Mode = Literal["live", "test"]
NAME_LENGTH = 200


@dataclass(frozen=True, slots=True)
class Organisation:
    """Whom keys belong to."""

    id: bytes
    name: str


def is_empty(conn: Connection) -> bool:
    """Whether no key was ever made: the first start."""
    return conn.execute(select(api_keys.c.id).limit(1)).first() is None


_FIND = select(organisations.c.id, organisations.c.name).where(organisations.c.name == bindparam("name"))


def find(conn: Connection, name: str) -> Organisation | None:
    """The organisation of a name."""
    row = conn.execute(_FIND, {"name": clean_name(name, "organisation")}).first()
    return None if row is None else Organisation(*row)


def ensure(conn: Connection, name: str) -> Organisation:
    """The organisation of a name, made if it does not exist."""
    found = find(conn, name)
    if found is not None:
        return found
    made = Organisation(ids.new(), clean_name(name, "organisation"))
    row = {"id": made.id, "name": made.name, "operating_points": [], "settings_revision": 1}
    conn.execute(insert(organisations), row | {"created_at": datetime.now(UTC)})
    return made


def known(conn: Connection, name: str) -> Organisation:
    """The organisation of a name, made only where there is none of any name: a mistyped one is refused.

    Raises
    ------
    ValueError
        There are others.
    """
    found = find(conn, name)
    if found is None and conn.execute(select(organisations.c.id).limit(1)).first() is not None:
        raise ValueError(
            "There is no organisation of that name; `headimpact keys create` makes one with its first key."
        )
    return found or ensure(conn, name)


def ensure_data_set(conn: Connection, organisation_id: bytes, mode: Mode) -> bytes:
    """The data set of an organisation for a mode, made if it does not exist."""
    of_mode = select(data_sets.c.id).where(data_sets.c.organisation_id == organisation_id, data_sets.c.mode == mode)
    found: bytes | None = conn.execute(of_mode).scalar()
    if found is not None:
        return found
    made = ids.new()
    conn.execute(insert(data_sets), {"id": made, "organisation_id": organisation_id, "mode": mode})
    return made


def clean_name(name: str, member: str) -> str:
    """A name without surrounding blanks, 1 to 200 printable characters; else an `invalid-payload` problem."""
    clean = name.strip()
    if 0 < len(clean) <= NAME_LENGTH and clean.isprintable():
        return clean
    detail = f"A name has 1 to {NAME_LENGTH} printable characters."
    raise Problem("invalid-payload", detail, errors=[PayloadError(detail, "name-length", pointer=f"/{member}")])
