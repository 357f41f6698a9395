"""What an operation stands on: the caller that a key names, and the database."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol, TypeVar

from anyio.to_thread import run_sync
from sqlalchemy import Connection
from starlette.applications import Starlette
from starlette.requests import Request

from headimpact_service.errors import Problem
from headimpact_service.intake import registry, scoring
from headimpact_service.intake.scoring import Terms
from headimpact_service.settings import Settings
from headimpact_service.store import ids, jobs, keys
from headimpact_service.store.database import Database
from headimpact_service.store.jobs import Job, NewJob
from headimpact_service.store.uploads import Uploads, job_folder

T = TypeVar("T")

SCOPES = (
    "score",
    "impacts:read",
    "impacts:write",
    "labels:read",
    "labels:write",
    "athletes:read",
    "athletes:write",
    "models:read",
    "models:fit",
    "models:promote",
    "webhooks",
    "events:read",
    "admin",
)
ANY = "*"
"""The access of an operation that any valid key may use."""

REMEMBER_S = 5.0
"""How long a key's lookup is trusted: a key revoked by another process works at most this much longer."""
REMEMBERED = 10_000


@dataclass(frozen=True, slots=True)
class Caller:
    """Whoever a key speaks for."""

    key: keys.KeyRow
    terms: Terms

    @property
    def data_set_id(self) -> bytes:
        """The data set that the key sees: live or test, of one organisation."""
        return self.key.data_set_id


@dataclass(slots=True)
class Gate:
    """Looks keys up, remembers them for a moment, and counts their requests if a rate is configured."""

    database: Database
    rate_limit: int | None = None
    remembered: dict[str, tuple[float, Caller]] = field(default_factory=dict)
    """By the whole header, as it came: what is sent again and again is found without a digest."""
    counts: dict[bytes, int] = field(default_factory=dict)
    minute: int = 0

    async def caller(self, authorization: str | None) -> Caller:
        """The caller of a request with this Authorization header; 401 if there is none."""
        sent = authorization or ""
        until, caller = self.remembered.get(sent, (0.0, None))
        if caller is None or time.monotonic() > until:
            caller = await self.look_up(sent)
        if self.rate_limit is not None:
            self._count(caller.key.id, self.rate_limit)
        return caller

    def forget(self) -> None:
        """Look every key up again: one was revoked, settings changed, or another model is active."""
        self.remembered.clear()

    async def look_up(self, authorization: str) -> Caller:
        """The caller as the database knows it now, whatever is remembered."""
        self.remembered.pop(authorization, None)
        scheme, _, key = authorization.partition(" ")
        if scheme.lower() != "bearer" or not key.strip():
            raise _unauthenticated("The Authorization header must be `Bearer <key>`.")
        caller = await run_sync(self._find, keys.digest(key.strip()))
        if caller is None:
            raise _unauthenticated("The key is unknown, expired or revoked.")
        if len(self.remembered) >= REMEMBERED:
            self.remembered.clear()
        self.remembered[authorization] = (time.monotonic() + REMEMBER_S, caller)
        return caller

    def _find(self, digest: bytes) -> Caller | None:
        with self.database.read() as conn:
            found = keys.find_key(conn, digest)
            return None if found is None else Caller(found, terms_of(conn, found))

    def _count(self, key_id: bytes, rate_limit: int) -> None:
        now = time.time()
        if int(now // 60) != self.minute:
            self.minute = int(now // 60)
            self.counts.clear()
        self.counts[key_id] = self.counts.get(key_id, 0) + 1
        if self.counts[key_id] > rate_limit:
            wait = str(60 - int(now % 60))
            detail = f"This key may make {rate_limit} requests a minute."
            raise Problem("too-many-requests", detail, headers={"Retry-After": wait})


def _unauthenticated(detail: str) -> Problem:
    return Problem("unauthenticated", detail, headers={"WWW-Authenticate": 'Bearer realm="headimpact"'})


def terms_of(conn: Connection, key: keys.KeyRow) -> Terms:
    """What the impacts of the key's data set are scored with."""
    model = registry.DEFAULT if key.model is None else registry.model_of(conn, key.data_set_id, key.model)
    return scoring.terms_of(key.incidence, key.operating_points, model)


async def authorize(request: Request, access: str) -> Caller:
    """The caller; 401 without a valid key, 403 without the scope that `access` names."""
    gate: Gate = request.app.state.gate
    caller = await gate.caller(request.headers.get("authorization"))
    if access != ANY and access not in caller.key.scopes:
        raise scope_missing(access)
    return caller


async def renewed(request: Request) -> Caller:
    """The caller of a request that was authorised, with the organisation's terms as they are stored now."""
    gate: Gate = request.app.state.gate
    return await gate.look_up(request.headers.get("authorization") or "")


def scope_missing(scope: str) -> Problem:
    """The 403 for a key without a scope."""
    return Problem("insufficient-scope", f"This operation needs a key with the scope {scope}.")


class JobEngine(Protocol):
    """What runs jobs; the operations know no more of it than this."""

    def start(self) -> None:
        """Begin, beside the caller."""

    def wake(self) -> None:
        """Look at the jobs now."""

    def stop(self) -> None:
        """Hand back what is under way, and end."""


class NoEngine:
    """Jobs are only written down here; another process runs them."""

    def start(self) -> None:
        """Nothing begins."""

    def wake(self) -> None:
        """The other process looks often enough."""

    def stop(self) -> None:
        """Nothing ends."""


def uploads_of(settings: Settings, database: Database) -> Uploads:
    """Where uploads wait for their job."""
    return Uploads(settings.upload_folder or job_folder(database.url) / "uploads")


def set_up(app: Starlette, settings: Settings, database: Database, engine: JobEngine | None = None) -> None:
    """Give the application what its operations stand on."""
    app.state.settings = settings
    app.state.database = database
    app.state.gate = Gate(database, settings.rate_limit)
    app.state.engine = engine or NoEngine()
    app.state.uploads = uploads_of(settings, database)


async def read(request: Request, query: Callable[[Connection], T]) -> T:
    """The result of a query, run beside the event loop."""
    database: Database = request.app.state.database
    return await run_sync(partial(_read, database, query))


def _read(database: Database, query: Callable[[Connection], T]) -> T:
    with database.read() as conn:
        return query(conn)


async def write(request: Request, change: Callable[[Connection], T]) -> T:
    """The result of a change, once it is committed."""
    database: Database = request.app.state.database
    return await database.write_async(change)


async def write_short(request: Request, change: Callable[[Connection], T]) -> T:
    """The same for a change of a few rows, as it is sent many times a second."""
    database: Database = request.app.state.database
    return await database.write_short(change)


async def submit(request: Request, data_set_id: bytes, new: NewJob) -> Job:
    """Order a job; the job that its idempotency key made before, if there is one."""
    job = await write(request, lambda conn: jobs.submit(conn, data_set_id, new))
    request.app.state.engine.wake()
    return job


def identifier(prefix: str, text: str, what: str) -> bytes:
    """The identifier in a path; 404 if it cannot be one of ours."""
    found = ids.decode(prefix, text)
    if found is None:
        raise Problem("not-found", f"There is no such {what}.")
    return found


def filter_identifier(prefix: str, text: str) -> bytes:
    """The identifier in a filter; one that cannot be ours is nobody's, so the list is empty."""
    return ids.decode(prefix, text) or bytes(ids.LENGTH)
