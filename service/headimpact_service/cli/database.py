"""The database that a command works on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from headimpact_service.settings import Settings
from headimpact_service.store.database import Database


@contextmanager
def migrated(database_url: str | None) -> Iterator[Database]:
    """The database of a URL, or of the settings, at this version's schema."""
    database = Database(database_url or Settings().database_url)
    try:
        database.migrate()
        yield database
    finally:
        database.close()


def migrate(database_url: str | None) -> None:
    """Bring the database to this version's schema, and say which it was."""
    with migrated(database_url) as database:
        print(f"{database.url.render_as_string(hide_password=True)} is at this version's schema.")
