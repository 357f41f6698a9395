"""A mapping laid over the headings of one table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from headimpact.recording import AXES, SIGNALS, SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.headings import Headings, layout_problem
from headimpact_service.ingest.impact_rules import missing_axes
from headimpact_service.ingest.layout import Clock, Component, Layout, SignalLayout
from headimpact_service.ingest.mapping import DATES_IN, TIME_UNITS, DateAndTime, Mapping, ReadingField, SignalColumns
from headimpact_service.ingest.no_signal import no_signal
from headimpact_service.ingest.presets import unit_of
from headimpact_service.ingest.scaled_units import SCALED_UNITS, unit_written
from headimpact_service.ingest.spelling import unit_ending, unit_spelled
from headimpact_service.ingest.supplied import Kind, Supplied, supplied_in
from headimpact_service.ingest.table import DURATION


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
        laid = _signal(name, mapping, headings, required)
        if laid is not None:
            signals[name] = laid
    if not signals:
        raise no_signal()
    own = all(signal.clock for signal in signals.values())
    clock, *other_clocks = _clocks(mapping, headings, "time" in required, own=own) or [None]
    return Layout(
        headings=headings.written,
        signals=signals,
        clock=clock,
        other_clocks=tuple(filter(None, other_clocks)),
        keys=_keys(mapping, headings, "group_by" in required),
        external_id=_optional("external_id", mapping.external_id, headings, required),
        athlete=_optional("athlete", mapping.athlete, headings, required),
        device=_optional("device", mapping.device, headings, required),
        occurred_at=_occurred_at(mapping, headings, "occurred_at" in required),
        date_order=mapping.occurred_at.order if isinstance(mapping.occurred_at, DateAndTime) else None,
        context=_context(mapping, headings, required),
        reading=_named("reading", mapping.reading, headings, required),
        unscorable=_optional("unscorable", mapping.unscorable, headings, required),
        time_base=_optional("time_base", mapping.time_base, headings, required),
        sample_number=_optional("sample_number", mapping.sample_number, headings, required),
    )


def _signal(name: SignalName, mapping: Mapping, headings: Headings, required: frozenset[str]) -> SignalLayout | None:
    columns = mapping.columns_of(name)
    if columns is None:
        return None
    components = {axis: _component(getattr(columns, axis), headings) for axis in AXES}
    if name not in required and all(component is None for component in components.values()):
        return None
    given = [axis for axis, component in components.items() if component is not None]
    turned = mapping.location == "sensor" or _is_read("mounting", mapping, headings)
    each_says = bool(given) and _is_read("constrained_plane", mapping, headings)  # held against its plane
    for axis in () if each_says else missing_axes(name, given, mapping.constrained_plane, turned=turned):
        raise _missing(f"The column of {name} {axis} was not found.", f"/{name}/{axis}")
    x, y, z = (components[axis] or Component(None, 1.0) for axis in AXES)
    _require_distinct(name, (x, y, z))
    places = [component.column for component in (x, y, z) if component.column is not None]
    _require_unit_written(name, columns, headings, places)
    said = _unit(name, columns, headings.units_beside(name, places))
    unit, size = SCALED_UNITS.get(said, (said, 1.0))
    return SignalLayout(
        unit=unit,
        components=(_scaled(x, size), _scaled(y, size), _scaled(z, size)),
        clock=_own_clock(name, columns, headings, min(places), required=name in required),
        resultants=_supplied(name, "resultant", columns, said, headings, required),
        peaks=_supplied(name, "peak", columns, said, headings, required),
        sample_rate_hz=columns.sample_rate_hz,
        full_scale=None if columns.range is None else columns.range * size,
    )


def _is_read(field: ReadingField, mapping: Mapping, headings: Headings) -> bool:
    """Whether a column says how each impact is to be read in this respect."""
    spelled = (mapping.reading or {}).get(field)
    return spelled is not None and headings.find(spelled) is not None


def _scaled(component: Component, size: float) -> Component:
    return component if size == 1.0 else Component(component.column, component.factor * size)


def _require_unit_written(name: SignalName, columns: SignalColumns, headings: Headings, places: Sequence[int]) -> None:
    """Refuse a mapping's unit where a heading names another, or one of another quantity."""
    if columns.unit is None:
        return
    for column in places:
        heading = headings.written[column]
        beside = headings.units.get(column)
        if unit_spelled(name, beside) is not None:  # as it does for a signal without a unit
            continue
        worded = unit_of(heading)
        written = {worded} if worded else unit_written(heading) or (unit_written(f"[{beside}]") if beside else None)
        if written is not None and columns.unit not in written:
            raise layout_problem(
                f"The column {heading} of the {name} is said to be in {columns.unit}, and the file says "
                f"{' or '.join(sorted(written))}: name the unit of its numbers, or correct the file.",
                code="units-differ",
                pointer=f"/{name}/unit",
            )


