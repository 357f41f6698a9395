"""Migrations at start: the whole way in one transaction that excludes every other process."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Connection, Engine

import headimpact_service

if TYPE_CHECKING:
    from alembic.script import ScriptDirectory

_ONE_AT_A_TIME = threading.Lock()
"""Alembic keeps the migration that runs in a module's variables."""


class MigrationError(RuntimeError):
    """The database cannot be brought to this version's schema."""


def migrations_folder() -> Path:
    """Where the migrations are: inside the installed package, or at the top of the source tree."""
    package = Path(headimpact_service.__file__).parent
    for folder in (package / "migrations", package.parents[1] / "migrations"):
        if (folder / "env.py").is_file():
            return folder
    raise MigrationError("The migrations were not installed with the service.")


def upgrade(engine: Engine, revision: str = "head") -> None:
    """Bring a database to a revision; a second process that starts meanwhile waits and then finds it done.

    `engine` must begin its transactions with the write lock and hold foreign keys off: with them on, the rebuild of
    a table would delete its children's rows in silence.
    """
    # Here and below: children open databases too, and only who migrates pays for what does it.
    from alembic import command
    from alembic.config import Config
    from alembic.script import ScriptDirectory

    config = Config()
    config.set_main_option("script_location", str(migrations_folder()).replace("%", "%%"))
    config.set_main_option("path_separator", "os")
    with _ONE_AT_A_TIME, engine.begin() as conn:
        _refuse_newer(conn, ScriptDirectory.from_config(config))
        config.attributes["connection"] = conn
        command.upgrade(config, revision)
        _check_foreign_keys(conn)


def current_revision(conn: Connection) -> str | None:
    """The revision of a database, None if it has no tables of ours."""
    from alembic.runtime.migration import MigrationContext

    return MigrationContext.configure(conn).get_current_revision()


def _refuse_newer(conn: Connection, scripts: ScriptDirectory) -> None:
    from alembic.util import CommandError

    revision = current_revision(conn)
    if revision is None:
        return
    try:
        scripts.get_revision(revision)
    except CommandError as error:
        raise MigrationError(
            f"The database is at revision {revision}, which this version of headimpact does not know: "
            "it was written by a newer one. Install that version, or restore a backup from before the upgrade."
        ) from error


def _check_foreign_keys(conn: Connection) -> None:
    """Roll a migration back that left a row without its parent."""
    if conn.dialect.name == "sqlite" and conn.exec_driver_sql("PRAGMA foreign_key_check").first() is not None:
        raise MigrationError("The migration would leave rows whose parent is missing; nothing was changed.")
