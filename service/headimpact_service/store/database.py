"""The database: its engines, reading, writing, migrating; what differs is in `sqlite` and `postgresql`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from pydantic_core import from_json, to_json
from sqlalchemy import Connection, Engine, NullPool, create_engine
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, SQLAlchemyError

from headimpact_service.store import disk, migrate, postgresql, sqlite
from headimpact_service.store.access import Access, DatabaseUrlError
from headimpact_service.store.gathered import STANDSTILL_S, Gathered
from headimpact_service.store.unavailable import is_out_of_reach, unavailable
from headimpact_service.store.writer import Writer

T = TypeVar("T")

_BACKENDS: Mapping[str, ModuleType] = {"sqlite": sqlite, "postgresql": postgresql, "postgres": postgresql}


class Database:
    """One database: a pool of reading connections and one writing thread."""

    def __init__(
        self, url: str, *, busy_timeout_s: float = 5.0, readers: int = 8, queue_capacity: int = 4096, batch: int = 256
    ) -> None:
        """Prepare the engines, and an SQLite file's folder; nothing is opened before it is used.

        A writer waits `busy_timeout_s` for another process's lock; `queue_capacity` writes may wait, `batch` of them
        share one commit at most.
        """
        self.url = _checked(url)
        self._backend = _BACKENDS[self.url.get_backend_name()]
        self._busy_timeout_s = busy_timeout_s
        self._backend.prepare(self.url)
        self._reading = self._engine(Access.READ, pool_size=readers, max_overflow=4 * readers)
        self._writing = self._engine(Access.WRITE)
        self._writer = Writer(self._writing, capacity=queue_capacity, batch=batch)
        self._gathered = Gathered(self._writer, standstill_s=STANDSTILL_S if self.is_file else 0.0)

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

    async def write_short(self, run: Callable[[Connection], T]) -> T:
        """The same for a function that writes a few rows: those of one turn of the loop share a commit."""
        return await self._gathered.write(run)

    def migrate(self, revision: str = "head") -> None:
        """Bring the schema to this version; safe when several processes start at once."""
        engine = self._engine(Access.MIGRATE, poolclass=NullPool)
        try:
            migrate.upgrade(engine, revision)
        except DBAPIError as error:
            if not is_out_of_reach(error):
                raise
            reason = str(error.orig).strip().partition("\n")[0]
            raise unavailable(f"The database cannot be opened for migration now: {reason}.") from error
        finally:
            engine.dispose()

    def check(self) -> None:
        """Raise an `unavailable` problem unless the database answers and holds our tables."""
        with self.read() as conn:
            if migrate.current_revision(conn) is None:
                raise unavailable("The database has not been migrated.")

    def warnings(self) -> list[str]:
        """What an operator should know about this database's engine, as sentences; empty if nothing."""
        with self.read() as conn:
            found: list[str] = self._backend.warnings(conn)
        if self.is_file and self.url.database:
            file = Path(self.url.database).resolve()
            found += [*disk.warnings(file.parent, "the database"), *disk.exposed(file, "the database")]
        return found

    def checkpoint(self) -> None:
        """Leave no erased content in a log, where the engine can."""
        self._backend.checkpoint(self._writing)

    @property
    def is_file(self) -> bool:
        """Whether it is a file, which only processes of this host reach."""
        return self._backend is sqlite

    @property
    def waiting(self) -> int:
        """About how many writes are queued."""
        return self._writer.waiting

    def close(self) -> None:
        """Finish the queued writes, refuse later ones, close every connection."""
        self._writer.close()
        self._reading.dispose()
        self._writing.dispose()

    def _engine(self, access: Access, **pool: Any) -> Engine:  # noqa: ANN401 - SQLAlchemy's own options
        """An engine whose connections are for this."""
        options = self._backend.options(access, self._busy_timeout_s) | pool
        engine = create_engine(self.url, json_serializer=_to_json, json_deserializer=from_json, **options)
        self._backend.set_up(engine, access, self._busy_timeout_s)
        return engine


def _checked(url: str) -> URL:
    """The URL, unless it is not one or keeps nothing."""
    try:
        parsed = make_url(url)
    except ArgumentError as error:
        raise DatabaseUrlError(
            "The database URL is not one of SQLAlchemy's form, as in sqlite:///headimpact.db."
        ) from error
    backend = _BACKENDS.get(parsed.get_backend_name())
    if backend is None:
        raise DatabaseUrlError(
            "Data are kept in SQLite or PostgreSQL: use a URL like sqlite:///headimpact.db or "
            "postgresql://user@host/headimpact."
        )
    checked: URL = backend.checked(parsed)
    return checked


def _to_json(value: object) -> str:
    """Compact JSON, five times as fast as the standard library's."""
    return to_json(value).decode()
