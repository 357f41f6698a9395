"""The process that parses hostile formats: what it may do, how it ends, and what the service makes of that."""

from __future__ import annotations

import io
import logging
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from binary_files import mat, nested, noise, npz, parquet, wide, xlsx
from ingest_files import read, refused

from headimpact_service.errors import Problem
from headimpact_service.ingest import guard
from headimpact_service.ingest.guarded import wire, worker
from headimpact_service.ingest.guarded.contents import Lines, NamedTable
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.source import Source
from headimpact_service.ingest.upload import read_upload

SHEET = [["t_ms", "ax_g", "ay_g", "az_g"], *([float(i), 1.0, 2.0, float(i)] for i in range(9))]
FILES = {
    "parquet": parquet(nested(noise())),
    "npz": npz(linear_acceleration=noise()[..., :3], linear_acceleration_unit="g", sample_rate_hz=1000.0),
    "mat": mat({"impacts": noise(2, 100)}),
    "xlsx": xlsx({"a": SHEET}),
}


def told(name: str) -> list[Any]:
    options = {"preset": "stanford_mat"} if name == "mat" else {}
    return read(FILES[name], **options)


@pytest.fixture
def cold() -> Iterator[None]:
    """No process is kept from before, nor for what comes after."""
    guard.close()
    yield
    guard.close()


def children() -> set[int]:
    listed = Path(f"/proc/self/task/{threading.get_native_id()}/children")
    every = [path.read_text() for path in Path("/proc/self/task").glob("*/children")] if listed.exists() else []
    return {int(child) for text in every for child in text.split()}


@pytest.mark.usefixtures("cold")
def test_one_process_is_kept_for_the_format_that_was_read_last():
    before = children()
    told("parquet")
    [kept] = children() - before
    told("parquet")
    refused(FILES["parquet"][:50])
    assert children() - before == {kept}
    told("npz")
    [other] = children() - before
    assert other != kept
    guard.close()
    assert children() == before


