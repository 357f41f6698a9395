"""A mapping laid over the headings of one table: which column is what."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

from headimpact.recording import AXES, SIGNALS, SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.headings import Headings, layout_problem
from headimpact_service.ingest.impact_rules import missing_axes
from headimpact_service.ingest.mapping import TIME_UNITS, DateAndTime, Mapping, SignalColumns
from headimpact_service.ingest.other_times import NO_OTHERS, OtherTimes, other_times
from headimpact_service.ingest.spelling import unit_ending, unit_spelled
from headimpact_service.ingest.supplied import Kind, Supplied, spoken_in, supplied_in
from headimpact_service.ingest.unread import NOTHING_UNREAD, Unread, unread_columns


@dataclass(frozen=True, slots=True)
class Component:
    """One component's column and sign; `column` is None for one that a constrained plane leaves out."""

    column: int | None
    sign: float


@dataclass(frozen=True, slots=True)
class Clock:
    """A column of stamps; `milliseconds` are those of one unit of them. `dated` ones count from no trigger or start."""

    column: int
    milliseconds: float
    dated: bool = False


@dataclass(frozen=True, slots=True)
class SignalLayout:
    """One signal's columns; `clock` where it has its own."""

    unit: str
    components: tuple[Component, Component, Component]
    clock: Clock | None = None
    resultants: tuple[Supplied, ...] = ()
    peaks: tuple[Supplied, ...] = ()
    sample_rate_hz: float | None = None
    full_scale: float | None = None

    @property
    def is_apart(self) -> bool:
        """Whether it has times or a rate of its own."""
        return self.clock is not None or self.sample_rate_hz is not None

    @property
    def columns(self) -> list[int]:
        """The columns of its components."""
        return [component.column for component in self.components if component.column is not None]

    @property
    def left_out(self) -> list[str]:
        """The components that have no column."""
        return [axis for axis, one in zip(AXES, self.components, strict=True) if one.column is None]


