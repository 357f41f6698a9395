"""Many impacts of one data set, stored in one transaction at a fraction of the cost of one after the other.

What touches nothing that is stored is written together. What may be there already, by its name or by its content, goes
the way of a single impact, and so does what occurs twice among the impacts themselves.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from sqlalchemy import BindParameter, Connection, Select, bindparam, func, select

from headimpact_service.errors import Problem
from headimpact_service.store import athletes as athlete_store
from headimpact_service.store import devices as device_store
from headimpact_service.store import impacts as impact_store
from headimpact_service.store.clock import next_change
from headimpact_service.store.columns import MICROSECOND
from headimpact_service.store.impact_inserts import first_row, insert_rows
from headimpact_service.store.impact_rows import NewImpact, external_id_digest, former_content, former_input
from headimpact_service.store.many import ASKED_AT_ONCE, in_parts
from headimpact_service.store.tables import athletes, devices, former_contents, impacts

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Added:
    """What became of one impact of many."""

    status: Literal["created", "corrected", "unchanged"]
    id: bytes
    external_id: str | None


_DATA_SET_PARAMETER: BindParameter[bytes] = bindparam("data_set_id")
_ASKED: BindParameter[Any] = bindparam("asked", expanding=True)
_NAMES, _CONTENTS, _FORMER = (
    select(digest).where(digest.table.c.data_set_id == _DATA_SET_PARAMETER, digest.in_(_ASKED)).limit(bindparam("most"))
    for digest in (impacts.c.external_id_digest, impacts.c.input_digest, former_contents.c.digest)
)
_ATHLETES = select(athletes.c.external_id, func.coalesce(athletes.c.merged_into, athletes.c.id)).where(
    athletes.c.data_set_id == _DATA_SET_PARAMETER, athletes.c.external_id.in_(_ASKED)
)
_CHANGED_DEVICES = select(devices.c.serial).where(
    devices.c.data_set_id == _DATA_SET_PARAMETER, devices.c.serial.in_(_ASKED), devices.c.revision > 1
)
_DEVICES = select(devices.c.serial, devices.c.id).where(
    devices.c.data_set_id == _DATA_SET_PARAMETER, devices.c.serial.in_(_ASKED)
)


def add_many(conn: Connection, data_set_id: bytes, news: Sequence[NewImpact]) -> list[Added | Problem]:
    """Store impacts as `impacts.add` does for an import; a refusal stands in its place."""
    alone = _perhaps_known(conn, data_set_id, news)
    together = [new for index, new in enumerate(news) if index not in alone]
    added = _insert_new(conn, data_set_id, together)
    return [_add(conn, data_set_id, new) if index in alone else next(added) for index, new in enumerate(news)]


def _add(conn: Connection, data_set_id: bytes, new: NewImpact) -> Added | Problem:
    """One by itself. A refusal comes before anything of it is written, so the others stay."""
    try:
        outcome = impact_store.add(conn, data_set_id, new, same_event_is_unchanged=True)
    except Problem as problem:
        return problem
    return Added(outcome.status, outcome.impact.id, outcome.impact.external_id)


def _perhaps_known(conn: Connection, data_set_id: bytes, news: Sequence[NewImpact]) -> set[int]:
    """The places of those that share a name or a content with what is or was stored, or with another of them.

    An athlete that is given by our id may be none of ours, which is for one impact to say.
    """
    names = [external_id_digest(data_set_id, new.external_id) for new in news]
    contents = [new.input_digest for new in news]
    known_names = _known(conn, data_set_id, _NAMES, names)
    known_contents = _known(conn, data_set_id, _CONTENTS, contents)
    deliveries = [former_content(data_set_id, new.content_digest) for new in news]
    former = _known(conn, data_set_id, _FORMER, deliveries)
    inputs = [former_input(data_set_id, new.input_digest) for new in news]
    deleted = _known(conn, data_set_id, _FORMER, inputs)
    remounted = _remounted(conn, data_set_id, news)
    return {
        index
        for index, new in enumerate(news)
        if new.athlete_id is not None
        or names[index] in known_names
        or contents[index] in known_contents
        or deliveries[index] in former
        or inputs[index] in deleted
        or (new.mounted_by_device and new.device_serial in remounted)
    }


def _remounted(conn: Connection, data_set_id: bytes, news: Sequence[NewImpact]) -> set[str | None]:
    """The devices that say where their sensor sits and whose page was changed since it was made."""
    serials = dict.fromkeys(new.device_serial for new in news if new.mounted_by_device)
    found: set[str | None] = set()
    for part in in_parts(serials):
        asked = {"data_set_id": data_set_id, "asked": part}
        found.update(conn.execute(_CHANGED_DEVICES, asked).scalars())
    return found


def _known(conn: Connection, data_set_id: bytes, query: Select[Any], digests: Sequence[bytes | None]) -> set[bytes]:
    """Those of the digests that are stored, and those that occur twice."""
    counted = Counter(digest for digest in digests if digest is not None)
    known = {digest for digest, times in counted.items() if times > 1}
    most = 2 * ASKED_AT_ONCE  # of a content that is stored many times a few rows are as good as all
    for asked in in_parts(counted):
        found = conn.execute(query, {"data_set_id": data_set_id, "asked": asked, "most": most}).scalars().all()
        known.update(found if len(found) < most else asked)
    return known


def _insert_new(conn: Connection, data_set_id: bytes, news: Sequence[NewImpact]) -> Iterator[Added]:
    """Write impacts of which nothing is known."""
    if not news:
        return iter(())
    athlete_ids = _ids(conn, data_set_id, _ATHLETES, (new.athlete_external_id for new in news), athlete_store.ensure)
    device_ids = _ids(conn, data_set_id, _DEVICES, (new.device_serial for new in news), device_store.ensure)
    first = next_change(conn, impacts, data_set_id)
    rows = []
    for number, new in enumerate(news):
        athlete_id, device_id = athlete_ids.get(new.athlete_external_id), device_ids.get(new.device_serial)
        rows.append((new, first_row(data_set_id, new, athlete_id, device_id, first + number * MICROSECOND)))
    insert_rows(conn, rows)
    return iter([Added("created", row["id"], new.external_id) for new, row in rows])


def _ids(
    conn: Connection,
    data_set_id: bytes,
    query: Select[Any],
    names: Iterable[str | None],
    ensure: Callable[[Connection, bytes, str], bytes],
) -> dict[str | None, bytes]:
    """The ids behind names, made where they are new."""
    asked = list(dict.fromkeys(name for name in names if name is not None))
    found: dict[str | None, bytes] = {}
    for part in in_parts(asked):
        rows = conn.execute(query, {"data_set_id": data_set_id, "asked": part})
        found.update((name, known) for name, known in rows)
    return {name: found.get(name) or ensure(conn, data_set_id, name) for name in asked}
