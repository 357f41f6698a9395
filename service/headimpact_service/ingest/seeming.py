"""Columns that seem to be a signal, by a word for the quantity or by its unit, whatever their axes are called.

No axis can be told from AP, 1 or forward, so nobody can read them without a mapping; but they are not passed over.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Sequence

from headimpact.quality import QualityNote, words
from headimpact.recording import AXES, SIGNALS, SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.headings import Headings, layout_problem
from headimpact_service.ingest.layout import Layout
from headimpact_service.ingest.no_signal import MAX_SHOWN
from headimpact_service.ingest.presets import spoken_of
from headimpact_service.ingest.spelling import unit_ending, unit_spelled, words_of
from headimpact_service.ingest.table import Table

_ACCELERATION = frozenset({"acc", "accel", "acceleration", "accelerometer", "beschleunigung", "lac"})
_TURNING = frozenset({"ang", "angular", "rot", "rotational"})
_VELOCITY = frozenset({"vel", "velocity", "rate", "speed"})
_GYROSCOPE = frozenset({"gyr", "gyro", "gyroscope", "omega", "winkelgeschwindigkeit", "drehrate"})
_LETTERS: dict[str, SignalName] = {
    **dict.fromkeys(("ax", "ay", "az"), "linear_acceleration"),
    **dict.fromkeys(("wx", "wy", "wz"), "angular_velocity"),
}
_AXIS = re.compile(r"(?<![a-z][a-z])([xyz])$")
"""The axis that a word is, or ends in behind one letter: `x`, `rx`."""
_CODE = re.compile(r"[0-9?]?[0-9A-Z?]{9,11}(AC|AV|AA)[XYZ][0-9A-Z?]")
"""A channel's code as ISO-MME has it: 11HEADCG00H3ACXA."""
_CODED: dict[str, SignalName] = {
    "AC": "linear_acceleration",
    "AV": "angular_velocity",
    "AA": "angular_acceleration",
}
_NO_SAMPLES = frozenset(
    {
        *("peak", "pk", "max", "maximum", "min", "minimum", "largest", "pla", "pta", "pav", "prv", "paa", "pra"),
        *("res", "resultant", "mag", "magnitude", "norm", "total", "mean", "average", "avg", "rms", "std", "sum"),
        *("range", "threshold", "trigger", "triggered", "limit", "scale", "bias", "offset", "noise", "error"),
        *(
            "time",
            "times",
            "clock",
            "status",
            "valid",
            "quality",
            "filter",
            "cutoff",
            "bandwidth",
            "sample",
            "sampling",
        ),
        *("mass", "weight", "temperature", "temp", "serial", "id", "name", "unit", "units", "gain", "sensitivity"),
    }
)
"""Words of what is said of a signal once, or of another quantity."""


def left_signals(layout: Layout, headings: Headings, table: Table) -> dict[SignalName, list[str]]:
    """Of each signal that a layout does not read, the columns that seem to be it; none of those that are read."""
    read = set(layout.numbers)
    named = {
        signal: columns
        for signal, columns in spoken_of(headings).items()
        if read.isdisjoint(headings.find([column]) for column in columns)
    }
    found = _seeming(headings, table, read) | named
    return {signal: columns for signal, columns in found.items() if signal not in layout.signals}


def given_twice(layout: Layout, headings: Headings, table: Table) -> list[QualityNote]:
    """The notes on columns that seem to be a signal that is read from others."""
    found = _seeming(headings, table, set(layout.numbers))
    return [_twice(signal, columns) for signal, columns in found.items() if signal in layout.signals]


def _twice(signal: SignalName, columns: Sequence[str]) -> QualityNote:
    detail = (
        f"The columns {', '.join(columns[:MAX_SHOWN])} seem to be the {words(signal)} too, which was read from others. "
        "If they are the ones that count, name them in a mapping."
    )
    return QualityNote("channel_given_twice", "note", detail, signal)


def not_read(signal: SignalName, columns: Sequence[str]) -> Problem:
    """The 422 for columns that seem to be a signal, of which nobody has said how to read them."""
    return layout_problem(
        f"The columns {', '.join(columns[:MAX_SHOWN])} seem to be the {words(signal)}, on axes, in a unit or for a "
        "device that is not known: name the columns of every signal, and their units, in a mapping.",
        code="columns-not-read",
        pointer=f"/{signal}",
    )


def not_named(signal: SignalName, columns: Sequence[str]) -> QualityNote:
    """The note on columns that seem to be a signal beside those that a mapping names."""
    detail = (
        f"The columns {', '.join(columns[:MAX_SHOWN])} seem to be the {words(signal)}, of which the mapping names "
        f"none: they were not read. Name them in it too, or say {json.dumps({signal: None})}."
    )
    return QualityNote("channel_missing", "warning", detail, signal)


def unnamed(layout: Layout, headings: Headings, table: Table) -> list[QualityNote]:
    """The notes on three columns of x, y and z whose quantity nobody tells, where a layout lacks one of a head's."""
    lacks_rotation = {"angular_velocity", "angular_acceleration"}.isdisjoint(layout.signals)
    if "linear_acceleration" in layout.signals and not lacks_rotation:
        return []
    found: dict[tuple[str, ...], dict[str, str]] = {}
    for column, heading in enumerate(headings.written):
        listed = words_of(heading)
        axes = [axis[1] for word in listed if (axis := _AXIS.search(word))]
        if len(axes) == 1 and column not in layout.numbers and table.has_samples(column):
            alike = tuple(_AXIS.sub("*", word) for word in listed)
            found.setdefault(alike, {}).setdefault(axes[0], heading)
    return [_unnamed(list(by_axis.values())) for by_axis in found.values() if len(by_axis) == len(AXES)]


def _unnamed(columns: Sequence[str]) -> QualityNote:
    detail = (
        f"The columns {', '.join(columns)} have three axes and were not read: no quantity is known by that name. If "
        "they are the head's motion, name the columns of every signal, and their units, in a mapping."
    )
    return QualityNote("channel_missing", "note", detail)


def _seeming(headings: Headings, table: Table, read: Collection[int]) -> dict[SignalName, list[str]]:
    """Of each signal, three or more columns with samples that are not read and speak of it."""
    found: dict[SignalName, list[str]] = {}
    for column, heading in enumerate(headings.written):
        if column not in read and table.has_samples(column):
            for signal in _spoken_of(heading, headings.units.get(column)):
                found.setdefault(signal, []).append(heading)
    return {signal: columns for signal, columns in found.items() if len(columns) >= len(AXES)}


def _spoken_of(heading: str, beside: str | None) -> Iterator[SignalName]:
    if code := _CODE.fullmatch(heading):
        yield _CODED[code[1]]
        return
    listed = words_of(heading)
    words = set(listed)
    if words & _NO_SAMPLES:
        return
    if words & _ACCELERATION or "alpha" in words:
        yield "angular_acceleration" if words & _TURNING or "alpha" in words else "linear_acceleration"
    elif words & _GYROSCOPE or (words & _TURNING and words & _VELOCITY) or (listed[:1] == ["w"] and len(listed) > 1):
        yield "angular_velocity"
    elif listed and listed[-1] in _LETTERS:
        yield _LETTERS[listed[-1]]
    else:
        named = (signal for signal in SIGNALS if unit_spelled(signal, beside) or unit_ending(signal, heading))
        yield from named
