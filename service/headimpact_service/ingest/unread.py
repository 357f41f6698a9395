"""Columns that no layout reads, but that may tell that the rows of a table are several impacts.

Numbers of impacts may start again with every player or session, so the columns that name those must not change within
an impact either. Where all signals have times, which would begin anew, times and numbers of samples tell nothing more.
A mapping's empty ``group_by`` says that all rows are one impact.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence, Set
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise
from typing import Any

import numpy as np

from headimpact_service.ingest.blocks import STAY
from headimpact_service.ingest.cells import is_written_number, numbers_said, said
from headimpact_service.ingest.date_order import DateOrder, year_first
from headimpact_service.ingest.impact_json import MIN_RATE_HZ
from headimpact_service.ingest.spelling import words_of
from headimpact_service.ingest.times import TimeError, instant

_NAMES = frozenset(
    {
        *("impact", "event", "hit", "trial", "test", "run", "shot", "drop", "session", "record", "recording"),
        *("id", "uuid", "guid", "name", "file", "filename", "serial"),
        *("player", "athlete", "subject", "wearer", "user", "participant", "team", "sensor", "device"),
    }
)
_IMPACTS = frozenset(
    {
        *("impact", "hit", "event", "trial", "test", "shot", "drop", "collision"),
        *("aufprall", "stoss", "schlag", "versuch", "treffer", "choc", "coup", "essai"),
        *("impacto", "golpe", "ensayo", "colpo", "prova"),
    }
)
"""Words for an impact itself, or for what was done to make one."""
_PARTS = frozenset(
    {
        *("case", "no", "nr", "num", "number", "seq", "sequence", "series", "set", "batch", "round", "take", "code"),
        *("clip", "video", "play", "match", "game", "quarter", "week", "day"),
        *("helmet", "headform", "mouthguard", "mg", "condition", "group", "cluster"),
        *_IMPACTS,
    }
)
"""Words of what may differ from impact to impact; they tell only where nothing else would."""
_PERSONS = frozenset({"player", "athlete", "subject", "wearer", "user", "participant"})
_MEASURED = frozenset(
    {
        *("temp", "temperature", "battery", "voltage", "volt", "charge", "current", "pressure", "humidity", "force"),
        *("saturated", "saturation", "proximity", "distance", "light", "quality", "valid", "threshold"),
        *("load", "speed", "velocity", "heart", "hr", "rssi", "gain", "raw", "signal"),
    }
)
"""Words of what is measured, whatever it is of: a sensor's temperature."""
_STATES = frozenset({"is", "flag", "state", "status", "error", "phase", "stage", "mode"})
_TRIGGERS = frozenset({"trigger", "triggered", "active"})
_REMARKS = frozenset({"comment", "comments", "note", "notes", "annotation", "annotations", "kommentar", "bemerkung"})
_MARKS = _STATES | _TRIGGERS
"""Words of what comes and goes within an impact: an event's flag."""
_NUMBER_SIGN = "#"
_COUNTS = frozenset({_NUMBER_SIGN, "count"})
"""Words that, like names, make a trigger one that is counted."""
_TIMES = frozenset({"t", "time", "times", "date", "stamp", "timestamp", "datetime", "clock", "elapsed", "zeit"})
_COUNTERS = frozenset({"sample", "samples", "index", "idx", "frame", "row", "point", "scan", "counter"})
_OTHER_FRAMES = frozenset({"video", "camera", "film"})
_NO_NAMES = _MEASURED | _STATES | _TIMES | _COUNTERS
_DATE = re.compile(r"[0-9]{1,4}([-./])[0-9]{1,2}\1[0-9]{1,4}", re.ASCII)
_CLOCK = re.compile(r"(?:([0-9]{1,2}):)?([0-9]{1,2}):([0-9]{2}(?:[.,][0-9]{1,9})?)(?![0-9:])")
ROUNDED_TO_S = 1.0
"""Times of samples may be written to the second."""
MAX_OTHERS = 16
"""So many columns whose headings say nothing are looked at: a table may have a thousand of what is measured."""


@dataclass(frozen=True, slots=True)
class Unread:
    """Columns by what their headings say: names of something, times, numbers of samples, anything, and yes or no.

    `triggers` are those that are counted, `peaks` those of an impact that the device supplies.
    """

    names: tuple[int, ...] = ()
    times: tuple[int, ...] = ()
    counters: tuple[int, ...] = ()
    others: tuple[int, ...] = ()
    marks: tuple[int, ...] = ()
    triggers: tuple[int, ...] = ()
    measured: tuple[int, ...] = ()
    peaks: tuple[int, ...] = ()
    remarks: tuple[int, ...] = ()
    """What somebody wrote, perhaps of a moment within an impact: its words name no rows."""
    impacts: tuple[int, ...] = ()
    """Names of impacts that tell even where something else would: by a number of its own, or one each row."""
    hints: tuple[int, ...] = ()
    """Names that tell nothing where samples have times, but how to part the rows if these begin anew."""
    alone: bool = False
    """Whether nothing that is read would tell."""
    named: bool = False
    """Whether the sender has named what tells impacts apart."""
    said_one: bool = False
    """Whether the sender says that the rows are one impact."""

    @property
    def numbering(self) -> tuple[int, ...]:
        """Those whose numbers may count samples; names do where nothing else tells impacts or samples apart."""
        names = self.names if self.alone else ()
        return (*self.counters, *self.others, *self.marks, *self.triggers, *names)

    @property
    def watched(self) -> tuple[int, ...]:
        """Those that must say the same, or count on, within an impact."""
        told = (*self.names, *self.times, *self.counters, *self.others, *self.impacts, *self.remarks)
        return (*told, *self.marks, *self.triggers, *self.peaks, *self.measured)

    @property
    def columns(self) -> tuple[int, ...]:
        """All of them."""
        return (*self.watched, *self.hints)


