"""The service's side of guarded parsing: processes that read hostile formats, kept warm between files.

A file goes in as a descriptor and its tables come out as frames, so the service never holds more than a block of it.
The process has no secrets in its environment, cannot open or write a file, and has little memory and time; whatever a
file does to it, the answer is a :class:`Problem` and the next file gets a new process.
"""

from __future__ import annotations

import atexit
import logging
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import BinaryIO, NoReturn

from headimpact_service.errors import Problem
from headimpact_service.ingest.cells import Words
from headimpact_service.ingest.guarded.wire import Deadline, Frame, WireError, receive, send
from headimpact_service.ingest.source import Source
from headimpact_service.ingest.table import Columns

AT_ONCE = 2
"""Files that are parsed at the same time, each in a process of its own; further ones wait their turn."""
MAX_FILES = 50
"""After so many files a process is replaced."""
KEPT_S = 50.0
"""A process ends itself after a little more without a file."""
TURN_S = 30.0
START_S = 60.0
WAIT_BASE_S = 12.0
WAIT_S_PER_MIB = 3.0
_PROCESSES = {"parquet": "arrow"}
"""Formats that are read by the process of another."""
_MODULE = "headimpact_service.ingest.guarded.worker"
_ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "ARROW_DEFAULT_MEMORY_POOL": "system",  # the others reserve address space that the limit would count
    "MALLOC_ARENA_MAX": "1",
    "PYTHONUTF8": "1",
}
_KEPT = ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "SYSTEMROOT")
_log = logging.getLogger(__name__)


class Worker:
    """One parsing process of one format."""

    def __init__(self, kind: str) -> None:
        """Start it, and wait until it has loaded its libraries; 415 where they are not installed."""
        self.kind = kind
        self.files = 0
        self.connection, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(  # noqa: S603 - our own module under our own interpreter
                [sys.executable, "-P", "-m", _MODULE, kind, str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=_environment(),
                start_new_session=True,
            )
        try:
            self._require_ready()
        except BaseException:
            self.close()
            raise

    def _require_ready(self) -> None:
        try:
            frame = receive(self.connection, Deadline(START_S))
        except WireError as error:
            raise RuntimeError(f"The parsing process did not start ({error}).") from None
        if frame.kind == "absent":
            raise Problem(
                "unsupported-media-type",
                f"This kind of file needs libraries that are not installed here: install headimpact[files] "
                f"({frame.fields['library']} is missing).",
            )

    @property
    def is_alive(self) -> bool:
        """Whether it still waits for files."""
        return self._process.poll() is None

    def hand_over(self, stream: BinaryIO) -> None:
        """Give it a file to read."""
        try:
            socket.send_fds(self.connection, [b"f"], [stream.fileno()])
        except OSError as error:
            raise WireError(type(error).__name__) from None

    def close(self) -> None:
        """End it, whatever it does."""
        self.connection.close()
        self._process.kill()
        self._process.wait()


class GuardedTable:
    """A table that the parsing process reads: see :class:`headimpact_service.ingest.table.Table`."""

    def __init__(self, reading: Reading, fields: Frame) -> None:
        """A table as its headings were announced."""
        self._reading = reading
        self.name: str | None = fields.fields["name"]
        self.headings = tuple(str(heading) for heading in fields.fields["headings"])
        self.units = {int(column): str(unit) for column, unit in fields.fields["units"].items()}
        self.above: Sequence[Sequence[str]] = [list(map(str, row)) for row in fields.fields["above"]]
        self.beside: Sequence[Sequence[str]] = [list(map(str, row)) for row in fields.fields["beside"]]
        self.dated = frozenset(map(int, fields.fields["dated"]))
        self.parted = bool(fields.fields["parted"])
        self.wordless = frozenset(map(int, fields.fields["wordless"]))
        self._sampled = str(fields.fields["sampled"])

    def has_samples(self, place: int) -> bool:
        """Whether a column may hold a number for each sample."""
        return self._sampled[place : place + 1] == "1"

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Columns]:
        """The asked-for columns, block by block."""
        self._reading.want(numbers, texts)
        while (frame := self._reading.next()).kind == "block":
            with _well_formed():
                columns = _columns(frame, numbers, texts)
            yield columns


