"""A house for jobs, on a database of the test's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from headimpact_service.jobs.runs import House
from headimpact_service.store import jobs, keys
from headimpact_service.store.database import Database
from headimpact_service.store.jobs import Job, NewJob
from headimpact_service.store.uploads import Uploads


@pytest.fixture
def house(database: Database, tmp_path: Path) -> House:
    return House(database, Uploads(tmp_path / "uploads"), 2 * 1024**3)


@pytest.fixture
def data_set(database: Database) -> bytes:
    return database.write(lambda conn: keys.create_key(conn, "Club", ["all"]))[0].data_set_id


@pytest.fixture
def job(database: Database, data_set: bytes) -> Job:
    return database.write(lambda conn: jobs.submit(conn, data_set, NewJob(kind="count", arguments={})))
