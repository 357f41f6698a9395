"""Column headings: finding a named one whatever its spelling, and understanding one that says what it holds."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from headimpact.recording import AXES, SIGNALS, SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest import mapping as mappings
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.spelling import MAX_COMPACT, compact, unit_at_end, unit_ending, unit_spelled
from headimpact_service.ingest.table import DURATION
from headimpact_service.ingest.time_headings import may_be_times, sensor_of_times, unit_of_times

_NUMBERED = re.compile(r"column ([0-9]{1,5})", re.ASCII | re.IGNORECASE)
_TURNS = {"roll": "x", "pitch": "y", "yaw": "z"}


class Headings:
    """The headings of one table, to be looked up by any of a column's spellings."""

    def __init__(
        self,
        headings: Sequence[str],
        units: Mapping[int, str] | None = None,
        dated: Collection[int] = (),
        lone: Collection[int] = (),
    ) -> None:
        """Index the headings as written and as :func:`compact` has them.

        `units` stand beside them in the file; columns that are `dated` need none; those that are `lone` hold one value
        an impact, as an array file's facts do, and no times of samples.
        """
        self.written = tuple(heading.strip() for heading in headings)
        self.units = units or {}
        self.dated = dated
        self.lone = lone
        self._exact = _places(self.written)
        self._compact = _places([compact(heading) for heading in self.written])
        self._again = _repeated(self._exact)

    @property
    def spoken(self) -> list[str]:
        """The headings, each with the unit that stands beside it in the file, unless it ends in that itself."""
        return [_with_unit(heading, self.units.get(place, "")) for place, heading in enumerate(self.written)]

    def units_beside(self, quantity: str, columns: Sequence[int]) -> set[str]:
        """The units of a quantity that stand beside some columns, as far as they are known."""
        told = (self.units.get(column) for column in columns)
        return {unit for text in told if (unit := unit_spelled(quantity, text)) is not None}

    def name_units(self, quantity: str, columns: Sequence[int]) -> bool:
        """Whether units of a quantity stand beside some columns, or in their headings."""
        written = (unit_ending(quantity, self.written[column]) for column in columns)
        return bool(self.units_beside(quantity, columns)) or any(written)

    def find(self, spellings: Sequence[str]) -> int | None:
        """The column that one of the spellings names; a heading as written wins over a looser match.

        Raises
        ------
        Problem
            422, where one spelling names two columns.
        """
        for index, spelling in ((self._exact, str.strip), (self._compact, compact)):
            for name in spellings:
                places = index.get(spelling(name), ())
                if len(places) > 1:
                    raise layout_problem("Two columns of the file have the same heading.", code="heading-twice")
                if places:
                    return places[0]
        return next((place for name in spellings if (place := self._numbered(name)) is not None), None)

    def _numbered(self, name: str) -> int | None:
        """The column that `Column 1` names, if it has no heading."""
        found = _NUMBERED.fullmatch(name.strip())
        place = -1 if found is None else int(found[1]) - 1
        return place if 0 <= place < len(self.written) and not self.written[place] else None

    def nearest(self, spelling: str, column: int) -> int | None:
        """Of the columns that a spelling names, the nearest before `column`, else the first."""
        places = [*(self._exact.get(spelling.strip()) or self._compact.get(compact(spelling)) or [])]
        places += [again for place in places for again in self._again.get(self.written[place], ())]
        return max((place for place in places if place < column), default=min(places, default=None))

    def repeats(self, heading: str) -> bool:
        """Whether several columns have a heading."""
        return self.written.count(heading) > 1 or heading in self._again


def _with_unit(heading: str, unit: str) -> str:
    says = compact(heading).endswith(compact(unit)) or (unit == DURATION and unit_ending("time", heading) is not None)
    return heading if says else f"{heading} {unit}"


def _repeated(places: Mapping[str, list[int]]) -> dict[str, list[int]]:
    """Further columns of a heading that stood twice, as a data frame tells them apart: `t_ms.1` beside `t_ms`."""
    found: dict[str, list[int]] = {}
    for name, of_name in places.items():
        first, _, number = name.rpartition(".")
        if number.isdecimal() and first in places:
            found.setdefault(first, []).extend(of_name)
    return found


def _places(names: Sequence[str]) -> dict[str, list[int]]:
    places: dict[str, list[int]] = {}
    for index, name in enumerate(names):
        if name:
            places.setdefault(name, []).append(index)
    return places


def layout_problem(detail: str, *, code: str, pointer: str | None = None) -> Problem:
    """The 422 for a table whose columns do not give what an impact needs; `pointer` is into its mapping."""
    return file_fault(detail, code, parameter="mapping", pointer=pointer)