class GuardedLines:
    """Impacts as lines of JSON."""

    def __init__(self, reading: Reading) -> None:
        """Lines that are about to come."""
        self._reading = reading

    def __iter__(self) -> Iterator[bytes]:
        """Line by line; one that does not end is cut where a reader of lines refuses it."""
        held = bytearray()
        while (frame := self._reading.next()).kind == "piece":
            held += frame.arrays[0].tobytes()
            *whole, rest = held.split(b"\n")
            yield from map(bytes, whole)
            held = rest
        if held:
            yield bytes(held)


class Reading:
    """One file being read by one process."""

    def __init__(self, kind: str, worker: Worker, size: int) -> None:
        """Wait for it no longer than a file of `size` bytes may take."""
        self._kind, self._worker = kind, worker
        self._deadline = Deadline(WAIT_BASE_S + WAIT_S_PER_MIB * size / 1024**2)
        self._offered = False  # a table waits for an answer
        self._open = False  # its blocks are coming
        self.worker_stays = False

    def contents(self) -> Iterator[GuardedTable | GuardedLines]:
        """Every table of the file; one that is not read is passed over."""
        while (frame := self.next()).kind != "end":
            if frame.kind == "lines":
                yield GuardedLines(self)
                continue
            self._offered = True
            with _well_formed():
                table = GuardedTable(self, frame)
            yield table
            if self._offered:
                self._offered = False
                send(self._worker.connection, Frame("skip"))
            while self._open:
                self.next()
        self._rest()

    def stop(self) -> None:
        """Ask for no more where the process waits to be asked, so that it can take another file."""
        if self._offered:
            with suppress(WireError, Problem):
                send(self._worker.connection, Frame("stop"))
                if self.next().kind == "end":
                    self._rest()

    def want(self, numbers: Sequence[int], texts: Sequence[int]) -> None:
        """Ask for columns of the table that was announced last."""
        self._offered, self._open = False, True
        send(self._worker.connection, Frame("read", {"numbers": list(numbers), "texts": list(texts)}))

    def next(self) -> Frame:
        """What comes next; :class:`Problem` where the file is at fault."""
        frame = receive(self._worker.connection, self._deadline)
        if frame.kind in {"table_end", "table_refused"}:
            self._open = False
        if frame.kind == "refused":
            self._rest()
        if frame.kind in {"refused", "table_refused"}:
            with _well_formed():
                problem = Problem(frame.fields["slug"], str(frame.fields["detail"]))
            raise problem
        if frame.kind == "exhausted":
            _refuse_excess()
        if frame.kind == "broken":
            _log.info("file_broken", extra={"format": self._kind, "error": frame.fields["error"]})
            self._rest()
            raise Problem("unreadable-file", f"The {self._kind} file is broken, or not what its beginning says.")
        return frame

    def _rest(self) -> None:
        """The file is done with: whether the process takes another."""
        self.worker_stays = receive(self._worker.connection, self._deadline).fields.get("stays") is True


@contextmanager
def guarded(kind: str, source: Source) -> Iterator[Iterator[GuardedTable | GuardedLines]]:
    """The contents of a file of a hostile format.

    Raises
    ------
    Problem
        413 for a file that takes too much memory or time, 415 where the format's libraries are not installed, 422 for
        one that is broken.
    """
    with _POOL.turn(), _descriptor(source) as stream:
        worker = _POOL.take(_PROCESSES.get(kind, kind))
        reading = Reading(kind, worker, source.size)
        try:
            worker.hand_over(stream)
            yield reading.contents()
        except WireError as error:
            _log.warning("file_exceeded_limits", extra={"format": kind, "error": str(error)})
            _refuse_excess()
        finally:
            reading.stop()
            _POOL.give_back(worker, stays=reading.worker_stays)


