"""What headings of times say: the unit, and the sensor where it has times of its own."""

from __future__ import annotations

import re

from headimpact.recording import SignalName
from headimpact_service.ingest.spelling import unit_ending, unit_spelled

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")
_TIMES = frozenset({"t", "time", "times", "stamp", "timestamp", "timestamps", "elapsed", "zeit", "temps", "tiempo"})
_RATES = frozenset(
    {"rate", "frequency", "freq", "fs", "hz", "khz", "dt", "step", "interval", "period", "tvec", "tms", "ts"}
)
_FILTERS = frozenset({"filter", "cut", "cutoff", "corner", "lowpass", "heart"})
_SENSORS: dict[SignalName, frozenset[str]] = {
    "linear_acceleration": frozenset({"acc", "accel", "accelerometer", "lin", "linear"}),
    "angular_velocity": frozenset({"gyr", "gyro", "gyroscope", "ang", "angular", "rot", "rotational", "ars", "omega"}),
}
"""Words for the sensor of a signal, in headings of its times."""


def speaks_of_times(heading: str) -> bool:
    """Whether a heading may be that of times or of a rate of the samples, in whatever unit."""
    words = _words(heading)
    return bool(words & (_TIMES | _RATES)) and not words & _FILTERS


def unit_of_times(heading: str, beside: str | None) -> str | None:
    """The unit of the times that a column holds, as its heading and the unit beside it say; None where they do not."""
    unit = unit_spelled("time", beside) or unit_ending("time", heading)
    return unit if unit is not None and _words(heading) & _TIMES else None


def sensor_of_times(heading: str) -> SignalName | None:
    """The signal whose sensor a heading of times names."""
    words = _words(heading)
    named = [signal for signal, spelled in _SENSORS.items() if words & spelled]
    return named[0] if len(named) == 1 else None


def _words(heading: str) -> set[str]:
    return {word.lower() for word in _WORD.findall(heading)}
