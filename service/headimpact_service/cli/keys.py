"""Keys by the command line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, cast

from headimpact_service.cli.database import migrated
from headimpact_service.deps import SCOPES
from headimpact_service.store import ids, keys, organisations
from headimpact_service.store.database import Database

EVERY = "all"


def create(organisation: str, scopes: Sequence[str], *, mode: str, name: str, database_url: str | None) -> None:
    """Make a key and print it as the last line."""
    wanted = _scopes(scopes)
    with migrated(database_url) as database:
        made, plaintext = database.write(
            lambda conn: keys.create_key(conn, organisation, wanted, cast("Literal['live', 'test']", mode), name)
        )
    print(f"Key {ids.encode('key', made.id)} of {made.organisation_name} ({mode}); it is shown this once:")
    print(plaintext)


def _scopes(given: Sequence[str]) -> tuple[str, ...]:
    if EVERY in given:
        return SCOPES
    unknown = [scope for scope in given if scope not in SCOPES]
    if unknown:
        raise ValueError(f"Scopes are {', '.join(SCOPES)}, or {EVERY} for all of them.")
    return tuple(given)


def show(organisation: str, *, database_url: str | None) -> None:
    """Print an organisation's keys; ids are never shortened, since `keys revoke` takes them whole."""
    with migrated(database_url) as database:
        organisation_id = _organisation(database, organisation)
        with database.read() as conn:
            found = keys.list_keys(conn, organisation_id)
    for key in found:
        scopes = EVERY if key.scopes == set(SCOPES) else " ".join(sorted(key.scopes))
        state = "valid" if key.revoked_at is None else f"revoked {key.revoked_at:%Y-%m-%d %H:%M}"
        print(f"{ids.encode('key', key.id)}  {key.shown}…  {key.mode}  {state}  {key.name}")
        print(f"    made {key.created_at:%Y-%m-%d %H:%M}, scopes: {scopes}")


def revoke(organisation: str, key_id: str, *, database_url: str | None) -> None:
    """Make a key invalid."""
    raw = ids.decode("key", key_id)
    if raw is None:
        raise ValueError("A key's id has the form that `headimpact keys list` shows: key_ and 26 characters.")
    with migrated(database_url) as database:
        organisation_id = _organisation(database, organisation)
        database.write(lambda conn: keys.revoke_key(conn, organisation_id, raw))
    print(f"Key {key_id} is revoked; a running service refuses it within five seconds.")


def _organisation(database: Database, name: str) -> bytes:
    with database.read() as conn:
        found = organisations.find(conn, name)
    if found is None:
        raise ValueError("There is no organisation of that name.")
    return found.id
