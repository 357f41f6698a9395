"""What is particular to SQLite: its address, what is set on every connection, how transactions begin."""

from __future__ import annotations

import os
import sqlite3
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, event
from sqlalchemy.engine import URL
from sqlalchemy.exc import OperationalError

from headimpact_service.store import disk
from headimpact_service.store.access import Access, DatabaseUrlError

WAL_RESET_FIXED = (3, 51, 3)
"""From here on two connections cannot corrupt a file by resetting its write-ahead log at the same time."""


def checked(url: URL) -> URL:
    """The URL, unless it keeps nothing."""
    if not url.database or url.database == ":memory:" or "memory" in url.query.get("mode", ""):
        raise DatabaseUrlError(
            "An SQLite database in memory loses every impact and has one connection only: name a file, as in "
            "sqlite:///headimpact.db."
        )
    return url


def prepare(url: URL) -> None:
    """Create the folder of the file, and the file for this user only: its log and its index are made like it."""
    if url.database is not None and not url.database.startswith("file:"):
        file = Path(url.database)
        file.parent.mkdir(parents=True, exist_ok=True)
        with suppress(OSError):  # said where it is opened
            os.close(os.open(file, os.O_RDWR | os.O_CREAT, disk.PRIVATE))


def options(access: Access, busy_timeout_s: float) -> dict[str, Any]:
    """What an engine is made with."""
    del access, busy_timeout_s
    return {}


def set_up(engine: Engine, access: Access, busy_timeout_s: float) -> None:
    """Begin transactions ourselves: the driver's own way defers the lock until a write, and then fails at once."""
    begin = "BEGIN" if access is Access.READ else "BEGIN IMMEDIATE"
    pragmas = _pragmas(access, busy_timeout_s)

    @event.listens_for(engine, "connect")
    def set_up_connection(driver: sqlite3.Connection, _record: object) -> None:
        driver.isolation_level = None
        _switch_to_wal(driver)
        for pragma in pragmas:
            driver.execute(pragma).close()

    @event.listens_for(engine, "begin")
    def start(conn: Connection) -> None:
        try:
            _driver(conn).execute(begin).close()
        except sqlite3.OperationalError as error:
            raise OperationalError(begin, None, error) from error


def warnings(conn: Connection) -> list[str]:
    """What an operator should know about this library, as sentences; empty if nothing."""
    del conn
    if sqlite3.sqlite_version_info >= WAL_RESET_FIXED:
        return []
    fixed = ".".join(map(str, WAL_RESET_FIXED))
    return [
        f"SQLite {sqlite3.sqlite_version} is older than {fixed}: two connections that reset the write-ahead log at "
        "the same moment may corrupt the file. Use the container image or a newer SQLite, and check backups."
    ]


def checkpoint(engine: Engine) -> None:
    """Move the write-ahead log into the file and empty it, so that erased content is in neither."""
    with engine.connect() as conn:
        _driver(conn).execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()


def _driver(conn: Connection) -> sqlite3.Connection:
    driver = conn.connection.dbapi_connection
    if not isinstance(driver, sqlite3.Connection):
        raise TypeError("This connection is not one of SQLite.")
    return driver


def _pragmas(access: Access, busy_timeout_s: float) -> list[str]:
    """What every connection of an engine is set to."""
    return [
        "PRAGMA synchronous = FULL",  # a commit is on disk when it returns: what was acknowledged survives the power
        # SQLite's default is not to check them; during a migration the rebuild of a table would delete its children.
        f"PRAGMA foreign_keys = {'OFF' if access is Access.MIGRATE else 'ON'}",
        f"PRAGMA busy_timeout = {round(busy_timeout_s * 1000)}",  # wait for another process, do not fail at once
        "PRAGMA secure_delete = ON",  # an erased athlete's bytes are overwritten, not only unlinked
        "PRAGMA cache_size = -16384",  # 16 MiB: leaves of the indices stay at hand; traces would fill any size
        "PRAGMA wal_autocheckpoint = 4000",  # 16 MiB: a page that many commits touch is moved once
        "PRAGMA temp_store = MEMORY",  # sorting writes no file beside a read-only root
        f"PRAGMA query_only = {'ON' if access is Access.READ else 'OFF'}",  # a reader cannot write by mistake
    ]


def _switch_to_wal(driver: sqlite3.Connection, attempts: int = 100, pause_s: float = 0.05) -> None:
    """Readers do not block the writer, nor it them. The switch itself heeds no busy timeout, so it is tried again."""
    for attempt in range(attempts):
        try:
            if driver.execute("PRAGMA journal_mode").fetchone()[0] != "wal":
                driver.execute("PRAGMA journal_mode = WAL").close()
        except sqlite3.OperationalError:
            if attempt == attempts - 1:
                raise
            time.sleep(pause_s)
        else:
            return