@pytest.mark.usefixtures("cold")
def test_a_process_is_replaced_after_some_files(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(guard, "MAX_FILES", 3)
    before = children()
    seen = []
    for _ in range(4):
        told("npz")
        seen.append(frozenset(children() - before))
    assert len(seen[0]) == 1
    assert seen[0] == seen[1]
    assert seen[2] == frozenset()
    assert seen[3] != seen[0]


@pytest.mark.usefixtures("cold")
def test_a_reader_who_leaves_in_the_midst_leaves_nothing_behind():
    before = children()
    items = read_upload(parquet(wide(noise(900))), ImportOptions())
    next(items)
    items.close()
    assert children() == before
    assert len(told("parquet")) == 3


@pytest.mark.usefixtures("cold")
def test_files_are_read_at_the_same_time_and_each_gets_its_own():
    results: dict[str, int] = {}

    def run(name: str) -> None:
        results[name] = len(told(name))

    threads = [threading.Thread(target=run, args=(name,)) for name in FILES]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == {"parquet": 3, "npz": 3, "mat": 2, "xlsx": 1}


def test_a_file_that_waits_too_long_for_its_turn_is_told_to_come_again(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(guard, "TURN_S", 0.01)
    items = [read_upload(parquet(wide(noise(900))), ImportOptions()) for _ in range(guard.AT_ONCE)]
    for item in items:
        next(item)
    problem = refused(FILES["npz"])
    assert (problem.slug, problem.status) == ("unavailable", 503)
    assert "Retry-After" in problem.headers
    for item in items:
        item.close()
    assert len(told("npz")) == 3


@pytest.mark.parametrize("library", ["pyarrow", "python_calamine"])
@pytest.mark.usefixtures("cold")
def test_an_absent_library_is_a_415_that_names_the_extra(library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = tmp_path / library
    folder.mkdir()
    (folder / "__init__.py").write_text(f"raise ModuleNotFoundError('no', name={library!r})\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    name = {"pyarrow": "parquet", "python_calamine": "xlsx"}[library]
    problem = refused(FILES[name])
    assert (problem.slug, problem.status) == ("unsupported-media-type", 415)
    assert "headimpact[files]" in problem.detail
    assert library in problem.detail
    assert len(told("npz")) == 3


@pytest.mark.usefixtures("cold")
def test_the_process_gets_nothing_of_the_service_but_paths(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HEADIMPACT_DATABASE_URL", "postgresql://user:secret@host/db")
    before = children()
    told("npz")
    [child] = children() - before
    environment = Path(f"/proc/{child}/environ").read_bytes()
    assert b"secret" not in environment
    assert b"HEADIMPACT" not in environment
    descriptors = {str(path.readlink()) for path in Path(f"/proc/{child}/fd").iterdir()}
    assert len([target for target in descriptors if target.startswith("socket:")]) == 1
    assert all(target.startswith(("socket:", "/dev/null", "/proc/")) for target in descriptors)


@pytest.mark.usefixtures("cold")
def test_the_service_loads_no_library_that_parses():
    code = (
        "import sys; from headimpact_service import app; from headimpact_service.ingest.upload import read_upload\n"
        "from headimpact_service.ingest.options import ImportOptions\n"
        "items = list(read_upload(sys.stdin.buffer.read(), ImportOptions()))\n"
        "print(len(items), sorted({'pyarrow', 'python_calamine', 'scipy.io'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], input=FILES["parquet"], capture_output=True, check=True)
    assert done.stdout.decode().strip() == "3 []"


DOORS = """
import os, resource, sys
from headimpact_service.ingest.guarded import limits
memory = limits.Memory()
limits.close_doors()
memory.before_file(1000)
held = os.dup(0)  # stands for the file that is handed over
tried = []
for way in (lambda: open(sys.argv[1]), lambda: os.open(sys.argv[1], os.O_RDONLY), lambda: os.dup(0), lambda: os.pipe()):
    try:
        way()
    except OSError as error:
        tried.append(error.strerror)
print(tried)
os.close(held)
try:
    with open(sys.argv[2], "w") as file:
        file.write("x")
except OSError as error:
    print(error.strerror)
try:
    bytearray(200 * 1024 * 1024)
except MemoryError:
    print("no memory")
sys.stdout.flush()
while True:
    pass
"""


def test_the_doors_are_closed_before_a_byte_of_a_file_is_read(tmp_path: Path):
    secret = tmp_path / "secret"
    secret.write_text("planted")
    arguments = [sys.executable, "-c", "import signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n" + DOORS]
    done = subprocess.run([*arguments, str(secret), str(tmp_path / "w")], capture_output=True, text=True, timeout=60)
    closed, written, memory = done.stdout.splitlines()
    assert closed == str(["Too many open files"] * 4)
    assert written == "File too large"
    assert memory == "no memory"
    assert done.returncode < 0  # ended by the limit of processor time


class Answers:
    """A service's side that is played by the test: frames in, frames out, in one process."""

    def __init__(self) -> None:
        self.ours, self.theirs = socket.socketpair()

    def __enter__(self) -> Answers:
        return self

    def __exit__(self, *_: object) -> None:
        self.ours.close()
        self.theirs.close()

    def frames(self) -> list[wire.Frame]:
        self.theirs.close()
        found = []
        while True:
            try:
                found.append(wire.receive(self.ours, wire.Deadline(5.0)))
            except wire.WireError:
                return found


def failing(error: BaseException) -> worker.Reader:
    def reader(_: Any) -> Iterator[Any]:
        yield Lines([b"{}\n"])
        raise error

    return reader


@pytest.mark.parametrize(
    ("error", "kind", "stays"),
    [
        (ValueError("words of a library, with a path /etc/passwd"), "broken", True),
        (RecursionError(), "broken", False),
        (MemoryError(), "exhausted", False),
        (Problem("unreadable-file", "ours"), "refused", True),
    ],
)
def test_whatever_a_library_raises_becomes_a_frame_without_its_words(error: BaseException, kind: str, stays: bool):
    with Answers() as answers:
        assert worker.answer(answers.theirs, failing(error), io.BytesIO()) is stays
        frames = answers.frames()
    assert [frame.kind for frame in frames] == ["lines", "piece", "lines_end", kind]
    assert "passwd" not in str(frames)


@pytest.mark.parametrize("name", FILES)
def test_the_readers_give_the_same_inside_the_service_s_process(name: str):
    """The readers are plain functions: what crosses the wall is what they give."""
    module = __import__(
        f"headimpact_service.ingest.guarded.{worker.FORMATS[guard._PROCESSES.get(name, name)]}", fromlist=["contents"]
    )
    module.warm_up()
    [content] = module.contents(io.BytesIO(FILES[name]))
    assert isinstance(content, NamedTable)
    numbers = [place for place, heading in enumerate(content.table.headings) if heading != "external_id"][:3]
    with guard.guarded(name, Source(FILES[name])) as contents:
        for table in contents:
            assert isinstance(table, guard.GuardedTable)
            assert (table.headings, table.units) == (content.table.headings, content.table.units)
            [remote], [local] = list(table.blocks(numbers, [])), list(content.table.blocks(numbers, []))
            assert (remote.rows, remote.lengths) == (local.rows, local.lengths)
            for place in numbers:
                np.testing.assert_array_equal(remote.numbers[place], local.numbers[place])


def answered(*frames: wire.Frame | bytes) -> Iterator[guard.GuardedTable | guard.GuardedLines]:
    """What the service makes of frames that a worker taken over by a file could send."""
    ours, theirs = socket.socketpair()
    for frame in frames:
        theirs.sendall(frame) if isinstance(frame, bytes) else wire.send(theirs, frame)
    theirs.shutdown(socket.SHUT_WR)

    class Held:
        connection = ours
        kind = "npz"

    try:
        yield from guard.Reading("npz", Held(), 0).contents()  # type: ignore[arg-type]  # a stand-in
    finally:
        ours.close()
        theirs.close()


TABLE = wire.Frame(
    "table",
    {
        "name": None,
        "headings": ["a"],
        "units": {},
        "dated": [],
        "wordless": [],
        "above": [],
        "beside": [],
        "parted": True,
        "sampled": "1",
    },
)


@pytest.mark.parametrize(
    "frame",
    [
        wire.Frame("block", {"rows": 3, "lengths": [3], "joined": False, "words": []}, [np.zeros(2)]),
        wire.Frame("block", {"rows": 3, "lengths": [4], "joined": False, "words": []}, [np.zeros(3)]),
        wire.Frame(
            "block", {"rows": 3, "lengths": [3], "joined": False, "words": [["x"]]}, [np.zeros(3), np.ones(1, "<i4")]
        ),
        wire.Frame(
            "block", {"rows": 3, "lengths": [3], "joined": False, "words": [["x"]]}, [np.zeros(3), -np.ones(1, "<i4")]
        ),
        wire.Frame("block", {"rows": "three", "lengths": [3], "joined": False, "words": []}, [np.zeros(3)]),
        wire.Frame("block", {"rows": 3, "lengths": [4, -1], "words": []}, [np.zeros(3)]),
        wire.Frame("block", {}, []),
        b"\xff" * 8,
        b"\x01\0\0\0\0\0\0\0{",
        b"\x02\0\0\0\0\0\0\0{}",
        b"",
    ],
)
def test_a_frame_that_is_not_what_was_asked_for_ends_the_reading(frame: wire.Frame | bytes):
    texts = [1] if isinstance(frame, wire.Frame) and frame.fields.get("words") else []
    for table in answered(TABLE, frame):
        assert isinstance(table, guard.GuardedTable)
        with pytest.raises(
            wire.WireError, match="malformed|too-large|closed" if isinstance(frame, bytes) else "malformed"
        ):
            list(table.blocks([0], texts))
        break


@pytest.mark.parametrize(
    "frame",
    [
        wire.Frame("table", {"name": None, "headings": ["a"]}),
        wire.Frame(
            "table",
            {
                "name": None,
                "headings": 7,
                "units": {},
                "dated": [],
                "wordless": [],
                "above": [],
                "beside": [],
                "parted": True,
                "sampled": "1",
            },
        ),
        wire.Frame(
            "table",
            {
                "name": None,
                "headings": [],
                "units": {"x": "g"},
                "dated": [],
                "wordless": [],
                "above": [],
                "beside": [],
                "parted": True,
                "sampled": "",
            },
        ),
        wire.Frame("refused", {"slug": "no-such-problem", "detail": "x"}),
        wire.Frame("refused", {}),
    ],
)
def test_an_announcement_that_is_not_of_the_agreed_form_ends_the_reading(frame: wire.Frame):
    rest = wire.Frame("rest", {"stays": True})
    with pytest.raises(wire.WireError, match="malformed"):
        list(answered(frame, rest))


def test_a_worker_that_does_not_answer_is_waited_for_no_longer_than_its_time():
    ours, theirs = socket.socketpair()
    with ours, theirs:
        deadline = wire.Deadline(0.05)
        for _ in range(2):
            with pytest.raises(wire.WireError):
                wire.receive(ours, deadline)


@pytest.mark.usefixtures("cold")
def test_a_worker_that_is_killed_is_a_problem_of_its_file_only(caplog: pytest.LogCaptureFixture):
    before = children()
    told("parquet")
    [child] = children() - before
    items = read_upload(parquet(wide(noise(3000))), ImportOptions())
    next(items)
    os.kill(child, 9)
    with caplog.at_level(logging.WARNING), pytest.raises(Problem) as raised:
        list(items)
    assert raised.value.slug == "import-too-large"
    assert [record.message for record in caplog.records] == ["file_exceeded_limits"]
    assert len(told("parquet")) == 3


@pytest.mark.usefixtures("cold")
def test_a_process_that_cannot_start_is_a_fault_of_the_service(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(guard, "_MODULE", "headimpact_service.ingest.nowhere")
    with pytest.raises(RuntimeError, match="did not start"):
        read(FILES["npz"])