@dataclass(frozen=True, slots=True)
class Meaning:
    """What one heading says: a component of a signal or the time, and the unit if it names one."""

    signal: SignalName | None
    axis: str | None
    unit: str | None


class Vocabulary:
    """The words and units that headings are made of, and every heading that they make."""

    def __init__(self, table: Mapping[str, Any]) -> None:
        """Spell out all headings of a preset's vocabulary."""
        self._meanings: dict[str, Meaning] = {}
        self._stems: dict[str, tuple[SignalName, str]] = {}
        self._telling = self._tell(table)
        for signal in SIGNALS:
            self._learn(signal, table[signal])
        self._clocks: dict[str, int] = {}
        for rank, word in enumerate(table["time"]["words"]):
            for unit, spellings in _units(table["time"]):
                self._add(compact(word) + spellings, Meaning(None, None, unit))
                self._clocks.setdefault(compact(word) + spellings, rank)

    def _tell(self, table: Mapping[str, Any]) -> dict[str, SignalName]:
        """Spellings of units of rotation: three columns of one are a signal, whatever else they are called."""
        told: dict[str, SignalName] = {
            spelling: signal
            for signal in SIGNALS
            for unit, spelling in _units(table[signal])
            if unit is not None and signal != "linear_acceleration"
        }
        return {unit: told[unit] for unit in sorted(told, key=len, reverse=True)}

    def _learn(self, signal: SignalName, words_and_units: Mapping[str, Any]) -> None:
        words = [compact(word) for word in words_and_units["words"]]
        for word in words:
            for axis in AXES:
                self._stems |= dict.fromkeys(_stems(word, axis), (signal, axis))
                for unit, spelling in _units(words_and_units):
                    for stem in _stems(word, axis):
                        self._add(stem + spelling, Meaning(signal, axis, unit))
                    if unit is not None and len(word) >= 3:  # gyro [rad/s] x
                        self._add(word + spelling + axis, Meaning(signal, axis, unit))

    def _add(self, heading: str, meaning: Meaning) -> None:
        if self._meanings.setdefault(heading, meaning) != meaning:
            raise ValueError(f"The vocabulary gives the heading {heading} two meanings.")

    def understand(self, heading: str) -> Meaning | None:
        """What a heading says, if it is made of known words.

        One too long for a mapping says nothing. Neither does `-ay`: whether its numbers are to be turned is unclear.
        """
        unclear = len(heading) > MAX_COMPACT or heading.lstrip().startswith("-")
        return None if unclear else self._meanings.get(compact(heading))

    def meanings(self, headings: Headings) -> list[Meaning | None]:
        """What each heading says with the unit beside it or, where that says nothing, as it is written."""
        told = zip(headings.written, headings.spoken, strict=True)
        return [self.understand(said) or self.understand(heading) for heading, said in told]

    def components(self, headings: Headings) -> dict[SignalName, list[str]]:
        """For each signal, three headings that begin with words for its components and go on alike, however they do."""
        found: dict[tuple[SignalName, str], dict[str, str]] = {}
        for heading, said in zip(headings.written, headings.spoken, strict=True):
            name = compact(said)
            stem = next((name[:end] for end in range(len(name), 1, -1) if name[:end] in self._stems), None)
            if stem is not None:
                signal, axis = self._stems[stem]
                found.setdefault((signal, name.removeprefix(stem)), {}).setdefault(axis, heading)
            for signal, rest in (*self._by_unit(name), *_by_last_word(said)):
                for alike, axis in _axes_of(rest):
                    found.setdefault((signal, alike), {}).setdefault(axis, heading)
        whole = {signal: by_axis for (signal, _), by_axis in found.items() if len(by_axis) == len(AXES)}
        return {signal: [by_axis[axis] for axis in AXES] for signal, by_axis in whole.items()}

    def _by_unit(self, name: str) -> Iterator[tuple[SignalName, str]]:
        """What is left of a name that holds a unit of one signal only, without it: the longest that it holds."""
        unit = next((unit for unit in self._telling if unit in name), None)
        if unit is not None:
            before, _, behind = name.rpartition(unit)
            yield self._telling[unit], before + "|" + behind

    def mapping(self, headings: Headings, but: Collection[SignalName] = ()) -> mappings.Mapping:
        """The mapping that a table's headings, each with the unit beside it, amount to, without some signals."""
        understood = zip(headings.written, self.meanings(headings), strict=True)
        found = [(heading, meaning) for heading, meaning in understood if meaning is not None]
        fields: dict[str, Any] = {}
        for signal in SIGNALS:
            columns = {heading: m for heading, m in found if m.signal == signal}
            if columns and signal not in but:
                fields[signal] = _signal_columns(signal, columns)
        for signal, times in self.own_times(headings).items():
            if signal in fields:
                fields[signal]["time"] = times
        times = self.time(headings)
        if any(headings.repeats(time.column) for time in times):  # one before each sensor's own columns
            for found_signal in SIGNALS:
                if found_signal in fields:
                    fields[found_signal]["time"] = times
        elif times:
            fields["time"] = times
        return mappings.Mapping.model_validate(fields)

    def says_time(self, said: str) -> bool:
        """Whether a heading is a word for the samples' times, with a unit."""
        meaning = self.understand(said)
        return meaning is not None and meaning.signal is None and meaning.unit is not None

    def own_times(self, headings: Headings) -> dict[SignalName, list[mappings.TimeColumn]]:
        """The columns of times that name one signal's sensor, as a time of the gyroscope."""
        found: dict[SignalName, list[mappings.TimeColumn]] = {}
        for column, heading in enumerate(headings.written):
            if column in headings.lone:
                continue
            signal = sensor_of_times(heading) if may_be_times(heading) else None
            dates = mappings.DATES_IN if column in headings.dated else None
            unit = dates or unit_of_times(heading, headings.units.get(column))
            if unit is not None and signal is not None:
                time = mappings.TimeColumn.model_validate({"column": heading, "unit": unit})
                found.setdefault(signal, []).append(time)
        return found

    def time(self, headings: Headings) -> list[mappings.TimeColumn]:
        """The columns of times that a table's headings name, with their units; of one word, all.

        Of several words the first, and those in a unit before dates: a column of the event's timestamp may stand beside
        the samples' times.
        """
        found: list[tuple[tuple[bool, int], mappings.TimeColumn]] = []
        for place, (heading, said) in enumerate(zip(headings.written, headings.spoken, strict=True)):
            meaning, dated = self.understand(said), place in headings.dated
            if (
                place not in headings.lone
                and meaning is not None
                and meaning.signal is None
                and (dated or meaning.unit is not None)
            ):
                column = mappings.TimeColumn.model_validate(
                    {"column": heading, "unit": meaning.unit or mappings.DATES_IN}
                )
                found.append(((dated, self._clocks[compact(said)]), column))
        found.sort(key=lambda ranked: ranked[0])
        return list({column.column: column for rank, column in found if rank == found[0][0]}.values())


