"""The one thread that writes: it commits whatever is queued together, and acknowledges after the commit.

One commit costs one wait for the disk, however many writes it holds; under load the writes that arrive during a commit
share the next one. Writers never meet inside the process, so none waits for another's lock.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from sqlalchemy import Connection, Engine, RootTransaction
from sqlalchemy.exc import DBAPIError

from headimpact_service.errors import Problem
from headimpact_service.store.unavailable import is_out_of_reach, unavailable

T = TypeVar("T")


@dataclass(slots=True)
class Write:
    """One queued function, and what became of it."""

    run: Callable[[Connection], Any]
    waiter: Future[Any] | asyncio.Future[Any]
    loop: asyncio.AbstractEventLoop | None
    result: Any = None
    error: BaseException | None = None
    filled: Callable[[], None] | None = None
    """Called once, by the writing thread, when its transaction holds it or has failed, before the commit."""
    answered: Callable[[], None] | None = None
    """Called by whoever answers it."""

    def resolve(self) -> None:
        """Answer whoever waits, unless they left."""
        if self.answered is not None:
            self.answered()
        if self.waiter.done():
            return
        if self.error is not None:
            self.waiter.set_exception(self.error)
        else:
            self.waiter.set_result(self.result)


class Writer:
    """A queue of functions, each run once inside a committed transaction.

    Functions must be re-runnable: when one of a group fails after it wrote, the group is rolled back and each of the
    others is run again in a transaction of its own.
    """

    def __init__(self, engine: Engine, *, capacity: int, batch: int) -> None:
        """Write through `engine`; at most about `capacity` writes wait, at most `batch` share a commit."""
        self._engine = engine
        self._capacity = capacity
        self._batch = batch
        self._queue: SimpleQueue[Write | None] = SimpleQueue()
        self._lock = threading.Lock()
        self._closed = False
        self._idle = True
        self._thread: threading.Thread | None = None
        self._conn: Connection | None = None

    def write(self, run: Callable[[Connection], T]) -> T:
        """Run a function in a write transaction and return its result once that is committed."""
        waiter: Future[T] = Future()
        self.submit([Write(run, waiter, None)])
        return waiter.result()

    async def write_async(self, run: Callable[[Connection], T]) -> T:
        """The same without blocking the event loop. Cancelling the wait does not undo the write."""
        loop = asyncio.get_running_loop()
        waiter: asyncio.Future[T] = loop.create_future()
        self.submit([Write(run, waiter, loop)])
        return await waiter

    def close(self) -> None:
        """Finish what is queued, refuse what comes later, end the thread."""
        with self._lock:
            first, self._closed = not self._closed, True
            if first and self._thread is not None:
                self._queue.put(None)
        if self._thread is not None:
            self._thread.join()

    @property
    def waiting(self) -> int:
        """About how many writes are queued."""
        return self._queue.qsize()

    @property
    def is_idle(self) -> bool:
        """Whether the thread waits for something to write."""
        return self._idle

    def submit(self, writes: Sequence[Write]) -> None:
        """Queue them behind one another; their waiters are answered. 503 where they cannot be taken."""
        with self._lock:
            if self._closed:
                raise unavailable("The service is shutting down.")
            if self._queue.qsize() >= self._capacity:
                raise unavailable("Too many writes are waiting for the database.")
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, name="headimpact-writer", daemon=True)
                self._thread.start()
            for write in writes:
                self._queue.put(write)

    def _work(self) -> None:
        """Until closed: take what is queued, write it, answer it."""
        closing = False
        while not closing and (first := self._queue.get()) is not None:
            self._idle = False
            group, closing = self._collect(first)
            self._write_group(group)
            self._idle = True
            _answer(group)
        self._leave()

    def _collect(self, first: Write) -> tuple[list[Write], bool]:
        """The writes that share the next commit, and whether the queue was closed behind them."""
        group = [first]
        while len(group) < self._batch:
            try:
                item = self._queue.get_nowait()
            except Empty:
                return group, False
            if item is None:
                return group, True
            group.append(item)
        return group, False

    def _write_group(self, group: list[Write]) -> None:
        """One transaction for all; if that fails, one for each."""
        if self._commit(group) or len(group) == 1:
            return
        for write in group:
            self._commit([write])

    def _commit(self, group: list[Write]) -> bool:
        """Run a group in one transaction; True if each of it has its answer.

        False means that one of several failed after writing: everything is rolled back and nothing is answered yet.
        """
        try:
            conn, transaction = self._begin()
            with transaction:
                for write in group:
                    _run(write, conn, alone=len(group) == 1)
                _filled(group)
        except _GroupError:
            return False
        except BaseException as error:  # the thread must outlive whatever a function raises
            return _blame(group, error)
        finally:
            _filled(group)
        return True

    def _begin(self) -> tuple[Connection, RootTransaction]:
        """A transaction on the thread's own connection; on a new one if the server has closed that meanwhile."""
        try:
            conn = self._connection()
            return conn, conn.begin()
        except DBAPIError as error:
            if not error.connection_invalidated:
                raise
        self._leave()
        conn = self._connection()
        return conn, conn.begin()

    def _connection(self) -> Connection:
        """The thread's own connection, kept: taking one from the pool costs a tenth of a write."""
        if self._conn is None:
            self._conn = self._engine.connect()
        return self._conn

    def _leave(self) -> None:
        """Close the connection; the next write opens another."""
        if self._conn is not None:
            self._conn.close()
            self._conn = None


