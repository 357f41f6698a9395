"""API keys: shown once, kept as a digest, revoked and never deleted."""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from hashlib import sha256
from typing import Any

from sqlalchemy import Connection, and_, bindparam, insert, select, update

from headimpact_service.errors import not_found
from headimpact_service.store import ids
from headimpact_service.store.organisations import Mode, clean_name, ensure, ensure_data_set
from headimpact_service.store.prepared import Prepared
from headimpact_service.store.tables import api_keys, data_sets, model_aliases, organisations

RANDOM_BYTES = 32
"""43 characters of URL-safe base64."""
_SHOWN_CHARACTERS = 14


@dataclass(frozen=True, slots=True)
class KeyRow:
    """A key without its secret, and what its bearer may use: one query gives all that a request needs."""

    id: bytes
    organisation_id: bytes
    organisation_name: str
    data_set_id: bytes
    mode: Mode
    name: str
    shown: str
    scopes: frozenset[str]
    created_at: datetime
    expires_at: datetime | None
    revoked_at: datetime | None
    incidence: float | None
    operating_points: tuple[dict[str, object], ...]
    settings_revision: int
    model: str | None
    """The version of the data set's active model; None as long as nobody has chosen one."""

    def is_valid(self, now: datetime) -> bool:
        """Whether it is neither revoked nor expired."""
        return self.revoked_at is None and (self.expires_at is None or now < self.expires_at)


_NAMES = [field.name for field in fields(KeyRow)]
_KEY = (
    select(
        api_keys.c.id,
        organisations.c.id.label("organisation_id"),
        organisations.c.name.label("organisation_name"),
        data_sets.c.id.label("data_set_id"),
        data_sets.c.mode,
        api_keys.c.name,
        api_keys.c.shown,
        api_keys.c.scopes,
        api_keys.c.created_at,
        api_keys.c.expires_at,
        api_keys.c.revoked_at,
        organisations.c.incidence,
        organisations.c.operating_points,
        organisations.c.settings_revision,
        model_aliases.c.version.label("model"),
    )
    .join(data_sets, data_sets.c.id == api_keys.c.data_set_id)
    .join(organisations, organisations.c.id == data_sets.c.organisation_id)
    .outerjoin(
        model_aliases,
        and_(
            model_aliases.c.data_set_id == data_sets.c.id,
            model_aliases.c.name == "active",
            model_aliases.c.superseded_at.is_(None),
        ),
    )
)
_BY_DIGEST = Prepared(_KEY.where(api_keys.c.sha256 == bindparam("digest")))
_BY_ID = _KEY.where(api_keys.c.id == bindparam("key_id"), data_sets.c.organisation_id == bindparam("organisation_id"))
_OF_ORGANISATION = _KEY.where(data_sets.c.organisation_id == bindparam("organisation_id")).order_by(
    api_keys.c.id.desc()
)


def digest(plaintext: str) -> bytes:
    """What is stored of a key. A fast hash is enough: the key itself is 256 random bits."""
    return sha256(plaintext.encode(errors="replace")).digest()


def create_key(
    conn: Connection,
    organisation_name: str,
    scopes: Iterable[str],
    mode: Mode = "live",
    name: str = "key",
    *,
    expires_at: datetime | None = None,
) -> tuple[KeyRow, str]:
    """A new key of an organisation (made or reused by name) and its plaintext, which is nowhere afterwards."""
    organisation = ensure(conn, organisation_name)
    plaintext = f"him_{mode}_{secrets.token_urlsafe(RANDOM_BYTES)}"
    key_id = ids.new()
    row = {
        "id": key_id,
        "data_set_id": ensure_data_set(conn, organisation.id, mode),
        "name": clean_name(name, "name"),
        "sha256": digest(plaintext),
        "shown": plaintext[:_SHOWN_CHARACTERS],
        "scopes": sorted(set(scopes)),
        "created_at": datetime.now(UTC),
        "expires_at": expires_at,
    }
    conn.execute(insert(api_keys), row)
    return _get(conn, organisation.id, key_id), plaintext


def find_key(conn: Connection, key: str | bytes) -> KeyRow | None:
    """The valid key of a plaintext or its digest; None if it is unknown, revoked or expired."""
    row = _BY_DIGEST.first(conn, {"digest": key if isinstance(key, bytes) else digest(key)})
    if row is None:
        return None
    found = _key(row)
    return found if found.is_valid(datetime.now(UTC)) else None


def get_key(conn: Connection, organisation_id: bytes, key_id: bytes) -> KeyRow | None:
    """A key of an organisation, revoked ones too."""
    row = conn.execute(_BY_ID, {"key_id": key_id, "organisation_id": organisation_id}).first()
    return None if row is None else _key(row)


def list_keys(conn: Connection, organisation_id: bytes) -> list[KeyRow]:
    """All keys of an organisation, newest first, revoked ones too."""
    return [_key(row) for row in conn.execute(_OF_ORGANISATION, {"organisation_id": organisation_id})]


def revoke_key(conn: Connection, organisation_id: bytes, key_id: bytes) -> KeyRow:
    """Make a key invalid from now on; a `not-found` problem for none of the organisation's. Twice is as once."""
    found = _get(conn, organisation_id, key_id)
    if found.revoked_at is None:
        conn.execute(update(api_keys).where(api_keys.c.id == key_id).values(revoked_at=datetime.now(UTC)))
    return _get(conn, organisation_id, key_id)


def _get(conn: Connection, organisation_id: bytes, key_id: bytes) -> KeyRow:
    found = get_key(conn, organisation_id, key_id)
    if found is None:
        raise not_found("key")
    return found


def _key(row: Sequence[Any]) -> KeyRow:
    values = dict(zip(_NAMES, row, strict=True))
    values["scopes"] = frozenset(values["scopes"])
    values["operating_points"] = tuple(values["operating_points"])
    return KeyRow(**values)
