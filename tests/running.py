"""`headimpact serve` as a process of its own, on a free port of the loopback."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import httpx
from sqlalchemy import NullPool, create_engine, text

from headimpact_service.store.database import Database

START_S = 60.0


class Service:
    """A running service in a folder; what it printed is in `lines`."""

    def __init__(self, folder: Path, environment: Mapping[str, str] | None = None) -> None:
        """Start it and wait until it listens."""
        self.lines: list[str] = []
        command = [sys.executable, "-m", "headimpact_service", "serve", "--port", "0"]
        self.log = (folder / "log.jsonl").open("ab")
        self.process = subprocess.Popen(
            command,
            cwd=folder,
            env={**os.environ, **(environment or {})},
            stdout=subprocess.PIPE,
            stderr=self.log,
            text=True,
        )
        self.listening = threading.Event()
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()
        if not self.listening.wait(START_S):
            self.kill()
            raise TimeoutError("".join(self.lines))

    def _read(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as output:
            for line in output:
                self.lines.append(line)
                if line.startswith("Listening on"):
                    self.listening.set()

    @property
    def printed(self) -> str:
        """Everything on standard output so far."""
        return "".join(self.lines)

    @property
    def address(self) -> str:
        """Where it listens."""
        found = re.search(r"Listening on (\S+)", self.printed)
        assert found
        return found[1]

    @property
    def port(self) -> int:
        """The port it listens on."""
        return int(self.address.rpartition(":")[2])

    @property
    def key(self) -> str:
        """The first key, which only the first start on a database prints."""
        return next(line.strip() for line in self.lines if line.startswith("him_live_"))

    def client(self, key: str) -> httpx.Client:
        """A client with a key."""
        return httpx.Client(base_url=self.address, headers={"Authorization": f"Bearer {key}"}, timeout=30)

    def stop(self) -> int:
        """SIGTERM, and the exit code."""
        self.process.send_signal(signal.SIGTERM)
        return self._ended()

    def kill(self) -> int:
        """SIGKILL, and the exit code."""
        self.process.kill()
        return self._ended()

    def _ended(self) -> int:
        code = self.process.wait(START_S)
        self.reader.join(START_S)
        self.log.close()
        return code


def on(url: str, folder: Path) -> dict[str, str]:
    """The environment of a service on this database, its uploads in this folder."""
    return {"HEADIMPACT_DATABASE_URL": url, "HEADIMPACT_UPLOAD_FOLDER": str(folder / "uploads")}


def rows(url: str, query: str) -> list[tuple[Any, ...]]:
    """What a query finds, read beside the service."""
    engine = create_engine(Database(url).url, poolclass=NullPool)
    with engine.connect() as conn:
        return [tuple(row) for row in conn.execute(text(query))]


def until(condition: threading.Event, seconds: float = START_S) -> None:
    """Wait for an event, not for the clock."""
    assert condition.wait(seconds), "waited too long"


def elapsed_since(start: float) -> float:
    """Seconds since a reading of the monotonic clock."""
    return time.monotonic() - start
