"""Zero-phase low-pass filters: the paper's, a given cut-off, and SAE J211's channel frequency classes.

All are second-order Butterworth filters run forward and backward. They differ in their corner:

* a cut-off f in Hz (the paper's 300 Hz and 184 Hz): the corner is placed so that the gain of *both* passes at f is
  1/sqrt(2). A Butterworth filter designed at f and run twice would be at 1/2 there.
* a channel frequency class (SAE J211-1): corner at 2.0775 times the class.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import atan, pi, sqrt, tan

import numpy as np
from numpy.typing import NDArray

from headimpact.published import FILTERS

FloatArray = NDArray[np.float64]

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


def low_pass(x: FloatArray, corner_hz: float, sample_rate_hz: float) -> FloatArray:
    """Filter every record forward and backward.

    Equal to ``scipy.signal.sosfiltfilt`` of ``butter(2, corner_hz)`` with odd extension by min(9, n - 1) samples; the
    design is kept between calls, which is most of that function's cost.

    Parameters
    ----------
    x
        Samples, time on the last axis.
    corner_hz
        The Butterworth corner [Hz], from :func:`corner_frequency`.
    sample_rate_hz
        Samples per second [Hz].
    """
    from scipy import signal  # its import costs more than all else here: only who filters waits for it

    b, a, zi = _design(corner_hz, sample_rate_hz)
    margin = min(9, x.shape[-1] - 1)
    extended = _odd_extension(x, margin)
    forward, _ = signal.lfilter(b, a, extended, zi=zi * extended[..., :1])
    backward, _ = signal.lfilter(b, a, forward[..., ::-1], zi=zi * forward[..., -1:])
    filtered: FloatArray = backward[..., ::-1][..., margin : margin + x.shape[-1]]
    return filtered


@lru_cache(maxsize=256)
def _design(corner_hz: float, sample_rate_hz: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    from scipy import signal

    b, a = signal.butter(2, corner_hz, fs=sample_rate_hz)
    return b, a, signal.lfilter_zi(b, a)


def _odd_extension(x: FloatArray, count: int) -> FloatArray:
    """Mirror each record through its end points, so that the filter meets no step there."""
    n = x.shape[-1]
    extended = np.empty((*x.shape[:-1], n + 2 * count))
    extended[..., count : count + n] = x
    np.subtract(2 * x[..., :1], x[..., count:0:-1], out=extended[..., :count])
    np.subtract(2 * x[..., -1:], x[..., -2 : -count - 2 : -1], out=extended[..., count + n :])
    return extended
