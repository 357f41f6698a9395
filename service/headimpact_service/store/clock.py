"""The instants of changes: strictly increasing within a data set's table, whatever the computer's clock does."""

from __future__ import annotations

from datetime import UTC, datetime

from sqlalchemy import Connection, Table, bindparam, func, select
from sqlalchemy.sql.selectable import ScalarSelect

from headimpact_service.store import tables
from headimpact_service.store.columns import MICROSECOND


def last_change(table: Table) -> ScalarSelect[datetime]:
    """The newest `updated_at` of the data set `:data_set_id` in a table, as a subquery."""
    newest = func.max(table.c.updated_at, type_=table.c.updated_at.type)
    return select(newest).where(table.c.data_set_id == bindparam("data_set_id")).scalar_subquery()


def later_than(last: datetime | None) -> datetime:
    """Now, or one microsecond after the last change if the clock has not passed it."""
    now = datetime.now(UTC)
    return now if last is None or now > last else last + MICROSECOND


_LAST_CHANGE = {table.name: select(last_change(table)) for table in (tables.athletes, tables.devices, tables.impacts)}


def next_change(conn: Connection, table: Table, data_set_id: bytes) -> datetime:
    """The instant of the change that this write transaction is making to a table of a data set.

    Writers exclude each other, so the order of these instants is the order of the commits: a reader of
    `updated_since` that has seen one has seen all before it.
    """
    return later_than(conn.execute(_LAST_CHANGE[table.name], {"data_set_id": data_set_id}).scalar())
