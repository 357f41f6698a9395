"""The parent's end of a child process that computes."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any

LOOK_AGAIN_S = 0.5
"""How often whoever waits for a child is asked whether they still want to."""
# One core for a job: the libraries' own threads would take what requests need.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class ChildDiedError(RuntimeError):
    """The child ended without a last word: killed, or out of memory."""


class ChildFaultError(RuntimeError):
    """The child failed with an exception of its own; the message is its traceback."""


@contextmanager
def computing(
    task: str,
    arguments: Mapping[str, Any],
    *,
    memory: int,
    check: Callable[[], None],
    begins: Callable[[], None] = lambda: None,
) -> Iterator[Iterator[Any]]:
    """What `task` (`module:function`) yields in a child process, as it comes; the child is ended with the block.

    A started process costs a second, and is then free of this one's lock and memory. `check` is called while
    waiting, and may raise; `begins` once the child has started and is about to work.
    """
    ours, theirs = multiprocessing.Pipe()
    command = [sys.executable, "-m", "headimpact_service.jobs.child", str(theirs.fileno())]
    # A session of its own: who interrupts the service at a terminal does not interrupt a child in the midst of it.
    child = subprocess.Popen(  # noqa: S603 - our own interpreter and module
        command,
        pass_fds=[theirs.fileno()],
        stdin=subprocess.DEVNULL,
        env={**os.environ, **_ONE_THREAD},
        start_new_session=True,
    )
    try:
        theirs.close()
        ours.send((task, dict(arguments), memory))
        yield _values(ours, check, begins)
    finally:
        child.kill()
        child.wait()
        ours.close()


def _values(conn: Connection, check: Callable[[], None], begins: Callable[[], None]) -> Iterator[Any]:
    while True:
        while not conn.poll(LOOK_AGAIN_S):
            check()
        try:
            word, value = conn.recv()
        except (EOFError, ConnectionResetError):
            raise ChildDiedError from None
        if word == "end":
            return
        if word == "begins":
            begins()
            continue
        if word == "problem":
            raise value
        if word == "fault":
            raise ChildFaultError(value)
        yield value
