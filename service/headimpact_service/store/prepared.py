"""Statements of the hot path: written in SQLAlchemy like every other, compiled once, run by the driver itself.

`Connection.execute` looks a statement up in its compile cache, builds an execution for it and a result around the
driver's cursor each time; for a row that is written a hundred times a second that is several times the cost of the
write itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from operator import itemgetter
from typing import Any
from weakref import WeakKeyDictionary

from sqlalchemy import Connection, LargeBinary, Select
from sqlalchemy.engine import Dialect
from sqlalchemy.exc import DBAPIError
from sqlalchemy.sql.dml import Insert

_Convert = Callable[[Any], Any]


@dataclass(slots=True)
class _Plan:
    """What a statement is for one dialect: its text, its parameters in order, and what converts some of them."""

    sql: str
    names: tuple[str, ...]
    ordered: Callable[[Mapping[str, Any]], tuple[Any, ...]]
    binds: tuple[tuple[int, _Convert], ...]
    positional: bool
    defaults: dict[str, Any]
    results: tuple[tuple[int, _Convert], ...] | None = None
    """What converts some columns of a row; known with the first, as it depends on what the driver calls their types."""

    def parameters(self, values: Mapping[str, Any]) -> list[Any] | dict[str, Any]:
        """The values as the driver takes them."""
        if self.defaults:
            values = self.defaults | dict(values)
        row = list(self.ordered(values))
        for at, bind in self.binds:
            row[at] = bind(row[at])
        return row if self.positional else dict(zip(self.names, row, strict=True))


class Prepared:
    """A statement with named parameters, compiled once for each dialect; it runs in the connection's transaction."""

    def __init__(self, statement: Select[Any] | Insert, columns: Iterable[str] | None = None) -> None:
        """`columns` are those that an insert fills."""
        self._statement = statement
        self._columns = None if columns is None else list(columns)
        self._plans: WeakKeyDictionary[Dialect, _Plan] = WeakKeyDictionary()

    def run(self, conn: Connection, values: Mapping[str, Any]) -> None:
        """Run an insert."""
        self._execute(conn, self._plan(conn.dialect), values).close()

    def run_many(self, conn: Connection, rows: Iterable[Mapping[str, Any]]) -> None:
        """Run an insert for every row."""
        plan = self._plan(conn.dialect)
        parameters = [plan.parameters(values) for values in rows]
        self._call(conn, plan, lambda cursor: cursor.executemany(plan.sql, parameters)).close()

    def first(self, conn: Connection, values: Mapping[str, Any]) -> list[Any] | None:
        """The first row of a query with each value as its column's type has it, or None."""
        plan = self._plan(conn.dialect)
        cursor = self._execute(conn, plan, values)
        if plan.results is None:
            plan.results = self._results(conn.dialect, [column[1] for column in cursor.description])
        row = cursor.fetchone()
        cursor.close()
        if row is None:
            return None
        read = list(row)
        for at, result in plan.results:
            read[at] = result(read[at])
        return read

    def _execute(self, conn: Connection, plan: _Plan, values: Mapping[str, Any]) -> Any:  # noqa: ANN401 - a driver's cursor
        parameters = plan.parameters(values)
        return self._call(conn, plan, lambda cursor: cursor.execute(plan.sql, parameters))

    def _call(self, conn: Connection, plan: _Plan, run: Callable[[Any], Any]) -> Any:  # noqa: ANN401 - a driver's cursor
        if not conn.in_transaction():
            conn.begin()
        cursor = conn.connection.cursor()
        driver = conn.dialect.loaded_dbapi
        try:
            run(cursor)
        except driver.Error as error:  # as SQLAlchemy raises it, so that nobody need know who ran the statement
            cursor.close()
            raise DBAPIError.instance(
                plan.sql, None, error, driver.Error, hide_parameters=True, dialect=conn.dialect
            ) from error
        return cursor

    def _plan(self, dialect: Dialect) -> _Plan:
        plan = self._plans.get(dialect)
        if plan is None:
            plan = self._plans[dialect] = self._compile(dialect)
        return plan

    def _compile(self, dialect: Dialect) -> _Plan:
        compiled = self._statement.compile(dialect=dialect, column_keys=self._columns)
        types = {name: parameter.type.dialect_impl(dialect) for parameter, name in compiled.bind_names.items()}
        names = tuple(compiled.positiontup or ()) if compiled.positional else tuple(types)
        binds = [
            None if isinstance(types[name], LargeBinary) else types[name].bind_processor(dialect) for name in names
        ]
        return _Plan(
            sql=str(compiled),
            names=names,
            ordered=_ordered(names),
            binds=tuple((at, bind) for at, bind in enumerate(binds) if bind is not None),
            positional=compiled.positional,
            defaults={name: value for name, value in compiled.params.items() if value is not None},
        )

    def _results(self, dialect: Dialect, codes: list[Any]) -> tuple[tuple[int, _Convert], ...]:
        """The converters of a query's columns that need one."""
        assert isinstance(self._statement, Select)
        types = [column.type.dialect_impl(dialect) for column in self._statement.selected_columns]
        converters = [kind.result_processor(dialect, code) for kind, code in zip(types, codes, strict=True)]
        return tuple((at, convert) for at, convert in enumerate(converters) if convert is not None)


def _ordered(names: tuple[str, ...]) -> Callable[[Mapping[str, Any]], tuple[Any, ...]]:
    """The values of these names, in their order."""
    if len(names) == 1:
        (only,) = names
        return lambda values: (values[only],)
    return itemgetter(*names)