NOTHING_UNREAD = Unread()


def unread_columns(
    headings: Sequence[str], passed: Collection[int], *, timed: bool, keyed: bool, named: bool = False
) -> Unread:
    """The columns, but for some that are `passed` over, whose headings speak of impacts, of times or of samples.

    Of a table whose samples have times only names; where nothing tells impacts apart, only those of people: an event
    may be marked within one impact. Nor do others count where the sender has `named` what tells impacts apart. Where
    neither times nor names tell, columns whose headings say nothing, too.
    """
    alone = not (timed or keyed)
    telling = _NAMES | _PARTS if alone else _NAMES if keyed and not named else _PERSONS
    found: dict[str, list[int]] = {}
    for column, heading in enumerate(headings):
        words = {*words_of(heading), *(_NUMBER_SIGN if _NUMBER_SIGN in heading else "")}
        if column in passed:
            continue
        if words & _OTHER_FRAMES and words & _COUNTERS:  # several samples have one
            continue
        if words & _IMPACTS and not (named or words & _NO_NAMES):
            found.setdefault("impacts", []).append(column)
        if (kind := _kind(words, telling, timed=timed, alone=alone)) is None:
            continue
        if len(found.get(kind, ())) < MAX_OTHERS or kind not in {"others", "remarks", "marks", "triggers", "measured"}:
            found.setdefault(kind, []).append(column)
    columns: dict[str, Any] = {kind: tuple(of_kind) for kind, of_kind in found.items()}
    return Unread(**columns, alone=alone, named=named)


def _kind(words: Set[str], telling: Set[str], *, timed: bool, alone: bool) -> str | None:
    """What a heading of these words may tell, if anything; `alone` if nothing that is read would."""
    if words & _COUNTERS:
        return None if timed else "counters"
    if words & _TIMES:
        return None if timed else "times"
    if words & _MEASURED:
        return "measured" if alone else None
    if words & _MARKS:
        counted = words & (_NAMES | _PARTS | _COUNTS) and not words & _STATES
        return None if not alone else "triggers" if counted else "marks"
    if words & telling:
        return "names"
    if words & (_NAMES | _PARTS):
        return "hints"
    if not alone:
        return None
    return "remarks" if words & _REMARKS else "others"


def left_out(cells: Sequence[str]) -> tuple[float, float, float] | None:
    """Where numbers that count samples in steps of one size first leave some out: before, behind, and the step."""
    told = np.array(numbers_said(cells))
    steps = np.diff(told)
    if not steps.size or len(told) < len(cells) or (steps <= 0).any():
        return None
    sizes, counts = np.unique(steps, return_counts=True)
    step = float(sizes[counts.argmax()])
    if 2 * counts.max() <= steps.size or (steps % step).any():
        return None
    holes = np.flatnonzero(steps > step)
    return (float(told[holes[0]]), float(told[holes[0] + 1]), step) if holes.size else None


def lie_apart(cells: Sequence[str], time_zone: str | None) -> bool:
    """Whether times are further apart than the samples of one impact are."""
    told = list(dict.fromkeys(filter(None, map(said, cells))))
    if len(told) < 2:
        return False
    most = longest_s(len(cells))
    if all(map(is_written_number, told)):
        stamps = numbers_said(cells)
        fall = any(after < before for before, after in pairwise(stamps))
        return fall or (len(told) * STAY <= len(cells) and stamps[-1] - stamps[0] > most)
    if all(map(_DATE.fullmatch, told)):
        return True
    moments = [when for text in told if (when := moment_of(text, time_zone)) is not None]
    if len(moments) == len(told):
        return span_s(moments) > most
    clocks = [_CLOCK.search(text) for text in told]
    read = [clock for clock in clocks if clock is not None]
    if len(read) == len(told):
        days = {text.replace(clock[0], "") for text, clock in zip(told, read, strict=True)}
        seconds = [_seconds(clock) for clock in read]
        return len(days) > 1 or max(seconds) - min(seconds) > most
    return len(told) * STAY <= len(cells)


def longest_s(samples: int) -> float:
    """How long so many samples of one impact may last, by times that are rounded [s]."""
    return samples / MIN_RATE_HZ + ROUNDED_TO_S


def _seconds(clock: re.Match[str]) -> float:
    """A time of day, or what of it a spreadsheet left: minutes and seconds."""
    hours, minutes, seconds = clock.groups()
    return 3600.0 * float(hours or 0) + 60.0 * float(minutes) + float(seconds.replace(",", "."))


def span_s(moments: Sequence[datetime]) -> float:
    """From the first to the last [s]."""
    return (max(moments) - min(moments)).total_seconds()


def moment_of(text: str, time_zone: str | None, order: DateOrder | None = None) -> datetime | None:
    """A date with its time, in any zone; None for anything else."""
    try:
        return instant(year_first(text, order), time_zone or "UTC")
    except TimeError:
        return None
