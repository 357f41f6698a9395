"""Aliases of model versions: `active` scores new impacts, `candidate` may. What each meant before is kept."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Literal, get_args

from sqlalchemy import Connection, bindparam, insert, select, update

from headimpact_service.store.revision import require_revision
from headimpact_service.store.tables import model_aliases

AliasName = Literal["active", "candidate"]
ALIASES: tuple[AliasName, ...] = get_args(AliasName)


@dataclass(frozen=True, slots=True, kw_only=True)
class Alias:
    """What an alias means, since when and why; revision 0 is what it means before anybody said anything."""

    name: AliasName
    version: str | None
    revision: int
    reason: str
    key_id: bytes | None
    created_at: datetime | None
    superseded_at: datetime | None = None


_COLUMNS = [column for column in model_aliases.c if column.name != "data_set_id"]
_HISTORY = (
    select(*_COLUMNS)
    .where(model_aliases.c.data_set_id == bindparam("data_set_id"), model_aliases.c.name == bindparam("name"))
    .order_by(model_aliases.c.revision)
)
_SUPERSEDE = update(model_aliases).where(
    model_aliases.c.data_set_id == bindparam("of_data_set"),
    model_aliases.c.name == bindparam("alias"),
    model_aliases.c.superseded_at.is_(None),
)


def history(conn: Connection, data_set_id: bytes, name: AliasName) -> list[Alias]:
    """All that an alias meant, oldest first: no version as long as nobody said anything."""
    rows = conn.execute(_HISTORY, {"data_set_id": data_set_id, "name": name})
    said = [Alias(**row._asdict()) for row in rows]
    until = said[0].created_at if said else None
    unsaid = Alias(name=name, version=None, revision=0, reason="", key_id=None, created_at=None, superseded_at=until)
    return [unsaid, *said]


def get(conn: Connection, data_set_id: bytes, name: AliasName) -> Alias:
    """What an alias means now."""
    return history(conn, data_set_id, name)[-1]


def put(
    conn: Connection,
    data_set_id: bytes,
    name: AliasName,
    version: str | None,
    reason: str,
    key_id: bytes | None = None,
    *,
    if_match: int | None = None,
) -> Alias:
    """Let an alias mean a version; the caller has made sure that there is one."""
    present = get(conn, data_set_id, name)
    require_revision(present.revision, if_match)
    if present.version == version and present.revision > 0:
        return present
    now = datetime.now(UTC)
    conn.execute(_SUPERSEDE, {"of_data_set": data_set_id, "alias": name, "superseded_at": now})
    made = Alias(
        name=name, version=version, revision=present.revision + 1, reason=reason, key_id=key_id, created_at=now
    )
    conn.execute(insert(model_aliases), asdict(made) | {"data_set_id": data_set_id})
    return made
