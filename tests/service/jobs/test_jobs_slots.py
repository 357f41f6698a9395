"""Slots: one process each, free once it is dead."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import psycopg
import pytest
from postgres import plain

from headimpact_service.jobs import slots
from headimpact_service.jobs.slots import slot_of
from headimpact_service.store import server_slots
from headimpact_service.store.database import Database
from headimpact_service.store.slot import Slot, SlotLostError, SlotsTakenError

HOLD = """
import sys
from pathlib import Path
from headimpact_service.jobs.slots import slot_of
from headimpact_service.store.database import Database
slot = slot_of(Database(sys.argv[1]), Path(sys.argv[2]))
print(slot.name, flush=True)
sys.stdin.read()
"""


@pytest.fixture
def take(database: Database, tmp_path: Path) -> Callable[[], Slot]:
    """Takes a slot of the test's database, as another process would."""
    return lambda: slot_of(database, tmp_path / "slots")


def test_processes_hold_different_slots_and_a_dead_one_s_is_free(
    take: Callable[[], Slot], database_url: str, tmp_path: Path
) -> None:
    command = [sys.executable, "-c", HOLD, database_url, str(tmp_path / "slots")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline().strip() == "slot-0"
        with take() as mine:
            assert (mine.name, mine.is_free("slot-0"), mine.is_alone()) == ("slot-1", False, False)
            other.kill()
            other.wait()
            while not mine.is_free("slot-0"):  # a server needs a moment to see it
                pass
            assert mine.is_alone()
    with take() as next_one:
        assert next_one.name == "slot-0"


def test_one_s_own_slot_and_a_name_of_no_slot_are_not_free(take: Callable[[], Slot]) -> None:
    with take() as mine:
        assert not mine.is_free(mine.name)
        assert not mine.is_free("local")
        mine.keep()


def test_there_are_so_many_slots_and_no_more(take: Callable[[], Slot], monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (slots, server_slots):
        monkeypatch.setattr(module, "SLOTS", 1)
    with take(), pytest.raises(SlotsTakenError, match="1 process"):
        take()


@pytest.mark.backend("postgresql")
class TestServer:
    """A lock on a server ends with its connection."""

    def cut(self, database_url: str) -> None:
        with psycopg.connect(plain(database_url), autocommit=True) as conn:
            conn.execute(
                "SELECT pg_terminate_backend(pid, 10000) FROM pg_stat_activity "
                "WHERE application_name = 'headimpact slot' AND datname = current_database()"
            )

    def test_a_lost_connection_is_made_again_under_the_same_name(
        self, take: Callable[[], Slot], database_url: str
    ) -> None:
        with take() as mine:
            self.cut(database_url)
            mine.keep()
            with take() as other:
                assert (mine.name, other.name) == ("slot-0", "slot-1")

    def test_a_slot_that_another_took_meanwhile_is_lost(self, take: Callable[[], Slot], database_url: str) -> None:
        with take() as mine:
            self.cut(database_url)
            with take() as other:
                assert other.name == mine.name
                with pytest.raises(SlotLostError, match="slot-0"):
                    mine.keep()
