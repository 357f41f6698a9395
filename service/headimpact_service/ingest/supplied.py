"""What a device says itself of its samples: resultants, one a sample, and peaks, one an impact.

They are compared with the samples and never read in their place.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Literal

from headimpact.recording import TO_CRITERIA_UNIT, SignalName
from headimpact_service.ingest.cells import is_written_number
from headimpact_service.ingest.decimal_commas import has_comma, has_decimal_comma
from headimpact_service.ingest.headings import Headings
from headimpact_service.ingest.scaled_units import SCALED_UNITS
from headimpact_service.ingest.spelling import compact, unit_ending, unit_spelled, vocabulary

Kind = Literal["resultant", "peak"]


@dataclass(frozen=True, slots=True)
class Supplied:
    """A column of resultants or of peaks; `factor` takes them to the unit of their signal."""

    column: int
    factor: float = 1.0


@dataclass(frozen=True, slots=True)
class _Words:
    """How headings say that they hold resultants or peaks of a signal, as :func:`compact` has it, without the unit."""

    resultants: frozenset[str]
    peaks: frozenset[str]
    alone: frozenset[str]
    """What says that it is a resultant and not of which quantity, which its unit has to say."""
    units: tuple[tuple[str, str | None], ...]


def supplied_in(signal: SignalName, unit: str, column: int, headings: Headings) -> Supplied:
    """A column that is said to hold resultants or peaks of a signal: in its unit, unless the column names its own."""
    own = unit_spelled(signal, headings.units.get(column)) or unit_ending(signal, headings.written[column])
    base, size = SCALED_UNITS.get(unit, (unit, 1.0))
    return Supplied(column, size if own is None else TO_CRITERIA_UNIT[own] / TO_CRITERIA_UNIT[base])


def spoken_in(
    headings: Headings, units: Mapping[SignalName, str], unnamed: Collection[SignalName]
) -> Iterator[tuple[SignalName, Kind, Supplied]]:
    """The columns whose headings say that they are resultants or peaks of a signal that is read.

    Parameters
    ----------
    headings
        The table's headings.
    units
        The unit of every signal that is read.
    unnamed
        The signals whose own headings name no unit: only their resultants may name none either.
    """
    for column, (written, said) in enumerate(zip(headings.written, headings.spoken, strict=True)):
        for signal, unit in units.items():
            found = _understood(signal, compact(said)) or _understood(signal, compact(written))
            if found is not None and (found[1] is not None or (found[0] == "resultant" and signal in unnamed)):
                kind, own = found
                yield signal, kind, Supplied(column, TO_CRITERIA_UNIT[own or unit] / TO_CRITERIA_UNIT[unit])
                break


def peak_said(texts: Collection[str]) -> float | None:
    """The peak that an impact's rows say, if they say one: the largest, where each sample has its own."""
    numbers = [text for text in texts if is_written_number(text) and (has_decimal_comma(text) or not has_comma(text))]
    return max((abs(float(text.replace(",", "."))) for text in numbers), default=None)


def _understood(signal: SignalName, heading: str) -> tuple[Kind, str | None] | None:
    """What a heading holds of a signal, and in which unit; what names no quantity has to name its unit, as a peak."""
    words = _words(signal)
    for spelling, unit in words.units:
        form = heading.removesuffix(spelling)
        if heading.endswith(spelling):
            if form in words.resultants or (unit is not None and form in words.alone):
                return "resultant", unit
            if unit is not None and form in words.peaks:
                return "peak", unit
    return None


@cache
def _words(signal: SignalName) -> _Words:
    said = {kind: [compact(word) for word in words] for kind, words in vocabulary()["supplied"].items()}
    of_signal = vocabulary()[signal]
    quantities = [compact(word) for word in of_signal["words"]]
    resultants = {form for name, word in product(quantities, said["resultant"]) for form in _joined(name, word)}
    clear = (*resultants, *said["alone"], *of_signal["peaks"])
    named = {form for name, word in product((*quantities, *clear), said["peak"]) for form in _joined(name, word)}
    largest = {form for name, word in product(clear, said["largest"]) for form in _joined(name, word)}
    spelled = [(compact(s), unit) for unit, spellings in of_signal["units"].items() for s in spellings]
    longest_first = sorted(spelled, key=lambda one: len(one[0]), reverse=True)
    peaks = {*named, *largest, *said["peak"], *of_signal["peaks"]}
    return _Words(frozenset(resultants), frozenset(peaks), frozenset(said["alone"]), (*longest_first, ("", None)))


def _joined(name: str, word: str) -> list[str]:
    """A quantity and what is said of it: behind it, and before it where both are words."""
    return [name + word, word + name] if len(name) > 2 and len(word) > 1 else [name + word]
