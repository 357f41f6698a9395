"""Which low-pass filter each recorded signal gets, and where its corner lies.

All are second-order Butterworth filters run forward and backward. They differ in their corner:

* a cut-off f in Hz (the paper's 300 Hz and 184 Hz): the corner is placed so that the gain of *both* passes at f is
  1/sqrt(2). A Butterworth filter designed at f and run twice would be at 1/2 there.
* a channel frequency class (SAE J211-1): corner at 2.0775 times the class.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, pi, sqrt, tan

from headimpact.published import FILTERS

CHANNEL_FREQUENCY_CLASSES: dict[str, float] = {
    name: float(hertz) for name, hertz in FILTERS["channel_frequency_classes"].items()
}
CutOff = float | str | None


@dataclass(frozen=True, slots=True)
class LowPass:
    """Which low-pass filter each recorded signal gets: a cut-off [Hz], a class such as ``"CFC180"``, or None."""

    linear_acceleration: CutOff = None
    angular_velocity: CutOff = None
    name: str = "custom"


PAPER = LowPass(
    linear_acceleration=float(FILTERS["paper"]["linear_acceleration_hz"]),
    angular_velocity=float(FILTERS["paper"]["angular_velocity_hz"]),
    name="paper",
)
NO_FILTER = LowPass(name="none")


@dataclass(frozen=True, slots=True)
class AppliedFilter:
    """What was done to one signal: `corner_hz` is the design frequency of the Butterworth filter, None if skipped."""

    signal: str
    cut_off: float | str
    corner_hz: float | None
    applied: bool


def corner_frequency(cut_off: float | str, sample_rate_hz: float) -> float | None:
    """The Butterworth corner [Hz] for a cut-off or class at a sampling rate; None where the rate cannot carry it."""
    if isinstance(cut_off, str):
        corner = float(FILTERS["channel_frequency_class_corner"]) * CHANNEL_FREQUENCY_CLASSES[cut_off]
        return corner if corner < sample_rate_hz / 2 else None
    if cut_off >= sample_rate_hz / 2:
        return None
    return (sample_rate_hz / pi) * atan(tan(pi * cut_off / sample_rate_hz) / (sqrt(2.0) - 1.0) ** 0.25)
