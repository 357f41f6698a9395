"""Engines, the writing thread, and everything that can go wrong with them."""

from __future__ import annotations

import asyncio
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path

import pytest
from sqlalchemy import Connection, text
from sqlalchemy.exc import IntegrityError, OperationalError

from headimpact_service.errors import Problem
from headimpact_service.store import database as database_module
from headimpact_service.store import impacts, organisations, paging
from headimpact_service.store.database import Database, DatabaseUrlError


def names(database: Database) -> list[str]:
    with database.read() as conn:
        return list(conn.execute(text("SELECT name FROM organisations ORDER BY id")).scalars())


def store(name: str) -> Callable[[Connection], bytes]:
    return lambda conn: organisations.ensure(conn, name).id


class Gate:
    """Holds the writing thread inside a transaction until opened, so that what comes meanwhile is one group."""

    def __init__(self, database: Database) -> None:
        self._entered, self._open = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=database.write, args=(self._hold,))
        self._thread.start()
        assert self._entered.wait(10)

    def _hold(self, _conn: Connection) -> None:
        self._entered.set()
        assert self._open.wait(10)

    def open(self) -> None:
        self._open.set()
        self._thread.join()


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

    def test_the_folder_of_the_file_is_made(self, tmp_path: Path) -> None:
        database = Database(f"sqlite:///{tmp_path / 'new' / 'folder' / 'x.db'}")
        database.migrate()
        database.close()
        assert (tmp_path / "new" / "folder" / "x.db").stat().st_size > 0


class TestConnections:
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
        with pytest.raises(Problem), database.read() as conn:
            conn.execute(text("DELETE FROM organisations"))

    def test_a_reader_sees_one_state_throughout(self, database: Database) -> None:
        with database.read() as conn:
            assert organisations.is_empty(conn)
            database.write(store("Club"))
            assert organisations.find(conn, "Club") is None
        assert names(database) == ["Club"]

    def test_a_row_without_its_parent_is_refused(self, database: Database) -> None:
        orphan = text("INSERT INTO data_sets (id, organisation_id, mode) VALUES (x'01', x'02', 'live')")
        with pytest.raises(IntegrityError):
            database.write(lambda conn: conn.execute(orphan))

    def test_two_databases_on_one_file_see_each_others_commits(self, database: Database, database_url: str) -> None:
        other = Database(database_url)
        database.write(store("one"))
        other.write(store("two"))
        assert names(database) == names(other) == ["one", "two"]
        other.close()

    def test_a_naive_instant_is_a_mistake(self, database: Database, data_set: bytes, make_impact) -> None:
        with pytest.raises(TypeError):
            database.write(
                lambda conn: impacts.add(conn, data_set, make_impact(occurred_at=datetime(2026, 1, 1)))  # noqa: DTZ001
            )


class TestChecks:
    def test_a_migrated_database_is_ready(self, database: Database) -> None:
        database.check()
        assert database.waiting == 0

    def test_an_empty_file_is_not_ready(self, database_url: str) -> None:
        database = Database(database_url)
        with pytest.raises(Problem) as caught:
            database.check()
        assert caught.value.slug == "unavailable"
        database.close()

    def test_a_file_that_is_no_database_is_not_ready(self, database_url: str, tmp_path: Path) -> None:
        (tmp_path / "headimpact.db").write_bytes(b"text, and no database at all" * 200)
        database = Database(database_url)
        for attempt in (database.check, database.migrate, lambda: database.write(store("x"))):
            with pytest.raises(Problem) as caught:
                attempt()
            assert caught.value.slug == "unavailable"
        database.close()

    @pytest.mark.parametrize(("version", "warnings"), [((3, 51, 2), 1), ((3, 51, 3), 0), ((3, 40, 1), 1)])
    def test_a_library_with_the_wal_reset_race_is_warned_of(self, database, monkeypatch, version, warnings) -> None:
        monkeypatch.setattr(database_module.sqlite3, "sqlite_version_info", version)
        assert len(database.warnings()) == warnings
        assert all("3.51.3" in warning for warning in database.warnings())


