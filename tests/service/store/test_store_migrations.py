"""The migrations make the schema that the tables describe, once, whoever starts first."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from running import rows
from sqlalchemy import Connection, text

import headimpact_service
from headimpact_service.errors import Problem
from headimpact_service.store import impacts, migrate, organisations
from headimpact_service.store.database import Database
from headimpact_service.store.impact_rows import former_content
from headimpact_service.store.migrate import MigrationError
from headimpact_service.store.tables import metadata


@pytest.fixture
def database(empty_url: str) -> Iterator[Database]:
    """A database that no other test is given: what is tried here would spoil it."""
    database = Database(empty_url)
    database.migrate()
    yield database
    database.close()


def test_the_migrated_database_is_the_one_that_the_tables_describe(database: Database) -> None:
    with database.read() as conn:
        context = MigrationContext.configure(conn, opts={"compare_type": True})
        assert compare_metadata(context, metadata) == []


def test_the_version_is_committed(empty_url: str) -> None:
    database = Database(empty_url)
    database.migrate()
    database.close()
    assert rows(empty_url, "SELECT version_num FROM alembic_version") == [("0005",)]


def test_migrating_twice_changes_nothing(database: Database) -> None:
    database.migrate()
    database.check()


def _to(database: Database, revision: str) -> None:
    """Downgrade to a revision."""
    config = Config()
    config.set_main_option("script_location", str(migrate.migrations_folder()))
    with database._writing.begin() as conn:
        config.attributes["connection"] = conn
        command.downgrade(config, revision)


def test_the_way_back_to_an_empty_database_works(database: Database) -> None:
    _to(database, "base")
    with pytest.raises(Problem, match="migrated"):
        database.check()
    database.migrate()
    database.check()


def test_what_was_corrected_or_deleted_before_is_known_afterwards(database: Database, make_impact) -> None:
    def fill(conn: Connection) -> bytes:
        data_set = organisations.ensure_data_set(conn, organisations.ensure(conn, "o").id, "live")
        first, second, _ = (impacts.add(conn, data_set, make_impact(word, external_id=None)).impact for word in "abc")
        impacts.correct(conn, data_set, first.id, make_impact("d", external_id=None))
        impacts.delete(conn, data_set, second.id)
        return data_set

    data_set = database.write(fill)
    _to(database, "0004")
    delivered = former_content(data_set, make_impact("b").content_digest)  # the way back keeps any one of them
    change = text("UPDATE impacts SET deleted_content = :kept WHERE deleted_content IS NOT NULL")
    assert database.write(lambda conn: conn.execute(change, {"kept": delivered}).rowcount) == 1
    database.migrate()
    with database.read() as conn:
        assert conn.execute(text("SELECT count(*) FROM impacts")).scalar() == 3
        assert conn.execute(text("SELECT count(*) FROM former_contents")).scalar() == 2
    again = database.write(
        lambda conn: impacts.add(conn, data_set, make_impact("a", external_id=None), same_event_is_unchanged=True)
    )
    assert again.status == "unchanged"
    with pytest.raises(Problem, match="deleted"):
        database.write(
            lambda conn: impacts.add(conn, data_set, make_impact("b", external_id=None), same_event_is_unchanged=True)
        )


def test_eight_processes_that_start_at_once_migrate_once(empty_url: str) -> None:
    code = f"from headimpact_service.store.database import Database as D; d = D({empty_url!r}); d.migrate(); d.check()"
    started = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(8)]
    assert [process.wait(60) for process in started] == [0] * 8


def test_a_database_of_a_newer_version_is_refused(database: Database) -> None:
    database.write(lambda conn: conn.execute(text("UPDATE alembic_version SET version_num = '9999'")))
    with pytest.raises(MigrationError, match="newer"):
        database.migrate()


@pytest.mark.backend("sqlite")
def test_a_migration_that_loses_a_parent_is_rolled_back(database: Database, monkeypatch) -> None:
    def orphan(config, _revision: str) -> None:
        config.attributes["connection"].execute(
            text("INSERT INTO data_sets (id, organisation_id, mode) VALUES (x'01', x'02', 'live')")
        )

    monkeypatch.setattr("alembic.command.upgrade", orphan)
    with pytest.raises(MigrationError, match="parent"):
        database.migrate()
    with database.read() as conn:
        assert conn.execute(text("SELECT count(*) FROM data_sets")).scalar() == 0


@pytest.mark.backend("sqlite")
def test_foreign_keys_are_off_while_a_migration_rebuilds_tables(database: Database, monkeypatch) -> None:
    seen = []
    monkeypatch.setattr(
        "alembic.command.upgrade",
        lambda config, _: seen.append(
            config.attributes["connection"].exec_driver_sql("PRAGMA foreign_keys").scalar_one()
        ),
    )
    database.migrate()
    assert seen == [0]


def test_the_migrations_of_an_installed_package_are_found_inside_it(tmp_path: Path, monkeypatch) -> None:
    package = tmp_path / "site-packages" / "headimpact_service"
    (package / "migrations").mkdir(parents=True)
    (package / "migrations" / "env.py").touch()
    monkeypatch.setattr(headimpact_service, "__file__", str(package / "__init__.py"))
    assert migrate.migrations_folder() == package / "migrations"


def test_a_package_without_migrations_says_so(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(headimpact_service, "__file__", str(tmp_path / "a" / "b" / "__init__.py"))
    with pytest.raises(MigrationError, match="not installed"):
        migrate.migrations_folder()
