"""Impacts whose signals came before: whose duplicates they are, also when the first is corrected or deleted."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import groupby
from typing import Any

from sqlalchemy import BindParameter, Connection, bindparam, select, update

from headimpact_service.store.clock import next_change
from headimpact_service.store.columns import MICROSECOND
from headimpact_service.store.many import in_parts
from headimpact_service.store.tables import impacts

_ASKED: BindParameter[Any] = bindparam("asked", expanding=True)
_DATA_SET: BindParameter[bytes] = bindparam("data_set_id")
_DIGESTS = select(impacts.c.input_digest).where(
    impacts.c.data_set_id == _DATA_SET, impacts.c.id.in_(_ASKED), impacts.c.input_digest.is_not(None)
)
_ALIKE = (
    select(impacts.c.input_digest, impacts.c.id, impacts.c.duplicate_of)
    .where(impacts.c.data_set_id == _DATA_SET, impacts.c.input_digest.in_(_ASKED))
    .order_by(impacts.c.input_digest, impacts.c.id)
)
_RENAME = update(impacts).where(impacts.c.data_set_id == bindparam("of_data_set"), impacts.c.id == bindparam("impact"))


def release(conn: Connection, data_set_id: bytes, going: Collection[bytes]) -> None:
    """What is a duplicate of impacts that are about to lose their signals is one of the next of them, or of none."""
    gone = frozenset(going)
    digests: set[bytes] = set()
    for part in in_parts(gone):
        digests.update(conn.execute(_DIGESTS, {"data_set_id": data_set_id, "asked": part}).scalars())
    renamed: dict[bytes, bytes | None] = {}
    for part in in_parts(digests):
        rows = conn.execute(_ALIKE, {"data_set_id": data_set_id, "asked": part}).all()
        for _, alike in groupby((row for row in rows if row.id not in gone), key=lambda row: row.input_digest):
            renamed |= _renamed([(row.id, row.duplicate_of) for row in alike], gone)
    if renamed:
        first = next_change(conn, impacts, data_set_id)
        changed = [
            {
                "of_data_set": data_set_id,
                "impact": impact,
                "duplicate_of": of,
                "updated_at": first + number * MICROSECOND,
            }
            for number, (impact, of) in enumerate(renamed.items())
        ]
        conn.execute(_RENAME, changed)


def _renamed(alike: Sequence[tuple[bytes, bytes | None]], gone: Collection[bytes]) -> dict[bytes, bytes | None]:
    """Of those with the same signals, in their order, whose duplicates are now the ones whose first is gone."""
    first = alike[0][0]
    return {impact: None if impact == first else first for impact, of in alike if of in gone}
