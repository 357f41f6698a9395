"""Arrays as a table: impacts x samples x components, with what is said once for an impact, a sample or all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from headimpact_service.ingest.guarded.contents import checked_headings, unreadable
from headimpact_service.ingest.guarded.stated_units import of_columns
from headimpact_service.ingest.table import Columns, FloatArray

ROWS_AT_ONCE = 16_384
MAX_LENGTH = 20_001
"""Of longer records this much is read: one sample more than an impact may have, which is then refused by name."""
AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True)
class Samples:
    """An array of samples; `take` gives those of the next so many impacts, impacts x samples x components."""

    name: str
    impacts: int
    length: int
    width: int
    take: Callable[[int], FloatArray]

    @property
    def headings(self) -> list[str]:
        """One for each component: NAME of a single one, NAME_x to NAME_z of three, else NAME_1, NAME_2 and so on."""
        if self.width == 1:
            return [self.name]
        letters = AXES if self.width == len(AXES) else [str(number) for number in range(1, self.width + 1)]
        return [f"{self.name}_{letter}" for letter in letters]


@dataclass(frozen=True, slots=True)
class Fact:
    """One value for each impact, or one for all."""

    name: str
    numbers: FloatArray | None
    texts: list[str]

    def of(self, first: int, last: int) -> list[str]:
        """The texts of some impacts."""
        return self.texts[first:last] if len(self.texts) > 1 else self.texts * (last - first)


class ArrayTable:
    """Arrays of one number of impacts; the shorter of two records ends in NaN."""

    parted = True
    dated = frozenset[int]()
    above: Sequence[Sequence[str]] = ()
    beside: Sequence[Sequence[str]] = ()

    def __init__(self, samples: Sequence[Samples], facts: Sequence[Fact], units: Mapping[str, str]) -> None:
        """Samples with times first, so that a signal's own times stand before it; `units` are texts by their names."""
        self._samples, self._facts = list(samples), list(facts)
        self._columns = [(array, part) for array in self._samples for part in range(array.width)]
        self.wordless = range(len(self._columns))
        named = [heading for array in self._samples for heading in array.headings]
        self.headings = checked_headings([*named, *(fact.name for fact in self._facts)])
        self.units = of_columns([(array.name, part) for array, part in self._columns], units)
        self._impacts = max((array.impacts for array in self._samples), default=0)
        if any(array.impacts != self._impacts for array in self._samples):
            raise unreadable("The arrays of samples differ in their number of impacts.")

    def has_samples(self, place: int) -> bool:
        """An array of samples does, a fact does not."""
        return place < len(self._columns)

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Columns]:
        """Some impacts at a time."""
        self._require_numbers(numbers, texts)
        arrays = [array for array in self._samples if any(self._columns[place][0] is array for place in numbers)]
        length = min(max((array.length for array in arrays), default=0), MAX_LENGTH)
        at_once = max(1, ROWS_AT_ONCE // max(1, length))
        for first in range(0, self._impacts, at_once):
            last = min(first + at_once, self._impacts)
            taken = {array.name: array.take(last - first) for array in arrays}
            yield Columns(
                rows=(last - first) * length,
                numbers={place: self._column(place, taken, length) for place in numbers},
                texts={place: self._facts[place - len(self._columns)].of(first, last) for place in texts},
                lengths=[length] * (last - first),
            )

    def _require_numbers(self, numbers: Sequence[int], texts: Sequence[int]) -> None:
        for place in numbers:
            if place >= len(self._columns):
                raise unreadable(f"The array {self.headings[place]} has no samples.")
        for place in texts:
            if place < len(self._columns):
                raise unreadable(
                    f"The array {self.headings[place]} has samples; a name or a fact has one value an impact."
                )

    def _column(self, place: int, taken: dict[str, FloatArray], length: int) -> FloatArray:
        array, part = self._columns[place]
        values = taken[array.name][:, :length, part]
        if values.shape[1] == length:
            return np.ascontiguousarray(values).reshape(-1)
        room = np.full((values.shape[0], length), np.nan)
        room[:, : values.shape[1]] = values
        return room.reshape(-1)
