"""The layout of one table: which column is what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import chain

from headimpact.quality import QualityNote
from headimpact.recording import AXES, SignalName
from headimpact_service.ingest.conventions import NO_CONVENTIONS, Conventions
from headimpact_service.ingest.date_order import DateOrder
from headimpact_service.ingest.other_times import NO_OTHERS, OtherTimes
from headimpact_service.ingest.supplied import Supplied
from headimpact_service.ingest.unread import NOTHING_UNREAD, Unread


@dataclass(frozen=True, slots=True)
class Component:
    """One component's column, and what its numbers are multiplied by: a sign, and the size of their unit.

    `column` is None for one that a constrained plane leaves out.
    """

    column: int | None
    factor: float


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
    date_order: DateOrder | None
    context: dict[str, int]
    reading: dict[str, int]
    unscorable: int | None
    time_base: int | None
    sample_number: int | None
    axis_peaks: Mapping[int, SignalName] = field(default_factory=dict)
    """Columns that are passed over as each axis' peak, a value an impact; samples they may not be."""
    others: OtherTimes = NO_OTHERS
    """What may say other times than those that are read."""
    unread: Unread = NOTHING_UNREAD
    """What may tell that the rows are several impacts, where nothing that is read would."""
    events: tuple[tuple[int, ...], ...] = ()
    """What may say when an impact was, where no column that is read does."""
    conventions: Conventions = NO_CONVENTIONS
    """What may say another direction of the axes, or another unit, than those that are read."""
    notes: tuple[QualityNote, ...] = ()
    """Of columns that seem to be a signal and are not read."""

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

    def field_of(self, column: int) -> tuple[str, ...] | None:
        """What a column is read as that a mapping may do without, as the way to it in the mapping.

        None for a column that tells impacts apart.
        """
        named: dict[tuple[str, ...], int | None] = {
            ("external_id",): self.external_id,
            ("athlete",): self.athlete,
            ("device",): self.device,
            ("session_id",): self.context.get("session_id"),
            ("unscorable",): self.unscorable,
            **{("context", field): place for field, place in self.context.items()},
            **{("reading", field): place for field, place in self.reading.items()},
        }
        return next((way for way, place in named.items() if place == column and column not in self.keys), None)

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
        tables = (*self.context.values(), *self.reading.values())
        named = (*one_each, *self.keys, *self.occurred_at, *tables, *self.peaks, *self.axis_peaks)
        others = [rate.column for rate in self.others.rates]
        beside = (*others, *self.unread.columns, *self.conventions.columns, *chain.from_iterable(self.events))
        return sorted({column for column in (*named, *beside) if column is not None})

    @property
    def peaks(self) -> list[int]:
        """Columns of peaks that the device supplies."""
        return [one.column for signal in self.signals.values() for one in signal.peaks]

    @property
    def is_timed(self) -> bool:
        """Whether every signal has stamps that are surely its samples': dates may be the event's."""
        clocks = [signal.clock or self.clock for signal in self.signals.values()]
        return all(clock is not None and not clock.dated for clock in clocks)

    @property
    def has_order(self) -> bool:
        """Whether times or numbers of its samples say how the rows follow each other."""
        timed = all(signal.clock or self.clock for signal in self.signals.values())
        return timed or self.sample_number is not None

    def ends_alone(self, name: SignalName) -> bool:
        """Whether a signal's rows may end before the others': it has times or a rate of its own, or others have."""
        if self.signals[name].is_apart:
            return True
        return self.clock is None and any(signal.is_apart for signal in self.signals.values())

    def named(self, column: int) -> str:
        """A column as a message names it, by its number and its heading."""
        heading = self.headings[column]
        return f"Column {column + 1} ({heading})" if heading else f"Column {column + 1}"
