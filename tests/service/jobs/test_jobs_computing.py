"""Child processes: what they yield arrives, and none outlives whoever wanted it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from headimpact_service.errors import Problem
from headimpact_service.jobs.computing import ChildDiedError, ChildFaultError, computing

HERE = str(Path(__file__).parent)
MEMORY = 2 * 1024**3


@pytest.fixture(autouse=True)
def _findable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", HERE)


def nothing() -> None:
    pass


def compute(task: str, check: Callable[[], None] = nothing, memory: int = MEMORY, **arguments: Any) -> list[Any]:
    with computing(f"job_kinds:{task}", arguments, memory=memory, check=check) as values:
        return list(values)


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()


def test_what_the_task_yields_arrives_in_order() -> None:
    assert compute("count", n=5) == [0, 1, 2, 3, 4]


def test_it_is_said_when_the_work_begins() -> None:
    said: list[str] = []
    with computing(
        "job_kinds:count", {"n": 1}, memory=MEMORY, check=nothing, begins=lambda: said.append("so")
    ) as values:
        assert (list(values), said) == ([0], ["so"])
    with pytest.raises(ChildFaultError), computing("job_kinds:none", {}, memory=MEMORY, check=nothing) as values:
        next(values)


def test_a_problem_in_the_child_is_the_same_problem_here() -> None:
    with pytest.raises(Problem) as raised:
        compute("refuse")
    assert (raised.value.slug, raised.value.detail) == ("unreadable-file", "The file is not one.")


def test_a_fault_in_the_child_comes_with_its_traceback() -> None:
    with pytest.raises(ChildFaultError, match="ValueError: very special"):
        compute("fail", text="very special")


def test_a_child_that_is_killed_has_died() -> None:
    with pytest.raises(ChildDiedError):
        compute("die")


def test_a_child_that_takes_too_much_memory_is_a_problem() -> None:
    with pytest.raises(Problem) as raised:
        compute("grow", memory=512 * 1024**2, n=1024**3)
    assert raised.value.slug == "import-too-large"


def test_whoever_stops_waiting_ends_the_child() -> None:
    seen: list[int] = []

    def check() -> None:
        raise InterruptedError

    with pytest.raises(InterruptedError), computing("job_kinds:stay", {}, memory=MEMORY, check=check) as values:
        seen.extend(values)
    # The wait for the first value may have been given up already: then there is no id to look for.
    assert not any(is_alive(pid) for pid in seen)


def test_a_child_ends_with_its_parent_however_that_died() -> None:
    code = (
        "from headimpact_service.jobs.computing import computing\n"
        f"with computing('job_kinds:stay', {{}}, memory={MEMORY}, check=lambda: None) as values:\n"
        "    print(next(values), flush=True)\n"
        "    next(values)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        assert is_alive(child)
        parent.send_signal(signal.SIGKILL)
    # Its end of the pipe is closed by the system; it needs no time that counts.
    for _ in range(1000):
        if not is_alive(child):
            return
        os.sched_yield()
        subprocess.run(["true"], check=True)
    raise AssertionError("the child is still there")
