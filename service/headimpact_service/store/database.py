"""The database: its engines, what is set on every connection, how to read, how to write, how to migrate."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from pydantic_core import from_json, to_json
from sqlalchemy import Connection, Engine, NullPool, create_engine, event
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError, DatabaseError, OperationalError, SQLAlchemyError

from headimpact_service.store import migrate
from headimpact_service.store.unavailable import is_out_of_reach, unavailable
from headimpact_service.store.writer import Writer

T = TypeVar("T")

WAL_RESET_FIXED = (3, 51, 3)
"""From here on two connections cannot corrupt a file by resetting its write-ahead log at the same time."""


class DatabaseUrlError(ValueError):
    """The database URL names nothing that the service can keep data in."""


class Database:
    """One database file: a pool of reading connections and one writing thread."""

    def __init__(
        self, url: str, *, busy_timeout_s: float = 5.0, readers: int = 8, queue_capacity: int = 4096, batch: int = 256
    ) -> None:
        """Prepare the engines and the SQLite file's folder; nothing is opened before it is used.

        A writer waits `busy_timeout_s` for another process's lock; `queue_capacity` writes may wait, `batch` of them
        share one commit at most.
        """
        self.url = _checked(url)
        self._busy_timeout_s = busy_timeout_s
        _make_folder(self.url)
        self._reading = self._engine("BEGIN", query_only=True, pool_size=readers, max_overflow=4 * readers)
        self._writing = self._engine("BEGIN IMMEDIATE", query_only=False)
        self._writer = Writer(self._writing, capacity=queue_capacity, batch=batch)

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """A connection that reads one consistent state and cannot write."""
        try:
            with self._reading.connect() as conn:
                yield conn
        except SQLAlchemyError as error:
            if not is_out_of_reach(error):
                raise
            raise unavailable("The database cannot be read now.") from error

    def write(self, run: Callable[[Connection], T]) -> T:
        """Run a function in a write transaction and return its result once that is committed to disk.

        The function may run more than once, so it must do nothing but read and write the database. Not from an event
        loop: it blocks.
        """
        return self._writer.write(run)

    async def write_async(self, run: Callable[[Connection], T]) -> T:
        """The same from an event loop. Cancelling the wait does not undo the write."""
        return await self._writer.write_async(run)

    def migrate(self, revision: str = "head") -> None:
        """Bring the schema to this version; safe when several processes start at once."""
        engine = self._engine("BEGIN IMMEDIATE", query_only=False, foreign_keys=False, poolclass=NullPool)
        try:
            migrate.upgrade(engine, revision)
        except DatabaseError as error:
            if not is_out_of_reach(error):
                raise
            raise unavailable("The database cannot be opened for migration now.") from error
        finally:
            engine.dispose()

    def check(self) -> None:
        """Raise an `unavailable` problem unless the database answers and holds our tables."""
        with self.read() as conn:
            if migrate.current_revision(conn) is None:
                raise unavailable("The database has not been migrated.")

    def warnings(self) -> list[str]:
        """What an operator should know about this database's engine, as sentences; empty if nothing."""
        if self.url.get_backend_name() != "sqlite" or sqlite3.sqlite_version_info >= WAL_RESET_FIXED:
            return []
        fixed = ".".join(map(str, WAL_RESET_FIXED))
        return [
            f"SQLite {sqlite3.sqlite_version} is older than {fixed}: two connections that reset the write-ahead log at "
            "the same moment may corrupt the file. Use the container image or a newer SQLite, and check backups."
        ]

    def checkpoint(self) -> None:
        """Move the write-ahead log into the file and empty it, so that erased content is in neither."""
        if self.url.get_backend_name() == "sqlite":
            with self._writing.connect() as conn:
                _driver(conn).execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()

    @property
    def waiting(self) -> int:
        """About how many writes are queued."""
        return self._writer.waiting

    def close(self) -> None:
        """Finish the queued writes, refuse later ones, close every connection."""
        self._writer.close()
        self._reading.dispose()
        self._writing.dispose()

    def _engine(self, begin: str, *, query_only: bool, foreign_keys: bool = True, **pool: Any) -> Engine:  # noqa: ANN401 - SQLAlchemy's own options
        """An engine whose transactions begin with the given statement."""
        engine = create_engine(self.url, json_serializer=_to_json, json_deserializer=from_json, **pool)
        if self.url.get_backend_name() == "sqlite":
            _set_up_sqlite(engine, begin, _pragmas(self._busy_timeout_s, foreign_keys, query_only))
        return engine


def _checked(url: str) -> URL:
    """The URL, unless it is not one or keeps nothing."""
    try:
        parsed = make_url(url)
    except ArgumentError as error:
        raise DatabaseUrlError(
            "The database URL is not one of SQLAlchemy's form, as in sqlite:///headimpact.db."
        ) from error
    if parsed.get_backend_name() != "sqlite":
        raise DatabaseUrlError("This version keeps its data in SQLite: use a URL like sqlite:///headimpact.db.")
    if not parsed.database or parsed.database == ":memory:" or "mode=memory" in url:
        raise DatabaseUrlError(
            "An SQLite database in memory loses every impact and has one connection only: name a file, as in "
            "sqlite:///headimpact.db."
        )
    return parsed


def _make_folder(url: URL) -> None:
    """Create the folder of an SQLite file."""
    if url.database is not None and not url.database.startswith("file:"):
        Path(url.database).parent.mkdir(parents=True, exist_ok=True)


def _to_json(value: object) -> str:
    """Compact JSON, five times as fast as the standard library's."""
    return to_json(value).decode()


def _driver(conn: Connection) -> sqlite3.Connection:
    driver = conn.connection.dbapi_connection
    if not isinstance(driver, sqlite3.Connection):
        raise TypeError("This connection is not one of SQLite.")
    return driver


def _pragmas(busy_timeout_s: float, foreign_keys: bool, query_only: bool) -> list[str]:
    """What every connection of an engine is set to."""
    return [
        "PRAGMA synchronous = FULL",  # a commit is on disk when it returns: what was acknowledged survives the power
        f"PRAGMA foreign_keys = {'ON' if foreign_keys else 'OFF'}",  # SQLite's default is not to check them
        f"PRAGMA busy_timeout = {round(busy_timeout_s * 1000)}",  # wait for another process, do not fail at once
        "PRAGMA secure_delete = ON",  # an erased athlete's bytes are overwritten, not only unlinked
        "PRAGMA cache_size = -65536",  # 64 MiB: the leaves of the indices stay at hand
        "PRAGMA wal_autocheckpoint = 4000",  # 16 MiB: a page that many commits touch is moved once
        "PRAGMA temp_store = MEMORY",  # sorting writes no file beside a read-only root
        f"PRAGMA query_only = {'ON' if query_only else 'OFF'}",  # a reader cannot write by mistake
    ]


def _set_up_sqlite(engine: Engine, begin: str, pragmas: list[str]) -> None:
    """Begin transactions ourselves: the driver's own way defers the lock until a write, and then fails at once."""

    @event.listens_for(engine, "connect")
    def set_up(driver: sqlite3.Connection, _record: object) -> None:
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
