"""What was acknowledged is there after the process was killed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from random import Random

import pytest

from headimpact_service.store import impacts
from headimpact_service.store.database import Database

SCRIPT = Path(__file__).with_name("writing_process.py")


def kill_after(url: str, data_set: bytes, name: str, acknowledged: int) -> dict[str, bytes]:
    """Run a writing process, kill it after so many answers, return every answer that it gave."""
    command = [sys.executable, str(SCRIPT), url, data_set.hex(), name, "4"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        lines = [process.stdout.readline() for _ in range(acknowledged)]
        process.kill()
        lines += process.stdout.readlines()
    complete = [line.split() for line in lines if line.endswith("\n")]
    return {external_id: bytes.fromhex(impact_id) for external_id, impact_id in complete}


def assert_all_stored(url: str, data_set: bytes, answered: dict[str, bytes]) -> None:
    database = Database(url)
    with database.read() as conn:
        for external_id, impact_id in answered.items():
            assert impacts.get(conn, data_set, impact_id).external_id == external_id
            assert impacts.trace(conn, data_set, impact_id).signals == external_id.encode() * 100
        if database.is_file:
            assert conn.exec_driver_sql("PRAGMA integrity_check").scalar() == "ok"
            assert conn.exec_driver_sql("PRAGMA foreign_key_check").first() is None
    database.close()


def test_every_acknowledged_impact_survives_a_kill(database: Database, database_url: str, data_set: bytes) -> None:
    database.close()
    answered = kill_after(database_url, data_set, "a", 120)
    assert len(answered) >= 120
    assert_all_stored(database_url, data_set, answered)


@pytest.mark.campaign
def test_every_acknowledged_impact_survives_a_hundred_kills(
    database: Database, database_url: str, data_set: bytes
) -> None:
    """Prints how many kills and answers, for docs/campaigns.md."""
    database.close()
    random = Random(1)
    answered: dict[str, bytes] = {}
    for kill in range(100):
        answered |= kill_after(database_url, data_set, f"k{kill}", random.randint(1, 900))
    assert_all_stored(database_url, data_set, answered)
    print(f"100 kills, {len(answered)} acknowledged impacts, none lost")
