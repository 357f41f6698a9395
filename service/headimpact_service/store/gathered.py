"""Short writes of an event loop: those of one turn go into one transaction, while the loop stands still.

Two threads that are both busy hand Python's lock to and fro at every statement, which costs a request more than its
statements do. So the loop waits while the writing thread fills the transaction, and goes on while that is committed.
It never waits for long: a database that is slow, or locked by another process, holds up nobody but those who write.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from threading import Lock
from typing import TypeVar

from sqlalchemy import Connection

from headimpact_service.errors import Problem
from headimpact_service.store.writer import Write, Writer

T = TypeVar("T")

STANDSTILL_S = 0.01
"""The longest that a loop stands still for one group: some fifty impacts."""


class Gathered:
    """Gathers the short writes of one event loop; they are handed over when no group of it is under way."""

    def __init__(self, writer: Writer, *, standstill_s: float) -> None:
        """Through `writer`. Without `standstill_s` the loop goes on: where statements are mostly waited for."""
        self._writer = writer
        self._standstill_s = standstill_s
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting: list[Write] = []
        self._under_way = False

    async def write(self, run: Callable[[Connection], T]) -> T:
        """As :meth:`headimpact_service.store.writer.Writer.write_async`, of a function that writes a few rows."""
        loop = asyncio.get_running_loop()
        if loop is not self._loop:  # one that was closed took what it waited for with it
            self._loop, self._waiting, self._under_way = loop, [], False
        waiter: asyncio.Future[T] = loop.create_future()
        self._waiting.append(Write(run, waiter, loop))
        if len(self._waiting) == 1 and not self._under_way:
            loop.call_soon(self._hand_over)
        return await waiter

    def _hand_over(self) -> None:
        """Give what has been gathered to the writer, and let it fill its transaction."""
        group, self._waiting = self._waiting, []
        stand_still = self._standstill_s > 0 and self._writer.is_idle
        empty = Lock()
        empty.acquire()
        group[-1].filled, group[-1].answered = empty.release, self._answered
        try:
            self._writer.submit(group)
        except Problem as problem:
            for write in group:
                write.error = problem
                write.resolve()
            return
        self._under_way = True
        if stand_still:
            empty.acquire(timeout=self._standstill_s)

    def _answered(self) -> None:
        """The next group, if one waits, goes in the next turn of the loop."""
        self._under_way = False
        if self._waiting and self._loop is not None:
            self._loop.call_soon(self._hand_over)
