"""Columns beside those that are read that say how all samples are meant: the direction of the axes, the unit."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from headimpact.quality import words
from headimpact.recording import SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.headings import Headings
from headimpact_service.ingest.lines_above import are_sae, speaks_of_axes
from headimpact_service.ingest.spelling import compact, unit_spelled

_OF_UNITS = frozenset({"unit", "units", "einheit", "einheiten", "unite", "unites"})
_PARTED = re.compile(r"[,;|+\s]+|_(?=rad|deg)")


@dataclass(frozen=True, slots=True)
class Conventions:
    """The columns of text that speak of axes, and those of units; of what the sender says, none."""

    axes: tuple[int, ...] = ()
    units: tuple[int, ...] = ()

    @property
    def columns(self) -> tuple[int, ...]:
        """All of them."""
        return (*self.axes, *self.units)


NO_CONVENTIONS = Conventions()


def conventions(headings: Headings, passed: Collection[int], *, axes: bool, units: bool) -> Conventions:
    """The columns, but for some that are `passed` over; of axes and units only where the sender does not say them."""
    open_to_all = [column for column in range(len(headings.written)) if column not in passed]
    return Conventions(
        tuple(column for column in open_to_all if axes and speaks_of_axes(headings.written[column])),
        tuple(column for column in open_to_all if units and _speaks_of_units(headings, column, passed)),
    )


def _speaks_of_units(headings: Headings, column: int, read: Collection[int]) -> bool:
    """Whether a column says units of what is read: one behind a column that is not may be of that."""
    return compact(headings.written[column]) in _OF_UNITS and (column == 0 or column - 1 in read)


def require_axes(column: str, text: str) -> None:
    """Refuse to take the axes for anatomical where a column says that they are SAE's."""
    if are_sae(text):
        raise unclear_axes(column, text)


def unclear_axes(whose: str, said: str) -> Problem:
    """The 422 for axes that something beside the samples says to be SAE's."""
    return file_fault(
        f"{whose} says {said} of the axes, which is not read: give axes beside the file (sae_j211, or anatomical if "
        "the samples are).",
        "axes-unclear",
        parameter="axes",
    )


def require_units(column: str, text: str, units: Mapping[SignalName, str]) -> None:
    """Refuse a column that says another unit of a signal than the one that it is read in."""
    for signal, said in _said_of(text, units):
        if said != units[signal]:
            raise file_fault(
                f"{column} says {said}, and the {words(signal)} is read in {units[signal]}: name in a mapping the "
                "columns of every signal and the unit of their numbers, or correct the file.",
                "units-differ",
                parameter="mapping",
            )


def _said_of(text: str, units: Mapping[SignalName, str]) -> Iterator[tuple[SignalName, str]]:
    for part in _PARTED.split(text):
        yield from ((signal, unit) for signal in units if (unit := unit_spelled(signal, part)) is not None)
