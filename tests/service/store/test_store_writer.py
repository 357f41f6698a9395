"""The writing thread: groups, crashes, cancellations, locks, and how it ends."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest
from named_rows import names, store
from sqlalchemy import Connection, create_engine
from sqlalchemy.exc import OperationalError

from headimpact_service.errors import Problem
from headimpact_service.store import organisations
from headimpact_service.store.database import Database
from headimpact_service.store.postgresql import WRITE_LOCK


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

    @pytest.mark.backend("sqlite")  # the driver says there whether anything was written
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
    def locked(self, database_url: str):
        """Another process's write transaction."""
        other = create_engine(Database(database_url).url)
        sqlite = other.dialect.name == "sqlite"
        with other.connect() as conn:
            conn.exec_driver_sql("BEGIN IMMEDIATE" if sqlite else f"SELECT pg_advisory_xact_lock({WRITE_LOCK})")
            yield conn
        other.dispose()

    def test_a_lock_beyond_the_busy_timeout_is_unavailable(self, locked, database_url: str) -> None:
        database = Database(database_url, busy_timeout_s=0.01)
        with pytest.raises(Problem) as caught:
            database.write(store("x"))
        assert (caught.value.slug, caught.value.headers) == ("unavailable", {"Retry-After": "2"})
        assert isinstance(caught.value.__cause__, OperationalError)
        locked.rollback()
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

    @pytest.mark.backend("sqlite")
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