@dataclass(frozen=True, slots=True)
class Layout:
    """Every column that is read, by its index."""

    headings: tuple[str, ...]
    signals: dict[SignalName, SignalLayout]
    clock: Clock | None
    other_clocks: tuple[Clock, ...]
    keys: tuple[int, ...]
    external_id: int | None
    athlete: int | None
    device: int | None
    occurred_at: tuple[int, ...]
    context: dict[str, int]
    reading: dict[str, int]
    unscorable: int | None
    time_base: int | None
    sample_number: int | None
    others: OtherTimes = NO_OTHERS
    """What may say other times than those that are read."""
    unread: Unread = NOTHING_UNREAD
    """What may tell that the rows are several impacts, where nothing that is read would."""

    @property
    def clocks(self) -> list[Clock]:
        """All columns of times that the signals share."""
        return [] if self.clock is None else [self.clock, *self.other_clocks]

    @property
    def labels(self) -> list[int]:
        """Columns of what is true of an impact as a whole, those that tell impacts apart among them.

        When it was is not: its parts may be those of each sample. Nor is how parts of an impact are to be read.
        """
        reading = self.reading.values() if self.time_base is None else ()
        one_each = (self.external_id, self.athlete, self.device, self.unscorable)
        return sorted({c for c in (*one_each, *self.keys, *self.context.values(), *reading) if c is not None})

    def field_of(self, column: int) -> str | None:
        """What a column is read as that a mapping may do without; None for those that tell impacts apart."""
        named = {"external_id": self.external_id, "athlete": self.athlete, "device": self.device}
        named["session_id"] = self.context.get("session_id")
        return next((field for field, place in named.items() if place == column and column not in self.keys), None)

    @property
    def numbers(self) -> list[int]:
        """Columns that are read as numbers."""
        signals = self.signals.values()
        resultants = [one.column for signal in signals for one in signal.resultants]
        counted = [] if self.sample_number is None else [self.sample_number]
        others = [clock.column for clock in self.others.clocks]
        components = (column for signal in signals for column in signal.columns)
        return sorted({*self.stamps, *resultants, *counted, *others, *components})

    @property
    def stamps(self) -> list[int]:
        """Columns of stamps that signals are read by."""
        all_clocks = (*self.clocks, *(signal.clock for signal in self.signals.values()))
        return [clock.column for clock in all_clocks if clock is not None]

    @property
    def texts(self) -> list[int]:
        """Columns that are read as text."""
        one_each = (self.external_id, self.athlete, self.device, self.unscorable, self.time_base)
        named = (*one_each, *self.keys, *self.occurred_at, *self.context.values(), *self.reading.values(), *self.peaks)
        others = [rate.column for rate in self.others.rates]
        return sorted({column for column in (*named, *others, *self.unread.columns) if column is not None})

    @property
    def peaks(self) -> list[int]:
        """Columns of peaks that the device supplies."""
        return [one.column for signal in self.signals.values() for one in signal.peaks]

    @property
    def is_timed(self) -> bool:
        """Whether every signal has stamps that are surely its samples': dates may be the event's."""
        clocks = [signal.clock or self.clock for signal in self.signals.values()]
        return all(clock is not None and not clock.dated for clock in clocks)

    def ends_alone(self, name: SignalName) -> bool:
        """Whether a signal's rows may end before the others': it has times or a rate of its own, or others have."""
        if self.signals[name].is_apart:
            return True
        return self.clock is None and any(signal.is_apart for signal in self.signals.values())

    def beside(self, headings: Headings, has_samples: Callable[[int], bool]) -> Layout:
        """The same, with the columns beside it that may say other times."""
        return replace(self, others=other_times(headings, {*self.numbers, *self.texts}, has_samples))

    def comparing(self, headings: Headings, wordless: Collection[int], *, parted: bool) -> Layout:
        """The same, with the resultants and peaks beside it; where the format parts impacts, peaks are no samples."""
        passed = {*self.numbers, *self.texts}
        unnamed = [name for name, signal in self.signals.items() if not _name_units(name, signal.columns, headings)]
        signals = dict(self.signals)
        units = {name: signal.unit for name, signal in signals.items()}
        for name, kind, found in spoken_in(headings, units, unnamed):
            signal = signals[name]
            if found.column in passed:
                continue
            if kind == "resultant" and (found.column in wordless or not parted):
                signals[name] = replace(signal, resultants=(*signal.resultants, found))
            elif kind == "peak" and found.column not in wordless:
                signals[name] = replace(signal, peaks=(*signal.peaks, found))
        return replace(self, signals=signals)

    def watching(self, wordless: Collection[int]) -> Layout:
        """The same, with the columns beside it that may tell several impacts from one."""
        if self.sample_number is not None:
            return self
        passed = {*self.numbers, *self.texts, *wordless}
        found = unread_columns(self.headings, passed, timed=self.is_timed, keyed=bool(self.keys))
        return replace(self, unread=found)

    def named(self, column: int) -> str:
        """A column as a message names it, by its number and its heading."""
        heading = self.headings[column]
        return f"Column {column + 1} ({heading})" if heading else f"Column {column + 1}"


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
        raise layout_problem(
            "The columns of no signal were found: name a preset, or send a mapping from columns to signals.",
            code="layout-unknown",
        )
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
    turned = mapping.location == "sensor" or "mounting" in (mapping.reading or {})
    for axis in missing_axes(name, given, mapping.constrained_plane, turned=turned):
        raise _missing(f"The column of {name} {axis} was not found.", f"/{name}/{axis}")
    x, y, z = (components[axis] or Component(None, 1.0) for axis in AXES)
    _require_distinct(name, (x, y, z))
    places = [component.column for component in (x, y, z) if component.column is not None]
    unit = _unit(name, columns, _units_beside(name, places, headings))
    return SignalLayout(
        unit=unit,
        components=(x, y, z),
        clock=_own_clock(name, columns, headings, min(places), required=name in required),
        resultants=_supplied(name, "resultant", columns, unit, headings, required),
        peaks=_supplied(name, "peak", columns, unit, headings, required),
        sample_rate_hz=columns.sample_rate_hz,
        full_scale=columns.range,
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


def _units_beside(name: SignalName, columns: Sequence[int], headings: Headings) -> set[str]:
    """The units that stand beside the headings of a signal, as far as they are known."""
    told = (headings.units.get(column) for column in columns)
    return {unit for text in told if (unit := unit_spelled(name, text)) is not None}


def _name_units(name: SignalName, columns: Sequence[int], headings: Headings) -> bool:
    """Whether units stand beside the headings of a signal, or in them."""
    written = (unit_ending(name, headings.written[column]) for column in columns)
    return bool(_units_beside(name, columns, headings)) or any(written)


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
    found = [(column, time.unit) for time in mapping.time or () if (column := headings.find([time.column])) is not None]
    if required and not found:
        raise _missing("The column of the time was not found.", "/time")
    return [_clock_in(column, unit, headings) for column, unit in dict(found).items()]


def _clock_in(column: int, unit: str, headings: Headings) -> Clock:
    """A column of stamps in a unit, unless the file says another beside its heading; dates have a unit of their own."""
    if column in headings.dated:
        return Clock(column, TIME_UNITS["us"], dated=True)
    beside = unit_spelled("time", headings.units.get(column))
    if beside not in {None, unit}:
        raise layout_problem(
            f"The column of the time is said to be in {unit} and in {beside}.", code="units-differ", pointer="/time"
        )
    return Clock(column, TIME_UNITS[unit])


def _context(mapping: Mapping, headings: Headings, required: frozenset[str]) -> dict[str, int]:
    session = _optional("session_id", mapping.session_id, headings, required)
    found = _named("context", mapping.context, headings, required)
    return found if session is None else found | {"session_id": session}


def _named(
    name: str, columns: dict[Any, list[str]] | None, headings: Headings, required: frozenset[str]
) -> dict[str, int]:
    """The columns of a table of fields, as far as they are there."""
    found: dict[str, int] = {}
    for field, spellings in (columns or {}).items():
        column = headings.find(spellings)
        if column is not None:
            found[field] = column
        elif name in required:
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
    found = [headings.find(spellings) for spellings in parts]
    columns = tuple(column for column in found if column is not None)
    if len(columns) == len(parts):
        return columns
    if required:
        raise _missing("The column of occurred_at was not found.", "/occurred_at")
    return ()


def _missing(detail: str, pointer: str) -> Problem:
    return layout_problem(detail, code="column-missing", pointer=pointer)
