"""From a recording as sent to uniform samples: what is checked and evened out before anything is computed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from headimpact.cut_offs import LowPass
from headimpact.gaps import fill_gaps
from headimpact.published import QUALITY_LIMITS
from headimpact.quality import QualityNote, words
from headimpact.record_rules import rate_of, require_finite, require_form, require_rate, require_within
from headimpact.recording import TO_CRITERIA_UNIT, FloatArray, Mounting, Recording, Signal, SignalName
from headimpact.stamps import rounding_s
from headimpact.time_base import Track

Numbers = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class SignalLayout:
    """Everything about a signal but its samples."""

    name: SignalName
    unit: str
    track: Track
    declared_range: float | None


@dataclass(frozen=True, slots=True)
class MountingNumbers:
    """A mounting by its numbers, so that equal ones are equal."""

    accelerometer_rotation: Numbers
    gyroscope_rotation: Numbers
    offset_m: Numbers
    accelerometer_delay_s: float
    gyroscope_delay_s: float

    @classmethod
    def of(cls, mounting: Mounting) -> MountingNumbers:
        """The numbers of a mounting."""
        return cls(
            tuple(mounting.accelerometer_rotation.ravel().tolist()),
            tuple(mounting.gyroscope_rotation.ravel().tolist()),
            tuple(mounting.offset_m.tolist()),
            mounting.accelerometer_delay_s,
            mounting.gyroscope_delay_s,
        )


@dataclass(frozen=True, slots=True)
class Layout:
    """Everything about a recording but its samples: recordings of one layout are prepared together, in one way."""

    signals: tuple[SignalLayout, ...]
    clock_start_s: float
    axes: str
    mounting: MountingNumbers | None
    constrained_plane: str | None
    low_pass: LowPass
    pre_trigger_ms: float | None


@dataclass(frozen=True, slots=True)
class Uniform:
    """A recording on uniform samples: its layout, each signal's samples n x 3 in its own unit, and what was noted."""

    layout: Layout
    samples: tuple[FloatArray, ...]
    notes: tuple[QualityNote, ...]


def uniform(recording: Recording) -> Uniform:
    """The recording with its gaps filled, where that is asked for, and its jitter evened out.

    Raises
    ------
    TraceError
        The form of a signal, or its times, break a rule.
    """
    notes: list[QualityNote] = []
    if recording.fill_gaps:
        recording = _without_gaps(recording, notes)
    signals = recording.signals()
    require_form(signals)
    clock_start_s = min((float(s.time_s[0]) for _, s in signals if s.time_s is not None), default=0.0)
    layouts, samples = [], []
    for name, signal in signals:
        track, values = _track(name, signal, clock_start_s, notes)
        layouts.append(SignalLayout(name, signal.unit, track, signal.declared_range))
        samples.append(values)
    layout = Layout(
        signals=tuple(layouts),
        clock_start_s=clock_start_s,
        axes=recording.axes,
        mounting=None if recording.mounting is None else MountingNumbers.of(recording.mounting),
        constrained_plane=recording.constrained_plane,
        low_pass=recording.low_pass,
        pre_trigger_ms=recording.pre_trigger_ms,
    )
    return Uniform(layout, tuple(samples), tuple(notes))


def _without_gaps(recording: Recording, notes: list[QualityNote]) -> Recording:
    """The recording with its short gaps filled, each signal's noted."""
    filled: dict[SignalName, Signal] = {}
    for name, signal in recording.signals():
        filled[name], count = fill_gaps(signal)
        if count:
            detail = f"{count} missing samples of the {words(name)} were filled by interpolation."
            notes.append(QualityNote("gaps_filled", "note", detail, name))
    return replace(recording, **filled)  # type: ignore[arg-type] # the keys are its fields


def _track(
    name: SignalName, signal: Signal, clock_start_s: float, notes: list[QualityNote]
) -> tuple[Track, FloatArray]:
    """A signal's uniform times, and its samples at them."""
    values = signal.values
    if signal.time_s is None:
        assert signal.sample_rate_hz is not None
        rate, start_s = float(signal.sample_rate_hz), clock_start_s
    else:
        require_finite(name, values)
        require_within(name, values * TO_CRITERIA_UNIT[signal.unit])
        rate, start_s = rate_of(name, signal.time_s), float(signal.time_s[0])
        values = _resampled(name, values, signal.time_s, rate, notes)
    require_rate(name, rate)
    return Track(values.shape[0], rate, start_s, stated=signal.time_s is None), values


def _resampled(
    name: SignalName, values: FloatArray, time_s: FloatArray, rate: float, notes: list[QualityNote]
) -> FloatArray:
    """Linear interpolation onto n equal steps from the first stamp to the last, where the stamps are not equal."""
    jitter = float(np.abs(np.diff(time_s) * rate - 1.0).max())
    if jitter <= QUALITY_LIMITS["record"]["uniform_jitter"] + rounding_s(time_s) * rate:
        return values
    detail = (
        f"The time stamps of the {words(name)} jitter by up to {jitter:.2%} of a step; it was resampled to "
        f"{rate:.6g} Hz."
    )
    notes.append(QualityNote("resampled", "note", detail, name))
    even = np.linspace(time_s[0], time_s[-1], time_s.size)
    return np.stack([np.interp(even, time_s, values[:, axis]) for axis in range(3)], axis=1)