def _by_last_word(heading: str) -> Iterator[tuple[SignalName, str]]:
    """What is left of a heading that ends in a unit of linear acceleration as a word of its own, without it."""
    at_end = unit_at_end("linear_acceleration", heading)
    if at_end is not None:
        yield "linear_acceleration", compact(at_end[0]) + "|"


def _axes_of(rest: str) -> Iterator[tuple[str, str]]:
    """The letters of a name that may be its axis, each with the name that the other two axes share."""
    for place, axis in enumerate(rest):
        if axis in AXES:
            yield f"{rest[:place]}*{rest[place + 1 :]}", axis
    for word, axis in _TURNS.items():
        if word in rest:
            yield rest.replace(word, "*"), axis


def _units(words_and_units: Mapping[str, Any]) -> list[tuple[str | None, str]]:
    named = words_and_units["units"].items()
    return [(None, ""), *((unit, compact(spelling)) for unit, spellings in named for spelling in spellings)]


def _stems(word: str, axis: str) -> list[str]:
    """A quantity with its axis: `ax`, `accelx`, `linear accel x`, `x axis linear accel`."""
    if len(word) < 3:
        return [f"{word}{axis}"]
    return [f"{word}{axis}", f"{axis}{word}", f"{axis}axis{word}", f"{word}{axis}axis"]


def _signal_columns(signal: SignalName, columns: Mapping[str, Meaning]) -> dict[str, Any]:
    """The columns of one signal, all three in one unit."""
    by_axis: dict[str, list[str]] = {}
    for heading, meaning in columns.items():
        by_axis.setdefault(str(meaning.axis), []).append(heading)
    if any(len(headings) > 1 for headings in by_axis.values()):
        raise layout_problem(
            f"Several columns could be the same component of the {signal}: say in a mapping which to take, with their "
            "unit, and name there the columns of the other signals too.",
            code="heading-twice",
            pointer=f"/{signal}",
        )
    units = {meaning.unit for meaning in columns.values()}
    if len(units) > 1:
        raise layout_problem(
            f"The columns of the {signal} must be in one unit.", code="units-differ", pointer=f"/{signal}/unit"
        )
    return {"unit": units.pop(), **by_axis}
