"""Units as headings and cells write them, those among them that are so many of one that an impact may have."""

from __future__ import annotations

from functools import cache

from headimpact.recording import SIGNALS
from headimpact_service.ingest.spelling import compact, ending, spellings_of

SCALED_UNITS: dict[str, tuple[str, float]] = {
    "mg": ("g", 1e-3),
    "cm/s^2": ("m/s^2", 1e-2),
    "mm/s^2": ("m/s^2", 1e-3),
    "ft/s^2": ("m/s^2", 0.3048),
    "mrad/s": ("rad/s", 1e-3),
    "mdeg/s": ("deg/s", 1e-3),
    "rpm": ("deg/s", 6.0),
    "krad/s^2": ("rad/s^2", 1e3),
    "kdeg/s^2": ("deg/s^2", 1e3),
}
"""Units that a sensor's own numbers may be in, each as so many of one that an impact may have."""
_PREFIXES = {"m": "m", "milli": "m", "milli ": "m", "milli-": "m", "k": "k", "kilo": "k", "c": "c", "centi": "c"}
SHORTEST = 2
"""Characters of a unit that is told wherever it ends a heading: a lone g may be part of a name."""


def unit_written(heading: str) -> set[str] | None:
    """The units that a heading ends in, as a mapping names them: one may be spelled like that of another quantity.

    None where it ends in none that is known.
    """
    bracketed = heading.rstrip()[-1:] in {")", "]"}
    found = [(len(spelling), unit) for _, spelling, unit in ending(heading, _spellings())]
    longest = max((length for length, _ in found), default=0)
    if longest < (1 if bracketed else SHORTEST):
        return None
    return {unit for length, unit in found if length == longest}


@cache
def known_units() -> frozenset[str]:
    """Every spelling of a unit of time or of a signal, as :func:`compact` has it."""
    of_times = (spelling for _, spellings in spellings_of("time") for spelling in spellings)
    return frozenset(map(compact, (*of_times, *(spelling for spelling, _ in _spellings()))))


@cache
def _spellings() -> tuple[tuple[str, str], ...]:
    """Every spelling of a unit of a signal, with a prefix and without, and the unit."""
    found: dict[tuple[str, str], None] = dict.fromkeys(
        (
            *((spelling, "rpm") for spelling in ("rpm", "r/min", "rev/min", "1/min")),
            ("ft/s2", "ft/s^2"),
            ("ft/s/s", "ft/s^2"),
        )
    )
    for unit, spellings in (one for signal in SIGNALS for one in spellings_of(signal)):
        for spelling in spellings:
            found[spelling, unit] = None
            scaled = ((prefix + spelling, sign + unit) for prefix, sign in _PREFIXES.items())
            found |= dict.fromkeys((spelled, of) for spelled, of in scaled if of in SCALED_UNITS)
    return tuple(found)
