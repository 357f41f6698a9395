"""Writes of one row each, and what is there of them."""

from __future__ import annotations

from collections.abc import Callable

from sqlalchemy import Connection, text

from headimpact_service.store import organisations
from headimpact_service.store.database import Database


def names(database: Database) -> list[str]:
    with database.read() as conn:
        return list(conn.execute(text("SELECT name FROM organisations ORDER BY id")).scalars())


def store(name: str) -> Callable[[Connection], bytes]:
    return lambda conn: organisations.ensure(conn, name).id
