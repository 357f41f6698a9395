"""Short writes of an event loop: which of them share a transaction, and for how long the loop stands still."""

from __future__ import annotations

import asyncio
import threading
import time
from typing import Any

import pytest
from named_rows import names, store
from sqlalchemy import Connection

from headimpact_service.errors import Problem
from headimpact_service.store import organisations
from headimpact_service.store.database import Database


def transaction(conn: Connection) -> Any:
    return conn.get_transaction()


async def turns(done: threading.Event) -> int:
    """How often the loop turned until then."""
    count = 0
    while not done.is_set():
        await asyncio.sleep(0)
        count += 1
    return count


class TestGathered:
    def test_the_writes_of_one_turn_share_a_transaction(self, database: Database) -> None:
        async def send() -> list[Any]:
            return await asyncio.gather(*(database.write_short(transaction) for _ in range(20)))

        assert len(set(map(id, asyncio.run(send())))) == 1

    def test_they_are_committed_when_they_are_answered(self, database: Database) -> None:
        async def send() -> list[str]:
            await database.write_short(store("club"))
            return names(database)

        assert asyncio.run(send()) == ["club"]

    def test_what_comes_while_a_group_is_under_way_is_the_next_group(self, database: Database) -> None:
        begun, go_on = threading.Event(), threading.Event()

        def hold(conn: Connection) -> Any:
            begun.set()
            assert go_on.wait(10)
            return transaction(conn)

        async def send() -> list[Any]:
            first = asyncio.ensure_future(database.write_short(hold))
            while not begun.is_set():
                await asyncio.sleep(0)
            later = []
            for _ in range(10):
                later.append(asyncio.ensure_future(database.write_short(transaction)))
                await asyncio.sleep(0)
            go_on.set()
            return await asyncio.gather(first, *later)

        first, *later = asyncio.run(send())
        assert len(set(map(id, later))) == 1
        assert later[0] is not first

    @pytest.mark.backend("sqlite")
    def test_the_loop_stands_still_while_the_transaction_is_filled(self, database: Database) -> None:
        ticks = 0
        seen = []

        def look(_conn: Connection) -> None:
            before = ticks
            time.sleep(0.002)
            seen.append(ticks - before)

        async def send() -> None:
            nonlocal ticks
            sending = asyncio.ensure_future(database.write_short(look))
            while not sending.done():
                await asyncio.sleep(0)
                ticks += 1

        database.write(store("the thread is there"))
        asyncio.run(send())
        assert seen == [0]

    @pytest.mark.backend("postgresql")
    def test_the_loop_goes_on_where_statements_are_waited_for(self, database: Database) -> None:
        begun, turned = threading.Event(), threading.Event()

        def wait_for_a_turn(_conn: Connection) -> bool:
            begun.set()
            return turned.wait(10)

        async def send() -> bool:
            sending = asyncio.ensure_future(database.write_short(wait_for_a_turn))
            await turns(begun)
            turned.set()
            return await sending

        assert asyncio.run(send())

    def test_a_write_that_takes_long_does_not_stop_the_loop(self, database: Database) -> None:
        go_on = threading.Event()

        async def send() -> bool:
            sending = asyncio.ensure_future(database.write_short(lambda _conn: go_on.wait(10)))
            await asyncio.sleep(0.05)
            go_on.set()
            return await sending

        assert asyncio.run(send())

    def test_a_failure_leaves_the_others_of_its_group_stored(self, database: Database) -> None:
        def crash(conn: Connection) -> None:
            organisations.ensure(conn, "half-done")
            raise RuntimeError("a mistake")

        def refuse(conn: Connection) -> None:
            organisations.ensure(conn, "refused")
            raise Problem("conflict", "No.")

        async def send() -> list[Any]:
            writes = map(database.write_short, (store("before"), crash, refuse, store("after")))
            return await asyncio.gather(*writes, return_exceptions=True)

        outcomes = asyncio.run(send())
        assert isinstance(outcomes[1], RuntimeError)
        assert isinstance(outcomes[2], Problem)
        assert names(database) == ["before", "after"]

    def test_a_cancelled_wait_does_not_undo_the_write(self, database: Database) -> None:
        async def leave() -> None:
            waiting = asyncio.ensure_future(database.write_short(store("left")))
            await asyncio.sleep(0)
            waiting.cancel()
            with pytest.raises(asyncio.CancelledError):
                await waiting
            await database.write_short(store("stayed"))

        asyncio.run(leave())
        assert names(database) == ["left", "stayed"]

    def test_a_closed_loop_does_not_hold_up_the_next(self, database: Database) -> None:
        begun, go_on = threading.Event(), threading.Event()

        def hold(_conn: Connection) -> None:
            begun.set()
            assert go_on.wait(10)

        async def leave() -> None:
            asyncio.ensure_future(database.write_short(hold))  # noqa: RUF006 - it is left behind on purpose
            await turns(begun)
            asyncio.ensure_future(database.write_short(store("never handed over")))  # noqa: RUF006
            await asyncio.sleep(0)

        asyncio.run(leave())
        go_on.set()
        asyncio.run(database.write_short(store("later")))
        assert names(database) == ["later"]

    def test_all_of_a_group_hear_that_the_database_is_closed(self, database: Database) -> None:
        async def send() -> list[Any]:
            return await asyncio.gather(
                *(database.write_short(store(f"club {n}")) for n in range(5)), return_exceptions=True
            )

        database.close()
        outcomes = asyncio.run(send())
        assert [(type(found), found.slug, found.headers) for found in outcomes] == [
            (Problem, "unavailable", {"Retry-After": "2"})
        ] * 5

    def test_what_is_refused_does_not_hold_up_what_comes_later(self, database_url: str) -> None:
        database = Database(database_url, queue_capacity=0)
        database.migrate()

        async def send() -> list[Any]:
            outcomes = []
            for _ in range(2):
                outcomes += await asyncio.gather(database.write_short(store("x")), return_exceptions=True)
            return outcomes

        assert [found.slug for found in asyncio.run(asyncio.wait_for(send(), 10))] == ["unavailable"] * 2
        database.close()
