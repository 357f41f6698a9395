"""Sheets or files that hold one sensor each: stored one by one they would be two impacts with half the motion each."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import PurePosixPath

from headimpact_service.errors import Problem
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.spelling import words_of

_LINEAR = frozenset({"acc", "accel", "accelerometer", "acceleration", "lin", "linear", "beschleunigung"})
_ROTATION = frozenset({"gyr", "gyro", "gyroscope", "ars", "ang", "angular", "rot", "rotation", "omega", "drehrate"})


class Apart:
    """What each sheet or file of an upload holds, as far as their names speak of a sensor."""

    def __init__(self, what: str) -> None:
        """`what` they are called: sheets, or files."""
        self._what = what
        self._linear: list[str] = []
        self._rotation: list[str] = []

    def add(self, name: str, found: Iterable[ImpactRecord | Problem]) -> None:
        """A sheet or a file, with its impacts."""
        words = set(words_of(PurePosixPath(name).stem))
        for item in found:
            signals = {signal for signal, _ in item.recording.signals()} if isinstance(item, ImpactRecord) else set()
            if signals == {"linear_acceleration"} and words & _LINEAR:
                self._linear.append(name)
                return
            if signals and "linear_acceleration" not in signals and words & _ROTATION:
                self._rotation.append(name)
                return

    def require_none(self) -> None:
        """Refuse an upload in which one holds the accelerometer and another the gyroscope."""
        if self._linear and self._rotation:
            raise Problem(
                "unreadable-file",
                f"The {self._what} {self._linear[0]} and {self._rotation[0]} hold a sensor each, and would be two "
                "impacts with half the motion each: put their columns side by side, each sensor's times before its "
                "own, or send them one by one if they are two.",
            )