class _GroupError(Exception):
    """A function of a group failed after it may have written."""


def _run(write: Write, conn: Connection, *, alone: bool) -> None:
    """Run one function of a transaction.

    A problem raised before anything was written is its answer; the others of the group are not touched by it.
    """
    write.result = write.error = None
    before = _changes(conn)
    try:
        write.result = write.run(conn)
    except BaseException as error:
        if isinstance(error, Problem) and before is not None and _changes(conn) == before:
            write.error = error
            return
        if alone:
            raise
        raise _GroupError from error


def _filled(group: list[Write]) -> None:
    """Tell whoever stands still for a write of the group to go on."""
    for write in group:
        if write.filled is not None:
            write.filled()
            write.filled = None


def _changes(conn: Connection) -> int | None:
    """How many rows this connection has ever changed, where the driver counts them."""
    changes: int | None = getattr(conn.connection.dbapi_connection, "total_changes", None)
    return changes


def _blame(group: list[Write], error: BaseException) -> bool:
    """Answer a group whose transaction failed; False if its members are to be tried alone."""
    if len(group) > 1 and not _began_or_ended_badly(error):
        return False
    answer = error
    if is_out_of_reach(error):
        answer = unavailable("The database cannot take this write now.")
        answer.__cause__ = error
    for write in group:
        write.error = answer
    return True


def _began_or_ended_badly(error: BaseException) -> bool:
    """Whether the transaction itself failed: another process held the lock for too long, or the disk is full.

    Trying its writes one by one would only wait as often. SQLAlchemy names no statement for opening and committing.
    """
    return is_out_of_reach(error) and (getattr(error, "statement", None) or "BEGIN").startswith("BEGIN")


def _answer(group: list[Write]) -> None:
    """Wake whoever waits: threads at once, each event loop once for all its writes."""
    loops: dict[asyncio.AbstractEventLoop, list[Write]] = {}
    for write in group:
        if write.loop is None:
            write.resolve()
        else:
            loops.setdefault(write.loop, []).append(write)
    for loop, writes in loops.items():
        with suppress(RuntimeError):  # a loop that was closed has nobody left who waits
            loop.call_soon_threadsafe(_resolve, writes)


def _resolve(writes: list[Write]) -> None:
    for write in writes:
        write.resolve()
