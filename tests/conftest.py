"""Fixtures of every test that talks to the service: a real database made by the migrations, and a client."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from anyio.from_thread import BlockingPortal, start_blocking_portal
from sending import Api

from headimpact_service.app import create_app
from headimpact_service.deps import SCOPES
from headimpact_service.settings import Settings
from headimpact_service.store import keys
from headimpact_service.store.database import Database


def pytest_make_parametrize_id(val: object) -> str | None:
    """Name files in memory by their length: archives hold the time, so their bytes differ from process to process."""
    return f"{len(val)} bytes" if isinstance(val, bytes) and len(val) > 16 else None


@pytest.fixture(scope="session")
def portal() -> Iterator[BlockingPortal]:
    """An event loop in a thread of its own."""
    with start_blocking_portal() as portal:
        yield portal


@pytest.fixture(scope="session")
def migrated_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database that the migrations made, to be copied."""
    file = tmp_path_factory.mktemp("migrated") / "headimpact.db"
    database = Database(f"sqlite:///{file}")
    database.migrate()
    database.checkpoint()
    database.close()
    return file


@pytest.fixture
def database(migrated_file: Path, tmp_path: Path) -> Iterator[Database]:
    """A database of the test's own."""
    file = tmp_path / "headimpact.db"
    shutil.copy(migrated_file, file)
    database = Database(f"sqlite:///{file}")
    yield database
    database.close()


@pytest.fixture
def make_key(database: Database) -> Callable[..., str]:
    """Makes keys: of an organisation, with scopes, live or test."""

    def make(*scopes: str, organisation: str = "default", mode: str = "live") -> str:
        wanted = scopes or SCOPES
        return database.write(lambda conn: keys.create_key(conn, organisation, wanted, mode))[1]  # type: ignore[arg-type]

    return make


@pytest.fixture
def settings() -> Settings:
    """What the application under test is configured with; a test class may override it."""
    return Settings()


@pytest.fixture
def api(portal: BlockingPortal, database: Database, settings: Settings, make_key: Callable[..., str]) -> Api:
    """The application on the test's database, called with a key of every scope."""
    return Api(portal, create_app(settings, database), make_key())