class TestWriter:
    def test_writes_that_wait_together_share_a_commit(self, database: Database) -> None:
        transactions = []
        gate = Gate(database)
        with ThreadPoolExecutor(10) as pool:
            futures = [
                pool.submit(database.write, lambda conn: transactions.append(conn.get_transaction())) for _ in range(10)
            ]
            while database.waiting < 10:
                pass
            gate.open()
            for future in futures:
                future.result()
        assert len(set(map(id, transactions))) == 1
        assert len(transactions) == 10

    def test_a_batch_is_bounded(self, database_url: str) -> None:
        database = Database(database_url, batch=4)
        database.migrate()
        gate = Gate(database)
        transactions = []
        with ThreadPoolExecutor(10) as pool:
            for _ in range(10):
                pool.submit(database.write, lambda conn: transactions.append(conn.get_transaction()))
            while database.waiting < 10:
                pass
            gate.open()
        assert len({id(each) for each in transactions}) == 3
        database.close()

    def test_a_crash_in_a_group_leaves_the_others_stored(self, database: Database) -> None:
        def crash(conn: Connection) -> None:
            organisations.ensure(conn, "half-done")
            raise RuntimeError("a mistake")

        outcomes = self.together(database, [store("before"), crash, store("after")])
        assert isinstance(outcomes[1], RuntimeError)
        assert names(database) == ["before", "after"]

    def test_a_problem_after_a_write_rolls_back_that_write_only(self, database: Database) -> None:
        def refuse(conn: Connection) -> None:
            organisations.ensure(conn, "half-done")
            raise Problem("conflict", "No.")

        outcomes = self.together(database, [store("before"), refuse, store("after")])
        assert isinstance(outcomes[1], Problem)
        assert names(database) == ["before", "after"]

    def test_a_problem_before_any_write_is_only_answered(self, database: Database) -> None:
        runs = []

        def refuse(_conn: Connection) -> None:
            runs.append("refuse")
            raise Problem("conflict", "No.")

        outcomes = self.together(database, [store("before"), refuse, store("after")])
        assert isinstance(outcomes[1], Problem)
        assert runs == ["refuse"]
        assert names(database) == ["before", "after"]

    def test_even_an_exit_inside_a_function_leaves_the_thread_alive(self, database: Database) -> None:
        def leave(_conn: Connection) -> None:
            raise SystemExit

        with pytest.raises(SystemExit):
            database.write(leave)
        database.write(store("after"))
        assert names(database) == ["after"]

    def test_writes_from_an_event_loop_are_committed_when_answered(self, database: Database) -> None:
        async def send() -> list[bytes]:
            return await asyncio.gather(*(database.write_async(store(f"club {number}")) for number in range(50)))

        assert len(set(asyncio.run(send()))) == 50
        assert len(names(database)) == 50

    def test_an_error_reaches_the_event_loop(self, database: Database) -> None:
        async def fail() -> None:
            await database.write_async(lambda _conn: 1 / 0)

        with pytest.raises(ZeroDivisionError):
            asyncio.run(fail())

    def test_a_cancelled_wait_does_not_undo_the_write(self, database: Database) -> None:
        gate = Gate(database)

        async def leave() -> None:
            waiting = asyncio.ensure_future(database.write_async(store("left")))
            await asyncio.sleep(0)
            waiting.cancel()
            gate.open()
            with pytest.raises(asyncio.CancelledError):
                await waiting
            await database.write_async(store("stayed"))

        asyncio.run(leave())
        assert names(database) == ["left", "stayed"]

    def test_a_closed_event_loop_does_not_stop_the_writer(self, database: Database) -> None:
        gate = Gate(database)

        async def leave() -> None:
            waiting = asyncio.ensure_future(database.write_async(store("left")))
            await asyncio.sleep(0)
            waiting.cancel()

        asyncio.run(leave())
        gate.open()
        database.write(store("later"))
        assert names(database) == ["left", "later"]

    def test_closing_finishes_what_is_queued_and_refuses_what_comes_later(
        self, database: Database, database_url: str
    ) -> None:
        gate = Gate(database)
        with ThreadPoolExecutor(21) as pool:
            queued = [pool.submit(database.write, store(f"club {number}")) for number in range(20)]
            while database.waiting < 20:
                pass
            closing = pool.submit(database.close)
            while database.waiting < 21:
                pass
            gate.open()
            closing.result()
            assert all(future.result() for future in queued)
        with pytest.raises(Problem) as caught:
            database.write(store("too late"))
        assert (caught.value.slug, caught.value.headers) == ("unavailable", {"Retry-After": "2"})
        database.close()
        reopened = Database(database_url)
        assert len(names(reopened)) == 20
        reopened.close()

    def test_a_full_queue_is_unavailable(self, database_url: str) -> None:
        database = Database(database_url, queue_capacity=1)
        database.migrate()
        gate = Gate(database)
        with ThreadPoolExecutor(1) as pool:
            queued = pool.submit(database.write, store("queued"))
            while database.waiting < 1:
                pass
            with pytest.raises(Problem) as caught:
                database.write(store("one too many"))
            gate.open()
            queued.result()
        assert (caught.value.slug, caught.value.headers) == ("unavailable", {"Retry-After": "2"})
        assert names(database) == ["queued"]
        database.close()

    def together(self, database: Database, functions: list[Callable]) -> list[object]:
        """Run functions as one group, in this order; the result or the exception of each."""
        gate = Gate(database)
        with ThreadPoolExecutor(len(functions)) as pool:
            futures = []
            for waiting, function in enumerate(functions, start=1):
                futures.append(pool.submit(database.write, function))
                while database.waiting < waiting:
                    pass
            gate.open()
        return [future.exception() or future.result() for future in futures]


