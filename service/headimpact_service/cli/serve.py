"""`headimpact serve`: one command from an empty folder to a service that answers."""

from __future__ import annotations

import socket
from typing import Any

from headimpact_service import __version__, logs, memory
from headimpact_service.app import create_app
from headimpact_service.cli.database import migrated
from headimpact_service.cli.example import curl
from headimpact_service.deps import SCOPES, uploads_of
from headimpact_service.jobs.engine import engine_of
from headimpact_service.serving import listen
from headimpact_service.serving import run as serve_until_stopped
from headimpact_service.settings import Settings, unknown_variables
from headimpact_service.store import keys, organisations
from headimpact_service.store.database import Database

ORGANISATION = "default"
EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104 - shown, not bound


def run(*, host: str | None, port: int | None, database_url: str | None) -> None:
    """Bind, migrate, make a first key if there is none, serve."""
    settings = _settings(host=host, port=port, database_url=database_url)
    logs.configure(settings.log_level)
    memory.give_back()
    listener = listen(settings)  # before anything is made: a port that is taken leaves nothing behind
    address = _address(listener)
    say(f"Headimpact {__version__}. Research use only: the model rests on adult men, and a score is no diagnosis.")
    with migrated(settings.database_url) as database:
        _first_key(database, address)
        for warning in (*unknown_variables(), *database.warnings(), *uploads_of(settings, database).warnings()):
            say(f"Warning: {warning}")
        app = create_app(settings, database, engine_of(settings, database))
        memory.spare_the_collector()
        serve_until_stopped(app, settings, listener, lambda: say(f"Listening on {address} (documentation: /docs)"))


def say(line: str) -> None:
    """Print at once: whoever waits for a line reads a pipe."""
    print(line, flush=True)


def _settings(**given: Any) -> Settings:  # noqa: ANN401 - each has its own type
    return Settings(**{name: value for name, value in given.items() if value is not None})


def _address(listener: socket.socket) -> str:
    host, port = listener.getsockname()[:2]
    host = EVERYWHERE.get(host, host)
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def _first_key(database: Database, address: str) -> None:
    made = database.write(_key_if_empty)
    if made is None:
        return
    say(f"\nFirst key, of the organisation {ORGANISATION}, with every scope. It is shown this once:\n\n{made}\n")
    say(f"Send a first impact, from any folder:\n\n{curl(address, made)}\n")


def _key_if_empty(conn: Any) -> str | None:  # noqa: ANN401 - a connection of the store
    """Looked at and made in one transaction, so two processes that start at once make one key."""
    if not organisations.is_empty(conn):
        return None
    return keys.create_key(conn, ORGANISATION, SCOPES, name="first")[1]