def _require_distinct(name: SignalName, components: Sequence[Component]) -> None:
    """Refuse a column that is said to be two components of one signal."""
    columns = [component.column for component in components if component.column is not None]
    for axis, component in zip(AXES, components, strict=True):
        if component.column is not None and columns.count(component.column) > 1:
            raise layout_problem(
                f"One column is said to be several components of the {name}.",
                code="column-twice",
                pointer=f"/{name}/{axis}",
            )


def _own_clock(
    name: SignalName, columns: SignalColumns, headings: Headings, first: int, *, required: bool
) -> Clock | None:
    """The signal's own column of stamps: the nearest before its samples, where several have its heading."""
    for time in columns.time or ():
        column = headings.nearest(time.column, first)
        if column is not None:
            return _clock_in(column, time.unit, headings)
    if required and columns.time:
        raise _missing(f"The column of the times of {name} was not found.", f"/{name}/time")
    return None


def _supplied(
    name: SignalName, kind: Kind, columns: SignalColumns, unit: str, headings: Headings, required: frozenset[str]
) -> tuple[Supplied, ...]:
    """The column of the device's own resultants or peaks that a mapping names."""
    spellings: list[str] | None = getattr(columns, kind)
    column = None if spellings is None else headings.find(spellings)
    if column is not None:
        return (supplied_in(name, unit, column, headings),)
    if f"{name}.{kind}" in required:
        raise _missing(f"The column of the {kind} of {name} was not found.", f"/{name}/{kind}")
    return ()


def _unit(name: SignalName, columns: SignalColumns, beside: set[str]) -> str:
    """The unit of a signal: as the mapping says or, where it says none, as the file does; they must agree."""
    said = beside if columns.unit is None else {columns.unit} | beside
    if len(said) > 1:
        raise layout_problem(
            f"The columns of the {name} are said to be in {' and in '.join(sorted(said))}.",
            code="units-differ",
            pointer=f"/{name}/unit",
        )
    if not said:
        raise layout_problem(
            f"The unit of the {name} is neither in its headings nor in the preset: give it in a mapping.",
            code="unit-missing",
            pointer=f"/{name}/unit",
        )
    return said.pop()


def _component(spellings: Sequence[str] | None, headings: Headings) -> Component | None:
    """The column of one component; a heading that itself begins with a minus cannot be meant."""
    for spelling in spellings or ():
        turned = spelling.startswith("-")
        column = headings.find([spelling[1:] if turned else spelling])
        if column is not None:
            return Component(column, -1.0 if turned else 1.0)
    return None


def _clocks(mapping: Mapping, headings: Headings, required: bool, *, own: bool) -> list[Clock | None]:
    """The columns of stamps that the signals share, the one that is read first; none where each has its own."""
    if own:
        return []
    named = [(column, time.unit) for time in mapping.time or () if (column := headings.find([time.column])) is not None]
    found = [(column, unit) for column, unit in named if required or column not in headings.lone]
    if required and not found:
        raise _missing("The column of the time was not found.", "/time")
    return [_clock_in(column, unit, headings) for column, unit in dict(found).items()]


def _clock_in(column: int, unit: str, headings: Headings) -> Clock:
    """A column of stamps in a unit, unless the file says another beside its heading; times of a type have their own."""
    if column in headings.dated:
        return Clock(column, TIME_UNITS[DATES_IN], dated=True)
    if headings.units.get(column) == DURATION:
        return Clock(column, TIME_UNITS["us"])
    heading = headings.written[column]
    for beside in (unit_spelled("time", headings.units.get(column)), unit_ending("time", heading)):
        if beside not in {None, unit}:
            raise layout_problem(
                f"The column {heading} of the time is said to be in {unit} and in {beside}.",
                code="units-differ",
                pointer="/time",
            )
    return Clock(column, TIME_UNITS[unit])


def _context(mapping: Mapping, headings: Headings, required: frozenset[str]) -> dict[str, int]:
    session = _optional("session_id", mapping.session_id, headings, required)
    found = _named("context", mapping.context, headings, required)
    return found if session is None else found | {"session_id": session}


def _named(
    name: str, columns: dict[Any, list[str] | None] | None, headings: Headings, required: frozenset[str]
) -> dict[str, int]:
    """The columns of a table of fields, as far as they are there."""
    found: dict[str, int] = {}
    for field, spellings in (columns or {}).items():
        column = None if spellings is None else headings.find(spellings)
        if column is not None:
            found[field] = column
        elif f"{name}.{field}" in required:
            raise _missing(f"The column of {field} was not found.", f"/{name}/{field}")
    return found


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
    found = [headings.find(spellings) for spellings in filter(None, parts)]
    columns = tuple(column for column in found if column is not None)
    if len(columns) == len(found):
        return columns
    if required:
        raise _missing("The column of occurred_at was not found.", "/occurred_at")
    return ()


def _missing(detail: str, pointer: str) -> Problem:
    return layout_problem(detail, code="column-missing", pointer=pointer)