class TestLocks:
    @pytest.fixture
    def locked(self, database: Database, tmp_path: Path):
        """Another process's write transaction."""
        other = sqlite3.connect(tmp_path / "headimpact.db", isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        yield other
        other.close()

    def test_a_lock_beyond_the_busy_timeout_is_unavailable(self, locked, database_url: str) -> None:
        database = Database(database_url, busy_timeout_s=0.01)
        with pytest.raises(Problem) as caught:
            database.write(store("x"))
        assert (caught.value.slug, caught.value.headers) == ("unavailable", {"Retry-After": "2"})
        assert isinstance(caught.value.__cause__, OperationalError)
        locked.execute("ROLLBACK")
        database.write(store("y"))
        assert names(database) == ["y"]
        database.close()

    def test_a_group_waits_for_a_lock_once(self, locked, database_url: str) -> None:
        database = Database(database_url, busy_timeout_s=0.01)

        async def send() -> list[object]:
            writes = [database.write_async(store(f"club {number}")) for number in range(200)]
            return await asyncio.gather(*writes, return_exceptions=True)

        assert {type(outcome) for outcome in asyncio.run(send())} == {Problem}
        database.close()

    def test_readers_are_not_held_up_by_a_writer(self, locked, database: Database) -> None:
        assert names(database) == []

    def test_a_migration_behind_a_lock_is_unavailable(self, locked, database_url: str) -> None:
        database = Database(database_url, busy_timeout_s=0.01)
        with pytest.raises(Problem) as caught:
            database.migrate()
        assert caught.value.slug == "unavailable"
        database.close()

    def test_a_full_disk_is_unavailable_and_stores_nothing(self, database: Database) -> None:
        def fill(conn: Connection) -> None:
            pages = conn.exec_driver_sql("PRAGMA page_count").scalar()
            conn.exec_driver_sql(f"PRAGMA max_page_count = {pages}")
            for number in range(1000):
                organisations.ensure(conn, f"{number}" * 60)

        with pytest.raises(Problem) as caught:
            database.write(fill)
        assert caught.value.slug == "unavailable"
        assert names(database) == []


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
