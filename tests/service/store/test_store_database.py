"""Engines, connections, and many clients at once."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path

import psycopg
import pytest
from postgres import plain
from sqlalchemy import Connection, bindparam, create_engine, insert, literal, select, text
from sqlalchemy.exc import IntegrityError, InternalError, ProgrammingError

from headimpact_service.errors import Problem
from headimpact_service.store import impacts, organisations, paging, postgresql, sqlite
from headimpact_service.store.columns import Instant
from headimpact_service.store.database import Database, DatabaseUrlError
from headimpact_service.store.prepared import Prepared
from headimpact_service.store.tables import data_sets


def names(database: Database) -> list[str]:
    with database.read() as conn:
        return list(conn.execute(text("SELECT name FROM organisations ORDER BY id")).scalars())


def store(name: str) -> Callable[[Connection], bytes]:
    return lambda conn: organisations.ensure(conn, name).id


class TestUrl:
    @pytest.mark.parametrize("url", ["sqlite://", "sqlite:///:memory:", "sqlite:///file:x?mode=memory&uri=true"])
    def test_a_database_in_memory_is_refused(self, url: str) -> None:
        with pytest.raises(DatabaseUrlError, match="memory"):
            Database(url)

    def test_what_is_no_url_is_refused(self) -> None:
        with pytest.raises(DatabaseUrlError, match="form"):
            Database("headimpact.db")

    def test_another_engine_is_refused(self) -> None:
        with pytest.raises(DatabaseUrlError, match="SQLite"):
            Database("mysql://localhost/x")

    @pytest.mark.parametrize(
        ("url", "said"), [("postgresql+psycopg2://h/x", "psycopg"), ("postgresql://h", "names no database")]
    )
    def test_a_server_s_url_that_cannot_be_used_is_refused(self, url: str, said: str) -> None:
        with pytest.raises(DatabaseUrlError, match=said):
            Database(url)

    @pytest.mark.parametrize("scheme", ["postgres", "postgresql", "postgresql+psycopg"])
    def test_a_server_has_the_url_that_its_hosts_give(self, scheme: str) -> None:
        database = Database(f"{scheme}://me:secret@host/x")
        assert str(database.url) == "postgresql+psycopg://me:***@host/x"
        assert not database.is_file

    def test_the_folder_of_the_file_is_made(self, tmp_path: Path) -> None:
        database = Database(f"sqlite:///{tmp_path / 'new' / 'folder' / 'x.db'}")
        database.migrate()
        database.close()
        assert (tmp_path / "new" / "folder" / "x.db").stat().st_size > 0


class TestConnections:
    @pytest.mark.backend("sqlite")
    def test_every_connection_is_durable_and_checked(self, database: Database) -> None:
        def pragmas(conn: Connection) -> list[object]:
            return [
                conn.exec_driver_sql(f"PRAGMA {name}").scalar()
                for name in ("journal_mode", "synchronous", "foreign_keys", "busy_timeout", "secure_delete")
            ]

        expected = ["wal", 2, 1, 5000, 1]
        assert database.write(pragmas) == expected
        with database.read() as conn:
            assert pragmas(conn) == expected

    def test_a_reader_cannot_write(self, database: Database) -> None:
        with pytest.raises(Problem if database.is_file else InternalError), database.read() as conn:
            conn.execute(text("DELETE FROM organisations"))
        database.check()

    def test_a_reader_sees_one_state_throughout(self, database: Database) -> None:
        with database.read() as conn:
            assert organisations.is_empty(conn)
            database.write(store("Club"))
            assert organisations.find(conn, "Club") is None
        assert names(database) == ["Club"]

    def test_a_row_without_its_parent_is_refused(self, database: Database) -> None:
        orphan = insert(data_sets).values(id=b"1", organisation_id=b"2", mode="live")
        with pytest.raises(IntegrityError):
            database.write(lambda conn: conn.execute(orphan))

    def test_two_writers_of_one_database_see_each_others_commits(self, database: Database, database_url: str) -> None:
        other = Database(database_url)
        database.write(store("one"))
        other.write(store("two"))
        assert names(database) == names(other) == ["one", "two"]
        other.close()

    def test_a_naive_instant_is_a_mistake(self, database: Database, data_set: bytes, make_impact) -> None:
        with pytest.raises(TypeError):
            database.write(
                lambda conn: impacts.add(conn, data_set, make_impact(occurred_at=datetime(2026, 1, 1)))  # noqa: DTZ001 - the mistake that is tried
            )


class TestChecks:
    def test_a_migrated_database_is_ready(self, database: Database) -> None:
        database.check()
        assert database.waiting == 0

    def test_a_database_without_tables_is_not_ready(self, empty_url: str) -> None:
        database = Database(empty_url)
        with pytest.raises(Problem) as caught:
            database.check()
        assert caught.value.slug == "unavailable"
        database.close()

    @pytest.mark.parametrize("url", ["sqlite:///{folder}/x.db", "postgresql://postgres@/x?host={folder}"])
    def test_what_is_no_database_is_not_ready(self, url: str, tmp_path: Path) -> None:
        (tmp_path / "x.db").write_bytes(b"text, and no database at all" * 200)
        database = Database(url.format(folder=tmp_path))
        for attempt in (database.check, database.migrate, lambda: database.write(store("x"))):
            with pytest.raises(Problem) as caught:
                attempt()
            assert caught.value.slug == "unavailable"
        database.close()

    @pytest.mark.backend("sqlite")
    @pytest.mark.parametrize(("version", "warnings"), [((3, 51, 2), 1), ((3, 51, 3), 0), ((3, 40, 1), 1)])
    def test_a_library_with_the_wal_reset_race_is_warned_of(self, database, monkeypatch, version, warnings) -> None:
        monkeypatch.setattr(sqlite.sqlite3, "sqlite_version_info", version)
        assert len(database.warnings()) == warnings
        assert all("3.51.3" in warning for warning in database.warnings())

    @pytest.mark.backend("postgresql")
    def test_a_server_older_than_what_is_tried_is_warned_of(self, database: Database, monkeypatch) -> None:
        monkeypatch.setattr(postgresql, "OLDEST", 99)
        assert "older than 99" in database.warnings()[0]


@pytest.mark.backend("postgresql")
class TestServer:
    """A server that goes away and comes back."""

    END_OTHERS = (
        "SELECT pg_terminate_backend(pid, 10000) FROM pg_stat_activity "
        "WHERE application_name = 'headimpact' AND datname = current_database()"
    )

    def test_connections_that_it_closed_meanwhile_are_made_again(self, database: Database, database_url: str) -> None:
        database.write(store("before"))
        assert names(database) == ["before"]
        with psycopg.connect(plain(database_url), autocommit=True) as other:
            assert len(other.execute(self.END_OTHERS).fetchall()) >= 2
        database.write(store("after"))
        assert names(database) == ["before", "after"]

    @pytest.mark.parametrize("together", [1, 5])
    def test_a_write_that_is_cut_off_is_unavailable_and_stored_nothing(
        self, database: Database, database_url: str, together: int
    ) -> None:
        def cut(conn: Connection) -> None:
            organisations.ensure(conn, "cut")
            with psycopg.connect(plain(database_url), autocommit=True) as other:
                other.execute(self.END_OTHERS)
            organisations.ensure(conn, "never")

        with ThreadPoolExecutor(together) as pool:
            results = [pool.submit(database.write, cut) for _ in range(together)]
        for result in results:
            with pytest.raises(Problem) as caught:
                result.result()
            assert caught.value.slug == "unavailable"
        assert names(database) == []
        database.write(store("after"))
        assert names(database) == ["after"]

    def test_what_is_acknowledged_is_durable_whatever_the_server_s_default(self, empty_url: str) -> None:
        with psycopg.connect(plain(empty_url), autocommit=True) as other:
            other.execute(f"ALTER DATABASE {other.info.dbname} SET synchronous_commit = off")  # type: ignore[call-overload]  # psycopg asks for a literal
        database = Database(empty_url)
        database.migrate()
        asked = text("SHOW synchronous_commit")
        assert database.write(lambda conn: conn.execute(asked).scalar()) == "on"
        database.close()


class TestConcurrency:
    def test_twenty_senders_of_one_event_store_it_once(self, database: Database, data_set: bytes, make_impact) -> None:
        start = threading.Barrier(20)

        def send(_: int) -> impacts.Outcome:
            start.wait()
            return database.write(lambda conn: impacts.add(conn, data_set, make_impact()))

        with ThreadPoolExecutor(20) as pool:
            outcomes = list(pool.map(send, range(20)))
        assert sorted(outcome.status for outcome in outcomes) == ["created", *["unchanged"] * 19]
        assert len({outcome.impact.id for outcome in outcomes}) == 1

    def test_senders_through_two_databases_store_each_event_once(
        self, database: Database, database_url: str, data_set: bytes, make_impact
    ) -> None:
        other = Database(database_url)

        def send(number: int) -> str:
            new = make_impact(external_id=str(number // 2))
            target = (database, other)[number % 2]
            return target.write(lambda conn: impacts.add(conn, data_set, new)).status

        with ThreadPoolExecutor(8) as pool:
            statuses = list(pool.map(send, range(80)))
        other.close()
        assert (statuses.count("created"), statuses.count("unchanged")) == (40, 40)

    def test_two_processes_write_side_by_side(self, database: Database, database_url: str, data_set: bytes) -> None:
        script = str(Path(__file__).with_name("writing_process.py"))
        command = [sys.executable, script, database_url, data_set.hex()]
        processes = [subprocess.Popen([*command, name, "2"], stdout=subprocess.PIPE, text=True) for name in ("a", "b")]
        for process in processes:
            assert all(process.stdout.readline() for _ in range(40))
        for process in processes:
            process.kill()
            process.communicate()
        with database.read() as conn:
            stored = impacts.page(conn, data_set, limit=1000).rows
        assert {impact.external_id[0] for impact in stored} == {"a", "b"}

    def test_a_client_that_follows_the_changes_misses_none(
        self, database: Database, data_set: bytes, make_impact
    ) -> None:
        """Four threads add, correct and delete while one follows `updated_since`; in the end it knows every state."""
        since, done = datetime(2020, 1, 1, tzinfo=UTC), threading.Event()

        def work(thread: int) -> None:
            for number in range(25):
                name = f"{thread}-{number}"
                made = database.write(lambda c, n=name: impacts.add(c, data_set, make_impact(external_id=n))).impact
                if number % 3 == 0:
                    new = make_impact("new", external_id=name)
                    database.write(lambda c, i=made.id, n=new: impacts.correct(c, data_set, i, n))
                if number % 5 == 0:
                    database.write(lambda c, i=made.id: impacts.delete(c, data_set, i))

        known: dict[bytes, tuple[int, datetime | None]] = {}
        order: list[datetime] = []

        def follow() -> None:
            after: paging.Position | None = None
            while True:
                last_round = done.is_set()
                while True:
                    with database.read() as conn:
                        page = impacts.page(conn, data_set, updated_since=since, after=after, limit=7)
                    known.update({row.id: (row.revision, row.deleted_at) for row in page.rows})
                    order.extend(row.updated_at for row in page.rows)
                    if page.rows:
                        after = paging.Position(page.rows[-1].updated_at, page.rows[-1].id)
                    else:
                        break
                if last_round:
                    return

        with ThreadPoolExecutor(5) as pool:
            following = pool.submit(follow)
            for worker in [pool.submit(work, thread) for thread in range(4)]:
                worker.result()
            done.set()
            following.result()
        with database.read() as conn:
            present = impacts.page(conn, data_set, updated_since=since, limit=1000).rows
        assert known == {row.id: (row.revision, row.deleted_at) for row in present}
        assert len(known) == 100
        assert order == sorted(set(order))
        assert sum(row.deleted_at is not None for row in present) == 20

    def test_instants_of_change_increase_when_the_clock_stands_still(
        self, database: Database, data_set: bytes, make_impact, monkeypatch
    ) -> None:
        from headimpact_service.store import clock

        class Stopped(datetime):
            @classmethod
            def now(cls, tz=None) -> datetime:
                return datetime(2026, 1, 1, tzinfo=tz)

        monkeypatch.setattr(clock, "datetime", Stopped)
        made = [
            database.write(lambda c, n=n: impacts.add(c, data_set, make_impact(external_id=str(n)))).impact.updated_at
            for n in range(3)
        ]
        assert [(each - made[0]).microseconds for each in made] == [0, 1, 2]


class TestStart:
    """Several processes open one new file at the same moment."""

    def test_the_switch_to_wal_is_tried_until_the_file_is_free(self, tmp_path: Path) -> None:
        other = sqlite3.connect(tmp_path / "x.db", isolation_level=None, check_same_thread=False)
        other.execute("BEGIN EXCLUSIVE")
        driver = sqlite3.connect(tmp_path / "x.db", isolation_level=None, timeout=0)
        with pytest.raises(sqlite3.OperationalError, match="locked"):
            sqlite._switch_to_wal(driver, attempts=3, pause_s=0.0)
        with ThreadPoolExecutor(1) as pool:
            switched = pool.submit(other.execute, "ROLLBACK")
            sqlite._switch_to_wal(driver, attempts=1_000_000, pause_s=0.0)
            switched.result()
        assert driver.execute("PRAGMA journal_mode").fetchone() == ("wal",)
        driver.close()
        other.close()


def test_a_mistake_in_a_query_is_not_taken_for_an_outage(database: Database) -> None:
    with pytest.raises(ProgrammingError), database.read() as conn:
        conn.execute(text("SELECT :value"), {"value": object()})


@pytest.mark.parametrize("paramstyle", ["qmark", "named"])
def test_a_prepared_statement_runs_with_either_style_of_parameters(paramstyle: str) -> None:
    """PostgreSQL's driver takes parameters by name."""
    moment = datetime(2026, 11, 20, 19, 4, 5, 123456, tzinfo=UTC)
    query = select(bindparam("moment", type_=Instant()), literal(7)).limit(1)
    engine = create_engine("sqlite://", paramstyle=paramstyle)
    with engine.connect() as conn:
        assert Prepared(query).first(conn, {"moment": moment}) == [moment, 7]
        assert Prepared(query.limit(0)).first(conn, {"moment": moment}) is None
    engine.dispose()


@pytest.mark.backend("sqlite")
def test_a_new_file_and_what_lies_beside_it_are_for_this_user_only(tmp_path: Path) -> None:
    file = tmp_path / "new" / "h.db"
    database = Database(f"sqlite:///{file}")
    database.migrate()
    try:
        organisations_made = database.write(lambda conn: organisations.ensure(conn, "o"))
        modes = {path.name: path.stat().st_mode & 0o777 for path in file.parent.iterdir() if path.is_file()}
    finally:
        database.close()
    assert organisations_made.name == "o"
    assert {"h.db", "h.db-wal"} <= set(modes)
    assert set(modes.values()) == {0o600}


@pytest.mark.backend("sqlite")
@pytest.mark.parametrize(("mode", "told"), [(0o600, False), (0o400, False), (0o640, True), (0o644, True)])
def test_a_file_that_others_may_read_is_warned_of(tmp_path: Path, mode: int, *, told: bool) -> None:
    file = tmp_path / "restored.db"
    database = Database(f"sqlite:///{file}")
    database.migrate()
    try:
        file.chmod(mode)
        assert any(f"{mode:04o}" in warning for warning in database.warnings()) == told
    finally:
        database.close()