@contextmanager
def _well_formed() -> Iterator[None]:
    """A process that a file has taken over may send what it likes: what is not of the agreed form ends it."""
    try:
        yield
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError):
        raise WireError("malformed") from None


def _refuse_excess() -> NoReturn:
    raise Problem(
        "import-too-large",
        "The file takes more memory or time than one file may: split it, or write it in smaller blocks.",
    ) from None


class _Pool:
    """At most one process is kept warm, of the format that was read last."""

    def __init__(self) -> None:
        self._turn = threading.BoundedSemaphore(AT_ONCE)
        self._lock = threading.Lock()
        self._idle: tuple[Worker, float] | None = None

    @contextmanager
    def turn(self) -> Iterator[None]:
        """A place among the files that are parsed at once; 503 where none comes free for long."""
        if not self._turn.acquire(timeout=TURN_S):
            raise Problem("unavailable", "Too many files are being read: try again.", headers={"Retry-After": "10"})
        try:
            yield
        finally:
            self._turn.release()

    def take(self, kind: str) -> Worker:
        """A process for this format: the warm one, or a new one."""
        worker, since = self._taken()
        if worker is not None:
            if worker.kind == kind and worker.is_alive and time.monotonic() - since < KEPT_S:
                return worker
            worker.close()
        return Worker(kind)

    def give_back(self, worker: Worker, *, stays: bool) -> None:
        """Keep a process that waits for another file, for a while and for some files; end any other."""
        worker.files += 1
        if not stays or worker.files >= MAX_FILES:
            worker.close()
            return
        with self._lock:
            before, self._idle = self._idle, (worker, time.monotonic())
        if before is not None:
            before[0].close()

    def close(self) -> None:
        """End the process that is kept."""
        worker, _ = self._taken()
        if worker is not None:
            worker.close()

    def _taken(self) -> tuple[Worker | None, float]:
        with self._lock:
            kept, self._idle = self._idle, None
        return (None, 0.0) if kept is None else kept


_POOL = _Pool()


def close() -> None:
    """End the process that is kept warm; the next file starts another."""
    _POOL.close()


atexit.register(close)


@contextmanager
def _descriptor(source: Source) -> Iterator[BinaryIO]:
    """The file as something that has a descriptor; bytes in memory stay in memory where the system can do that."""
    if not isinstance(source.content, bytes):
        with source.open() as stream:
            yield stream
        return
    with _in_memory() as stream:
        stream.write(source.content)
        stream.seek(0)
        yield stream


def _in_memory() -> BinaryIO:
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("headimpact-upload"), "w+b", buffering=0)
    return tempfile.TemporaryFile(buffering=0)


def _environment() -> dict[str, str]:
    kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
    return {**_ENVIRONMENT, **kept, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


def _columns(frame: Frame, numbers: Sequence[int], texts: Sequence[int]) -> Columns:
    """A block as it was sent, checked against what was asked for."""
    rows, lengths, words = int(frame.fields["rows"]), frame.fields["lengths"], frame.fields["words"]
    cells = rows if lengths is None else len(lengths)
    if lengths is not None and (sum(lengths) != rows or min(lengths, default=0) < 0):
        raise WireError("malformed")
    arrays = list(frame.arrays)
    if [array.size for array in arrays] != [rows] * len(numbers) + [cells] * len(texts):
        raise WireError("malformed")
    places = arrays[len(numbers) :]
    if any(at.size and not 0 <= at.min() <= at.max() < len(known) for at, known in zip(places, words, strict=True)):
        raise WireError("malformed")
    return Columns(
        rows=rows,
        numbers=dict(zip(numbers, arrays, strict=False)),
        texts={
            column: Words(at, list(map(str, known))) for column, at, known in zip(texts, places, words, strict=True)
        },
        lengths=lengths,
        joined=bool(frame.fields["joined"]),
    )
