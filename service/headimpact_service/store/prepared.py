"""Statements of the hot path: written in SQLAlchemy like every other, compiled once, run with the driver's parameters.

`Connection.execute` looks a statement up in its compile cache and builds a fresh execution for it each time; for a row
that is written a hundred times a second that is twice the cost of the write itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

from sqlalchemy import Connection, CursorResult, Select
from sqlalchemy.engine import Dialect
from sqlalchemy.sql.dml import Insert

_Convert = Callable[[Any], Any]


class _Plan(NamedTuple):
    """What a statement is for one dialect; a converter of None leaves the value as it is."""

    sql: str
    parameters: tuple[tuple[str, _Convert | None], ...]
    positional: bool
    defaults: dict[str, Any]
    results: tuple[tuple[int, _Convert], ...]


class Prepared:
    """A statement with named parameters, compiled once for each dialect."""

    def __init__(self, statement: Select[Any] | Insert, columns: Iterable[str] | None = None) -> None:
        """`columns` are those that an insert fills."""
        self._statement = statement
        self._columns = None if columns is None else list(columns)
        self._plans: WeakKeyDictionary[Dialect, _Plan] = WeakKeyDictionary()

    def execute(self, conn: Connection, values: Mapping[str, Any]) -> CursorResult[Any]:
        """Run it. Of a query, the rows hold what the driver gave."""
        plan = self._plan(conn.dialect)
        if plan.defaults:
            values = plan.defaults | dict(values)
        if plan.positional:
            ordered = [values[name] if bind is None else bind(values[name]) for name, bind in plan.parameters]
            return conn.exec_driver_sql(plan.sql, tuple(ordered))
        named = {name: values[name] if bind is None else bind(values[name]) for name, bind in plan.parameters}
        return conn.exec_driver_sql(plan.sql, named)

    def first(self, conn: Connection, values: Mapping[str, Any]) -> list[Any] | None:
        """The first row of a query with each value as its column's type has it, or None."""
        row = self.execute(conn, values).first()
        return None if row is None else self._read(row, self._plan(conn.dialect))

    def _read(self, row: Iterable[Any], plan: _Plan) -> list[Any]:
        read = list(row)
        for at, result in plan.results:
            read[at] = result(read[at])
        return read

    def _plan(self, dialect: Dialect) -> _Plan:
        plan = self._plans.get(dialect)
        if plan is None:
            plan = self._plans[dialect] = self._compile(dialect)
        return plan

    def _compile(self, dialect: Dialect) -> _Plan:
        compiled = self._statement.compile(dialect=dialect, column_keys=self._columns)
        types = {name: parameter.type.dialect_impl(dialect) for parameter, name in compiled.bind_names.items()}
        names = compiled.positiontup if compiled.positional else list(types)
        given = {name: value for name, value in compiled.params.items() if value is not None}
        return _Plan(
            sql=str(compiled),
            parameters=tuple((name, types[name].bind_processor(dialect)) for name in names or ()),
            positional=compiled.positional,
            defaults=given,
            results=self._results(dialect),
        )

    def _results(self, dialect: Dialect) -> tuple[tuple[int, _Convert], ...]:
        """The converters of a query's columns that need one."""
        if not isinstance(self._statement, Select):
            return ()
        types = [column.type.dialect_impl(dialect) for column in self._statement.selected_columns]
        converters = [kind.result_processor(dialect, None) for kind in types]
        return tuple((at, convert) for at, convert in enumerate(converters) if convert is not None)
