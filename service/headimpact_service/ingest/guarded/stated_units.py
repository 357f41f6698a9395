"""The units that a file of arrays states in texts of its own, by their names: `acc_unit`, `units_acc`, `units`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from headimpact.recording import AXES
from headimpact_service.ingest.spelling import words_of

_ALONE = frozenset({"unit", "units"})
_BEHIND, _BEFORE = ("_unit", "_units"), ("unit_", "units_")
_TURNING = frozenset({"ang", "angular", "rot", "rotational", "gyr", "gyro", "omega", "w", "av", "alpha"})
_OF_TURNS = re.compile("rad|deg|dps|°", re.IGNORECASE)
_OF_TIMES = re.compile(r"t(ime|imes|imestamp|imestamps)?(_|$)", re.IGNORECASE)
_PARTED = re.compile(r"\s*[;,|]\s*")


def of_columns(columns: Sequence[tuple[str, int]], texts: Mapping[str, str]) -> dict[int, str]:
    """The unit of each column, an array's name and the place in it, as the file's texts say, by their names.

    Of six components with two units the first is that of the first three.
    """
    said = {name: unit for text, unit in texts.items() if (name := unit_of(text)) is not None}
    widths = {name: 1 + max(part for of, part in columns if of == name) for name, _ in columns}
    found: dict[int, str] = {}
    for place, (name, part) in enumerate(columns):
        own = said.get(name.lower())
        units = _PARTED.split(_shared(name, said.get("", "")) if own is None else own)
        if len(units) == 1 and units[0]:
            found[place] = units[0]
        elif len(units) == 2 and widths[name] == 2 * len(AXES):
            found[place] = units[part // len(AXES)]
    return found


def _shared(name: str, unit: str) -> str:
    """A unit that is said of no array, for those that it may be of: of turns or not, and of no times."""
    if _OF_TIMES.match(name):
        return ""
    turns = not _TURNING.isdisjoint(words_of(name))
    return unit if ";" in unit or turns == (_OF_TURNS.search(unit) is not None) else ""


def unit_of(text: str) -> str | None:
    """Of which array a text is the unit, by its name: empty for one of all; None where it is no unit."""
    name = text.lower()
    if name in _ALONE:
        return ""
    for ending in _BEHIND:
        if name.endswith(ending):
            return name.removesuffix(ending)
    return next((name.removeprefix(start) for start in _BEFORE if name.startswith(start)), None)
