"""Slots: one process each, free once it is dead."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from headimpact_service.jobs import slots
from headimpact_service.jobs.slots import Slot, SlotsTakenError

HOLD = "import sys; from headimpact_service.jobs.slots import Slot; from pathlib import Path; s = Slot(Path(sys.argv[1])); print(s.number, flush=True); sys.stdin.read()"  # noqa: E501


def test_processes_hold_different_slots_and_a_dead_one_s_is_free(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline().strip() == "0"
        with Slot(tmp_path) as mine:
            assert (mine.name, mine.is_free("slot-0"), mine.is_alone()) == ("slot-1", False, False)
            other.kill()
            other.wait()
            assert (mine.is_free("slot-0"), mine.is_alone()) == (True, True)
    with Slot(tmp_path) as next_one:
        assert next_one.name == "slot-0"


def test_one_s_own_slot_and_a_name_of_no_slot_are_not_free(tmp_path: Path) -> None:
    with Slot(tmp_path) as mine:
        assert not mine.is_free(mine.name)
        assert not mine.is_free("local")


def test_there_are_so_many_slots_and_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slots, "SLOTS", 1)
    with Slot(tmp_path), pytest.raises(SlotsTakenError, match="1 process"):
        Slot(tmp_path)
