"""Fixtures of every test that talks to the service: a real database made by the migrations, and a client."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import postgres
import pytest
from anyio.from_thread import BlockingPortal, start_blocking_portal
from sending import Api

from headimpact_service.app import create_app
from headimpact_service.deps import SCOPES
from headimpact_service.settings import Settings
from headimpact_service.store import keys
from headimpact_service.store.database import Database

BACKENDS = ("sqlite", "postgresql")


ON_EACH = {"store", "jobs", "routes", "contract"}
"""The folders whose tests are about what is stored and answered; reading files is the same whatever it is stored in."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run what needs a database on each kind, unless the marker `backend` names those that it is about."""
    if "backend" in metafunc.fixturenames:
        marker = metafunc.definition.get_closest_marker("backend")
        usual = BACKENDS if metafunc.definition.path.parent.name in ON_EACH else BACKENDS[:1]
        metafunc.parametrize("backend", usual if marker is None else marker.args, scope="module")


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


@pytest.fixture(scope="session")
def postgresql_server() -> Iterator[postgres.Server]:
    """A PostgreSQL server; started for the first test that needs it."""
    with postgres.server() as server:
        yield server


@pytest.fixture
def database_url(
    backend: str, tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[str]:
    """The URL of a database of the test's own, at this version's schema."""
    monkeypatch.setenv("HEADIMPACT_UPLOAD_FOLDER", str(tmp_path / "uploads"))  # a server has no folder beside it
    if backend == "postgresql":
        server: postgres.Server = request.getfixturevalue("postgresql_server")
        with server.emptied() as url:
            yield url
        return
    file = tmp_path / "headimpact.db"
    shutil.copy(request.getfixturevalue("migrated_file"), file)
    yield f"sqlite:///{file}"


@pytest.fixture
def empty_url(backend: str, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[str]:
    """The URL of a database without tables."""
    if backend == "postgresql":
        server: postgres.Server = request.getfixturevalue("postgresql_server")
        url = server.create()
        yield url
        server.drop(url)
        return
    yield f"sqlite:///{tmp_path / 'headimpact.db'}"


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    """A database of the test's own."""
    database = Database(database_url)
    yield database
    database.close()


@pytest.fixture
def make_key(database: Database) -> Callable[..., str]:
    """Makes keys: of an organisation, with scopes, live or test."""

    def make(*scopes: str, organisation: str = "default", mode: str = "live") -> str:
        wanted = scopes or SCOPES
        return database.write(lambda conn: keys.create_key(conn, organisation, wanted, mode))[1]  # type: ignore[arg-type]  # scopes and mode are words

    return make


@pytest.fixture
def settings() -> Settings:
    """What the application under test is configured with; a test class may override it."""
    return Settings()


@pytest.fixture
def api(portal: BlockingPortal, database: Database, settings: Settings, make_key: Callable[..., str]) -> Api:
    """The application on the test's database, called with a key of every scope."""
    return Api(portal, create_app(settings, database), make_key())
