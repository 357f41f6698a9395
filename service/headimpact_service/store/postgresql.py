"""What is particular to PostgreSQL: its address, what is set on every connection, how transactions begin.

Writers exclude each other, in every process, by an advisory lock that each write transaction takes first. That is what
SQLite does by itself and what the store is written for: nothing that a write has read changes before it commits, and
changes become visible in the order of their instants, which readers of `updated_since` rely on. Group commit makes up
for it (docs/adr/0021-postgresql.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, Engine, event
from sqlalchemy.engine import URL
from sqlalchemy.exc import DBAPIError

from headimpact_service.store.access import Access, DatabaseUrlError

if TYPE_CHECKING:
    import psycopg

OLDEST = 15
"""The oldest major version that is tried; a newer one only warns when its time has come."""
DRIVER = "psycopg"
WRITE_LOCK = 4711049
"""The key of the advisory lock that a write transaction holds."""
_TAKE_LOCK = f"SELECT pg_advisory_xact_lock({WRITE_LOCK})"
_DURABLE = (
    "SELECT set_config('synchronous_commit', 'on', false) "
    "WHERE current_setting('synchronous_commit') IN ('off', 'local')"
)
"""What was acknowledged survives the server's power, whatever its default; a stronger setting stays."""


def checked(url: URL) -> URL:
    """The URL with the driver that comes with the service."""
    if url.drivername.partition("+")[2] not in {"", DRIVER}:
        raise DatabaseUrlError(
            "PostgreSQL is reached through psycopg: use a URL like postgresql://user@host/headimpact."
        )
    if not url.database:
        raise DatabaseUrlError("The PostgreSQL URL names no database, as in postgresql://user@host/headimpact.")
    return url.set(drivername=f"postgresql+{DRIVER}")


def prepare(url: URL) -> None:
    """Nothing is to be made before a connection."""
    del url


UNREACHABLE_S = 10
"""So long a host that no longer answers the network holds a connection."""


def options(access: Access, busy_timeout_s: float) -> dict[str, Any]:
    """What an engine is made with: a connection that the server dropped is noticed before it is used to read."""
    arguments = {
        "application_name": "headimpact",
        "connect_timeout": max(2, round(busy_timeout_s)),
        "tcp_user_timeout": UNREACHABLE_S * 1000,
        "keepalives_idle": UNREACHABLE_S // 2,
        "keepalives_interval": 2,
        "keepalives_count": 3,
    }
    return {"pool_pre_ping": access is Access.READ, "connect_args": arguments}


def set_up(engine: Engine, access: Access, busy_timeout_s: float) -> None:
    """Readers see one state and cannot write; writers wait for each other's lock, but not for ever."""
    from psycopg import IsolationLevel  # only who uses PostgreSQL pays for its driver

    settings = [
        f"SET lock_timeout = {round(busy_timeout_s * 1000)}",
        "SET timezone = 'UTC'",
        _DURABLE,
    ]

    @event.listens_for(engine, "connect")
    def set_up_connection(driver: psycopg.Connection[Any], _record: object) -> None:
        for setting in settings:
            driver.execute(setting)
        driver.commit()
        driver.isolation_level = (
            IsolationLevel.REPEATABLE_READ if access is Access.READ else IsolationLevel.READ_COMMITTED
        )
        driver.read_only = access is Access.READ

    if access is not Access.READ:

        @event.listens_for(engine, "begin")
        def start(conn: Connection) -> None:
            try:
                conn.exec_driver_sql(_TAKE_LOCK)
            except DBAPIError as error:
                if not error.connection_invalidated:
                    conn.connection.rollback()  # the driver began a transaction, which has failed
                raise


def warnings(conn: Connection) -> list[str]:
    """What an operator should know about this server, as sentences; empty if nothing."""
    found = []
    version = conn.exec_driver_sql("SHOW server_version").scalar_one()
    if int(version.partition(".")[0].partition(" ")[0]) < OLDEST:
        found.append(f"PostgreSQL {version} is older than {OLDEST}, the oldest that this service is tried with.")
    if conn.exec_driver_sql("SHOW fsync").scalar_one() == "off":
        found.append("PostgreSQL runs with fsync = off: a power failure can lose or damage what was acknowledged.")
    return found


def checkpoint(engine: Engine) -> None:
    """Nothing: erased rows are overwritten when the server's vacuum has passed (docs/operations.md)."""
    del engine
