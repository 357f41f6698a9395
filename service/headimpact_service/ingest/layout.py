"""A mapping laid over the headings of one table: which column is what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from headimpact.recording import AXES, SIGNALS, SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.headings import Headings, layout_problem
from headimpact_service.ingest.impact_rules import required_axes
from headimpact_service.ingest.mapping import TIME_UNITS, DateAndTime, Mapping, SignalColumns


@dataclass(frozen=True, slots=True)
class Component:
    """One component's column and sign; `column` is None for one that a constrained plane leaves out."""

    column: int | None
    sign: float


@dataclass(frozen=True, slots=True)
class SignalLayout:
    """One signal's columns."""

    unit: str
    components: tuple[Component, Component, Component]


@dataclass(frozen=True, slots=True)
class Layout:
    """Every column that is read, by its index."""

    signals: dict[SignalName, SignalLayout]
    time: int | None
    time_factor: float
    keys: tuple[int, ...]
    external_id: int | None
    athlete: int | None
    device: int | None
    session_id: int | None
    occurred_at: tuple[int, ...]

    @property
    def numbers(self) -> list[int]:
        """Columns that are read as numbers."""
        components = [c.column for signal in self.signals.values() for c in signal.components]
        return sorted({column for column in (*components, self.time) if column is not None})

    @property
    def texts(self) -> list[int]:
        """Columns that are read as text."""
        named = (self.external_id, self.athlete, self.device, self.session_id, *self.keys, *self.occurred_at)
        return sorted({column for column in named if column is not None})


def lay_out(mapping: Mapping, headings: Headings, required: frozenset[str]) -> Layout:
    """The columns of a table under a mapping.

    Parameters
    ----------
    mapping
        The mapping.
    headings
        The table's headings.
    required
        Fields of the mapping whose columns must be there; the others (a preset's) are left out where their columns are.

    Raises
    ------
    Problem
        422: a column is missing or named twice, a unit is nowhere given, or no signal is there.
    """
    signals: dict[SignalName, SignalLayout] = {}
    for name in SIGNALS:
        laid = _signal(name, mapping, headings, name in required)
        if laid is not None:
            signals[name] = laid
    if not signals:
        raise layout_problem(
            "The columns of no signal were found: name a preset, or send a mapping from columns to signals.",
            code="layout-unknown",
        )
    time, factor = _time(mapping, headings, "time" in required)
    return Layout(
        signals=signals,
        time=time,
        time_factor=factor,
        keys=_keys(mapping, headings, "group_by" in required),
        external_id=_optional("external_id", mapping.external_id, headings, required),
        athlete=_optional("athlete", mapping.athlete, headings, required),
        device=_optional("device", mapping.device, headings, required),
        session_id=_optional("session_id", mapping.session_id, headings, required),
        occurred_at=_occurred_at(mapping, headings, "occurred_at" in required),
    )


def _signal(name: SignalName, mapping: Mapping, headings: Headings, required: bool) -> SignalLayout | None:
    columns = mapping.columns_of(name)
    if columns is None:
        return None
    components = {axis: _component(getattr(columns, axis), headings) for axis in AXES}
    if not required and all(component is None for component in components.values()):
        return None
    needed = required_axes(name, mapping.constrained_plane)
    for axis in needed:
        if components[axis] is None:
            raise _missing(f"The column of {name} {axis} was not found.", f"/{name}/{axis}")
    x, y, z = (components[axis] or Component(None, 1.0) for axis in AXES)
    return SignalLayout(unit=_unit(name, columns), components=(x, y, z))


def _unit(name: SignalName, columns: SignalColumns) -> str:
    if columns.unit is None:
        raise layout_problem(
            f"The unit of the {name} is neither in its headings nor in the preset: give it in a mapping.",
            code="unit-missing",
            pointer=f"/{name}/unit",
        )
    return columns.unit


def _component(spellings: Sequence[str] | None, headings: Headings) -> Component | None:
    """The column of one component; a heading that itself begins with a minus cannot be meant."""
    for spelling in spellings or ():
        turned = spelling.startswith("-")
        column = headings.find([spelling[1:] if turned else spelling])
        if column is not None:
            return Component(column, -1.0 if turned else 1.0)
    return None


def _time(mapping: Mapping, headings: Headings, required: bool) -> tuple[int | None, float]:
    for time in mapping.time or ():
        column = headings.find([time.column])
        if column is not None:
            return column, TIME_UNITS[time.unit]
    if required:
        raise _missing("The column of the time was not found.", "/time")
    return None, 1.0


def _keys(mapping: Mapping, headings: Headings, required: bool) -> tuple[int, ...]:
    found = [(spellings, headings.find(spellings)) for spellings in mapping.group_by or ()]
    if required and any(column is None for _, column in found):
        raise _missing("A column of group_by was not found.", "/group_by")
    return tuple(column for _, column in found if column is not None)


def _optional(name: str, spellings: Sequence[str] | None, headings: Headings, required: frozenset[str]) -> int | None:
    if spellings is None:
        return None
    column = headings.find(spellings)
    if column is None and name in required:
        raise _missing(f"The column of {name} was not found.", f"/{name}")
    return column


def _occurred_at(mapping: Mapping, headings: Headings, required: bool) -> tuple[int, ...]:
    when = mapping.occurred_at
    if when is None:
        return ()
    parts = [when.date, when.time] if isinstance(when, DateAndTime) else [when]
    found = [headings.find(spellings) for spellings in parts]
    columns = tuple(column for column in found if column is not None)
    if len(columns) == len(parts):
        return columns
    if required:
        raise _missing("The column of occurred_at was not found.", "/occurred_at")
    return ()


def _missing(detail: str, pointer: str) -> Problem:
    return layout_problem(detail, code="column-missing", pointer=pointer)
