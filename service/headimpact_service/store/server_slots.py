"""Which processes work on a PostgreSQL server's database: each holds an advisory lock, which ends with its connection.

The same as the locks of files (`jobs.slots`) where the database is no file.
"""

from __future__ import annotations

from contextlib import suppress
from types import TracebackType

from sqlalchemy import Connection, NullPool, bindparam, create_engine, text
from sqlalchemy.engine import URL
from sqlalchemy.exc import SQLAlchemyError

from headimpact_service.store.slot import SLOTS, SlotLostError, SlotsTakenError, slot_name, slot_number

SPACE = 4711050
"""The first half of the locks' keys; the second is the slot's number."""
_TAKE = text("SELECT pg_try_advisory_lock(:space, :number)").bindparams(bindparam("space", SPACE))
_HOLDERS = text(
    "SELECT objid::integer FROM pg_locks WHERE locktype = 'advisory' AND granted AND objsubid = 2 AND classid = :space "
    "AND database = (SELECT oid FROM pg_database WHERE datname = current_database())"
).bindparams(bindparam("space", SPACE))
# The server notices within half a minute that a host is gone; that a process is gone, at once.
_SETTINGS = ("tcp_keepalives_idle = 10", "tcp_keepalives_interval = 5", "tcp_keepalives_count = 3")


class ServerSlot:
    """A slot that this process holds, on a connection of its own."""

    def __init__(self, url: URL) -> None:
        """Take the first that is free."""
        self._engine = create_engine(
            url,
            poolclass=NullPool,
            isolation_level="AUTOCOMMIT",
            connect_args={"application_name": "headimpact slot", "connect_timeout": 5},
        )
        self._conn = self._connect()
        try:
            self.number = next((number for number in range(SLOTS) if self._take(number)), None)
        except BaseException:
            self._conn.close()
            raise
        if self.number is None:
            self._conn.close()
            raise SlotsTakenError(f"At most {SLOTS} processes may work on one database.")

    def __enter__(self) -> ServerSlot:
        """Itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Let it go."""
        with suppress(SQLAlchemyError):
            self._conn.close()

    @property
    def name(self) -> str:
        """What this process is called in the engine's records."""
        assert self.number is not None
        return slot_name(self.number)

    def keep(self) -> None:
        """Take it again if the connection was lost; a `SlotLostError` if another process was faster."""
        try:
            held = self.number in self._holders()
        except SQLAlchemyError:
            with suppress(SQLAlchemyError):
                self._conn.close()
            self._conn = self._connect()
            held = False
        if not held and not self._take(self.number):
            raise SlotLostError(f"Another process took {self.name} while the database was out of reach.")

    def is_free(self, name: str) -> bool:
        """Whether no living process holds the slot of this name."""
        number = slot_number(name)
        return number is not None and number != self.number and number not in self._holders()

    def is_alone(self) -> bool:
        """Whether no other process works on this database."""
        return self._holders() <= {self.number}

    def _connect(self) -> Connection:
        conn = self._engine.connect()
        for setting in _SETTINGS:
            conn.exec_driver_sql(f"SET {setting}")
        return conn

    def _take(self, number: int | None) -> bool:
        return bool(self._conn.execute(_TAKE, {"number": number}).scalar_one())

    def _holders(self) -> set[int | None]:
        return set(self._conn.execute(_HOLDERS).scalars())
