"""The EV5 file of an NHTSA crash test: which curve is which channel, and what the laboratory says of each.

Sections open with ``----- NAME -----``; a row is fields parted by ``|``, by position (NHTSA Test Reference Guide,
volume 1). Only what scoring needs is read: the head's channels and the laboratory's own HIC.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from headimpact.recording import SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.spelling import unit_spelled

HEAD_CG = "HDCG"
INVALID = {
    "CF": "CF: channel failed",
    "MD": "MD: meaningless data",
    "NO": "NO: no data",
    "SF": "SF: system failed",
}
"""Statuses of a channel whose data its laboratory does not let stand."""
DOUBTFUL = {"QD": "QD: questionable data"}
SOUND = frozenset({"", "AM", "CM", "LN", "SC"})
"""As measured, computed, linearised or scaled; or nothing said."""

_SECTION = re.compile(r"-{3,}\s*([A-Z0-9 ]+?)\s*-{3,}")
_TEST_NUMBER = re.compile(r"#.*Test Number:\s*([0-9]{1,8})\s*$", re.MULTILINE)
_SIGNALS: dict[str, SignalName] = {"AC": "linear_acceleration", "AV": "angular_velocity"}
RESULTANT = "resultant"
_AXES = {"XL": "x", "YL": "y", "ZL": "z", "RS": RESULTANT}
_UNITS = {"linear_acceleration": {"G'S": "g"}, "angular_velocity": {"DPS": "deg/s"}}
_CHANNEL_FIELDS, _OCCUPANT_FIELDS = 19, 35


@dataclass(frozen=True, slots=True, order=True)
class Occupant:
    """Whose head: a vehicle and a seat of it."""

    vehicle: str
    seat: str


@dataclass(frozen=True, slots=True)
class Channel:
    """One head channel; its axis may be :data:`RESULTANT`."""

    occupant: Occupant
    signal: SignalName
    axis: str
    curve: int
    unit: str | None
    full_scale: float | None
    points: int | None
    first: int | None
    step_us: float | None
    status: str
    primary: bool

    @property
    def valid(self) -> bool:
        """Whether its laboratory lets its data stand."""
        return self.status not in INVALID

    @property
    def named(self) -> str:
        """The channel as a message names it."""
        return f"{self.signal} {self.axis} (curve {self.curve:03d})"


@dataclass(frozen=True, slots=True)
class CrashTest:
    """What an EV5 file says of the heads in one test."""

    number: str | None
    channels: tuple[Channel, ...]
    laboratory: dict[Occupant, dict[str, Any]]


def read_header(data: bytes) -> CrashTest:
    """An EV5 file; 422 where it has no rows of instrumentation or one of the head's cannot be read."""
    text = data.decode("latin-1")
    sections = _sections(text)
    if "INSTRUMENTATION" not in sections:
        raise Problem("unreadable-file", "The EV5 file has no section INSTRUMENTATION.")
    channels = (_channel(row) for row in sections["INSTRUMENTATION"])
    number = _TEST_NUMBER.search(text)
    return CrashTest(
        number=None if number is None else number[1],
        channels=tuple(channel for channel in channels if channel is not None),
        laboratory=dict(_laboratory(row) for row in sections.get("OCCUPANT", []) if len(row) >= _OCCUPANT_FIELDS),
    )


def _sections(text: str) -> dict[str, list[list[str]]]:
    sections: dict[str, list[list[str]]] = {}
    rows: list[list[str]] = []
    for line in text.splitlines():
        opening = _SECTION.fullmatch(line.strip())
        if opening is not None:
            rows = sections.setdefault(opening[1], [])
        elif line.strip():
            rows.append([field.strip() for field in line.split("|")])
    return sections


def _channel(row: list[str]) -> Channel | None:
    """The row's channel, if it is one of a head's centre of gravity."""
    if len(row) < _CHANNEL_FIELDS or row[4] != HEAD_CG or row[2] not in _SIGNALS or row[5] not in _AXES:
        return None
    signal = _SIGNALS[row[2]]
    first, last = _whole(row[14]), _whole(row[15])
    curve = _whole(row[1])
    if curve is None:
        raise Problem("unreadable-file", "A head channel of the EV5 file has no curve number.")
    return Channel(
        occupant=Occupant(vehicle=row[0], seat=row[3]),
        signal=signal,
        axis=_AXES[row[5]],
        curve=curve,
        unit=_UNITS[signal].get(row[7].upper()) or unit_spelled(signal, row[7]),
        full_scale=_positive(row[11]),
        points=None if first is None or last is None else last - first + 1,
        first=first,
        step_us=_positive(row[16]),
        status=row[17].upper(),
        primary=row[18].upper() == "P",
    )


def _laboratory(row: list[str]) -> tuple[Occupant, dict[str, Any]]:
    """The laboratory's own HIC and its window [ms]."""
    found = {"hic": _positive(row[32]), "t1_ms": _number(row[33]), "t2_ms": _number(row[34])}
    return Occupant(vehicle=row[0], seat=row[1]), {name: value for name, value in found.items() if value is not None}


def _whole(text: str) -> int | None:
    return int(text) if re.fullmatch(r"[+-]?[0-9]{1,9}", text) else None


def _number(text: str) -> float | None:
    return float(text) if re.fullmatch(r"[+-]?[0-9]{1,12}(\.[0-9]{0,12})?", text, re.ASCII) else None


def _positive(text: str) -> float | None:
    number = _number(text)
    return number if number is not None and number > 0 else None
