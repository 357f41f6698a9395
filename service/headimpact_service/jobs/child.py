"""The child process in which a job computes: `python -m headimpact_service.jobs.child HANDLE`.

It is given a task, sends what the task yields, and ends. It ends at once when its parent does, however that died; it
yields the processor to requests; it may hold a bounded amount of memory. Files of strangers are read here, not in the
process that serves.
"""

from __future__ import annotations

import importlib
import os
import resource
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import Any

from headimpact_service import memory
from headimpact_service.errors import Problem

NICE = 5
"""Requests of the parent come first."""
Task = Callable[[dict[str, Any]], Iterator[Any]]


def main(handle: int) -> None:
    """Serve one task to the parent at the other end of the handle."""
    memory.give_back()
    conn = Connection(handle)
    task, arguments, most = conn.recv()
    os.nice(NICE)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    threading.Thread(target=_end_with_parent, args=(conn,), daemon=True).start()
    conn.send(_last_word(conn, task, arguments))


def _last_word(conn: Connection, task: str, arguments: dict[str, Any]) -> tuple[str, Any]:
    """Say that work begins, send everything that the task yields; how it ended."""
    try:
        loaded = _load(task)
        memory.spare_the_collector()
        memory.let_go_of_code()
        conn.send(("begins", None))
        for value in loaded(arguments):
            conn.send(("value", value))
    except Problem as problem:
        return "problem", problem
    except MemoryError:
        return "problem", Problem("import-too-large", "The file takes more memory than a job may have.")
    except Exception:  # whatever it is, the parent logs it and the job ends
        return "fault", traceback.format_exc()
    return "end", None


def _load(task: str) -> Task:
    module, _, name = task.partition(":")
    loaded: Task = getattr(importlib.import_module(module), name)
    return loaded


def _end_with_parent(conn: Connection) -> None:
    """The parent sends nothing more: what can be read here is that it is gone, or has closed its end."""
    conn.poll(None)
    os._exit(1)


if __name__ == "__main__":
    main(int(sys.argv[1]))
