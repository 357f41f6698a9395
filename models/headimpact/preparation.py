"""From a recording as sent to the motion of the head's centre of gravity.

The order of work is fixed, so that two implementations agree: units; uniform samples; filter and differentiation at
each signal's own rate; axes and rotation; one time base; transfer to the centre of gravity.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil, floor, inf, radians

import numpy as np

from headimpact.errors import TraceError
from headimpact.filtering import AppliedFilter, CutOff, corner_frequency, low_pass
from headimpact.gaps import fill_gaps
from headimpact.kinematics import (
    STANDARD_GRAVITY,
    FloatArray,
    HeadKinematics,
    differentiate,
    running_integral,
    transfer_to_head_cg,
)
from headimpact.published import FILTERS, QUALITY_LIMITS
from headimpact.quality import (
    AXES,
    Channel,
    QualityNote,
    check_angular_acceleration,
    check_channels,
    check_identical,
    check_rate,
    words,
)
from headimpact.record_rules import rate_of, require_derived_within, require_motion, require_within
from headimpact.recording import Mounting, Recording, Signal, SignalName

TO_CRITERIA_UNIT: dict[str, float] = {
    "g": 1.0,
    "m/s^2": 1.0 / STANDARD_GRAVITY,
    "rad/s": 1.0,
    "deg/s": radians(1.0),
    "rad/s^2": 1.0,
    "deg/s^2": radians(1.0),
}
# Components that a plane of motion leaves: (linear axes, rotation axes).
PLANES: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "sagittal": ((0, 2), (1,)),
    "coronal": ((1, 2), (0,)),
    "axial": ((0, 1), (2,)),
}
SAE_J211_TO_ANATOMICAL: FloatArray = np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True)
class Preparation:
    """A recording made ready for scoring, with what was done to it."""

    kinematics: HeadKinematics
    filters: tuple[AppliedFilter, ...]
    notes: tuple[QualityNote, ...]
    angular_velocity_source: str | None
    angular_acceleration_source: str | None
    pre_trigger_known: bool


@dataclass(frozen=True, slots=True)
class _Uniform:
    """A signal on uniform samples: `start_s` is its first sample's time on the clock the signals share."""

    values: FloatArray
    rate: float
    start_s: float


def prepare(recording: Recording) -> Preparation:
    """Convert, resample, filter, differentiate, rotate and transfer a recording to the head's centre of gravity.

    Raises
    ------
    TraceError
        The recording breaks a rule; its code, signal, channel and sample say which and where.
    """
    notes: list[QualityNote] = []
    if recording.fill_gaps:
        recording = _without_gaps(recording, notes)
    signals = recording.signals()
    if not signals:
        raise TraceError("no-signal", "A recording needs linear acceleration, angular velocity or both.")
    require_motion(signals)
    clock_start_s = min((float(s.time_s[0]) for _, s in signals if s.time_s is not None), default=0.0)
    sent = {name: _uniform(name, signal, clock_start_s, notes) for name, signal in signals}
    notes += _notes_as_sent(recording, sent)
    filtered, filters = _filtered(recording, sent, notes)
    sources = _with_derived(filtered, sent, notes)
    in_head = {name: _to_head_axes(name, signal, recording) for name, signal in filtered.items()}
    if recording.mounting is not None:
        in_head = {name: _undelayed(name, signal, recording.mounting) for name, signal in in_head.items()}
    if recording.constrained_plane is not None:
        in_head = {name: _constrain(name, s, recording.constrained_plane, notes) for name, s in in_head.items()}
    rate, start_s, aligned = _one_time_base(in_head)
    if sources[1] == "five_point_stencil":
        require_derived_within(aligned["angular_acceleration"])
    aligned = _at_head_cg(aligned, recording)
    start_ms = (start_s - clock_start_s) * 1000.0 - (recording.pre_trigger_ms or 0.0)
    kinematics = HeadKinematics(
        sample_rate_hz=rate,
        linear_acceleration_g=aligned.get("linear_acceleration"),
        angular_velocity=aligned.get("angular_velocity"),
        angular_acceleration=aligned.get("angular_acceleration"),
        start_time_ms=start_ms,
    )
    return Preparation(kinematics, filters, tuple(notes), *sources, recording.pre_trigger_ms is not None)


def _without_gaps(recording: Recording, notes: list[QualityNote]) -> Recording:
    """The recording with its short gaps filled, each signal's noted."""
    filled: dict[SignalName, Signal] = {}
    for name, signal in recording.signals():
        filled[name], count = fill_gaps(signal)
        if count:
            detail = f"{count} missing samples of the {words(name)} were filled by interpolation."
            notes.append(QualityNote("gaps_filled", "note", detail, name))
    return replace(recording, **filled)  # type: ignore[arg-type] # the keys are its fields


def _uniform(name: SignalName, signal: Signal, clock_start_s: float, notes: list[QualityNote]) -> _Uniform:
    """A signal in the criteria's unit on uniform samples."""
    factor = TO_CRITERIA_UNIT[signal.unit]
    # by component: every filter, maximum and sum over time is then contiguous
    values = np.asfortranarray(signal.values, dtype=np.float64)
    if factor != 1.0:
        values = values * factor
    require_within(name, values)
    if signal.time_s is None:
        assert signal.sample_rate_hz is not None
        rate, start_s = float(signal.sample_rate_hz), clock_start_s
    else:
        rate, start_s = rate_of(name, signal.time_s), float(signal.time_s[0])
        values = _resampled(name, values, signal.time_s, rate, notes)
    limits = QUALITY_LIMITS["record"]
    if not limits["minimum_rate_hz"] <= rate <= limits["maximum_rate_hz"]:
        raise TraceError(
            "sample-rate",
            f"The {words(name)} must be sampled at {limits['minimum_rate_hz']:g} to {limits['maximum_rate_hz']:g} Hz.",
            signal=name,
        )
    notes += check_rate(name, rate)
    return _Uniform(values, rate, start_s)


def _resampled(
    name: SignalName, values: FloatArray, time_s: FloatArray, rate: float, notes: list[QualityNote]
) -> FloatArray:
    """Linear interpolation onto n equal steps from the first stamp to the last, where the stamps are not equal."""
    steps = np.diff(time_s)
    jitter = float(np.abs(steps * rate - 1.0).max())
    if jitter <= QUALITY_LIMITS["record"]["uniform_jitter"]:
        return values
    notes.append(
        QualityNote(
            "resampled",
            "note",
            f"The time stamps of the {words(name)} jitter by up to {jitter:.2%} of a step; it was resampled to "
            f"{rate:.6g} Hz.",
            name,
        )
    )
    even = np.linspace(time_s[0], time_s[-1], time_s.size)
    return np.stack([np.interp(even, time_s, values[:, axis]) for axis in range(3)], axis=1)


def _notes_as_sent(recording: Recording, sent: dict[SignalName, _Uniform]) -> Iterator[QualityNote]:
    """Notes on every channel; those of equal length are checked together."""
    by_length: dict[int, list[tuple[SignalName, Signal]]] = {}
    for name, signal in recording.signals():
        by_length.setdefault(signal.values.shape[0], []).append((name, signal))
    for signals in by_length.values():
        channels = [Channel(name, axis, _full_scale(signal)) for name, signal in signals for axis in AXES]
        # transposed and back: stacked by component
        samples = np.concatenate([sent[name].values.T for name, _ in signals]).T
        yield from check_channels(channels, samples, recording.constrained_plane is not None)
    if "linear_acceleration" in sent:
        for rotation in ("angular_velocity", "angular_acceleration"):
            if rotation in sent:
                yield from check_identical(
                    ("linear_acceleration", sent["linear_acceleration"].values), (rotation, sent[rotation].values)
                )


def _full_scale(signal: Signal) -> float:
    """The declared range in the criteria's unit; infinite where none is declared."""
    return inf if signal.declared_range is None else signal.declared_range * TO_CRITERIA_UNIT[signal.unit]


def _filtered(
    recording: Recording, sent: dict[SignalName, _Uniform], notes: list[QualityNote]
) -> tuple[dict[SignalName, _Uniform], tuple[AppliedFilter, ...]]:
    """Each signal low-passed at its own rate; supplied angular acceleration is used as it is."""
    filters: list[AppliedFilter] = []
    filtered = dict(sent)
    choices: dict[SignalName, CutOff] = {
        "linear_acceleration": recording.low_pass.linear_acceleration,
        "angular_velocity": recording.low_pass.angular_velocity,
    }
    for name, cut_off in choices.items():
        if name in sent and cut_off is not None:
            filtered[name], done = _filter_one(name, sent[name], cut_off, notes)
            filters.append(done)
    return filtered, tuple(filters)


def _filter_one(
    name: SignalName, signal: _Uniform, cut_off: float | str, notes: list[QualityNote]
) -> tuple[_Uniform, AppliedFilter]:
    corner = corner_frequency(cut_off, signal.rate)
    label = cut_off if isinstance(cut_off, str) else f"{cut_off:g} Hz"
    if corner is None:
        notes.append(
            QualityNote(
                "filter_skipped",
                "warning",
                f"The {words(name)} was not filtered: its rate of {signal.rate:.6g} Hz cannot carry {label}.",
                name,
            )
        )
        return signal, AppliedFilter(name, cut_off, None, applied=False)
    if isinstance(cut_off, str) and signal.rate < FILTERS["channel_frequency_class_rate"] * float(cut_off[3:]):
        notes.append(
            QualityNote(
                "low_rate_for_class",
                "note",
                f"The {words(name)} was sampled at {signal.rate:.6g} Hz, under "
                f"{FILTERS['channel_frequency_class_rate']} times the class {label}.",
                name,
            )
        )
    values = low_pass(signal.values, corner, signal.rate)
    return replace(signal, values=values), AppliedFilter(name, cut_off, corner, applied=True)


def _with_derived(
    filtered: dict[SignalName, _Uniform],
    sent: dict[SignalName, _Uniform],
    notes: list[QualityNote],
) -> tuple[str | None, str | None]:
    """Add what one rotation signal says of the other; say where velocity and acceleration come from."""
    if "angular_velocity" not in sent:
        if "angular_acceleration" not in sent:
            return None, None
        alpha = sent["angular_acceleration"]
        filtered["angular_velocity"] = replace(alpha, values=running_integral(alpha.values, alpha.rate))
        notes.append(
            QualityNote(
                "angular_velocity_integrated",
                "note",
                "No angular velocity was recorded; it is the integral of the angular acceleration, zero at the start.",
                "angular_velocity",
            )
        )
        return "integral", "supplied"
    w = filtered["angular_velocity"]
    derived = replace(w, values=differentiate(w.values, w.rate))
    if "angular_acceleration" not in sent:
        filtered["angular_acceleration"] = derived
        return "supplied", "five_point_stencil"
    _, _, pair = _one_time_base({"angular_acceleration": sent["angular_acceleration"], "angular_velocity": derived})
    notes += check_angular_acceleration(pair["angular_acceleration"], pair["angular_velocity"])
    return "supplied", "supplied"


def _to_head_axes(name: SignalName, signal: _Uniform, recording: Recording) -> _Uniform:
    """Take SAE J211's axes to the anatomical ones, then rotate sensor axes to head axes."""
    values = signal.values
    if recording.axes == "sae_j211":
        values = values * SAE_J211_TO_ANATOMICAL
    if recording.mounting is not None:
        linear = name == "linear_acceleration"
        rotation = recording.mounting.accelerometer_rotation if linear else recording.mounting.gyroscope_rotation
        values = values @ rotation.T
    return signal if values is signal.values else replace(signal, values=values)


def _undelayed(name: SignalName, signal: _Uniform, mounting: Mounting) -> _Uniform:
    """A signal at the time of the motion rather than at that of its sensor's samples."""
    linear = name == "linear_acceleration"
    delay_s = mounting.accelerometer_delay_s if linear else mounting.gyroscope_delay_s
    return replace(signal, start_s=signal.start_s - delay_s) if delay_s else signal


def _constrain(name: SignalName, signal: _Uniform, plane: str, notes: list[QualityNote]) -> _Uniform:
    """Set the motion outside the recorded plane to zero."""
    linear, rotation = PLANES[plane]
    kept = linear if name == "linear_acceleration" else rotation
    values = np.zeros_like(signal.values)
    values[:, kept] = signal.values[:, kept]
    removed = float(np.abs(signal.values - values).max())
    if removed > 0:
        notes.append(
            QualityNote(
                "out_of_plane_removed",
                "note",
                f"The {words(name)} outside the {plane} plane, up to {removed:.4g}, was set to zero.",
                name,
            )
        )
    return replace(signal, values=values)


def _one_time_base(signals: dict[SignalName, _Uniform]) -> tuple[float, float, dict[str, FloatArray]]:
    """The samples of the highest-rate signal within the overlap of all; the others interpolated linearly onto them."""
    base = max(signals.values(), key=lambda signal: signal.rate)
    start = max(signal.start_s for signal in signals.values())
    stop = min(signal.start_s + (signal.values.shape[0] - 1) / signal.rate for signal in signals.values())
    # a thousandth of a step of slack, so that equal records do not lose a sample to rounding
    first = max(0, ceil((start - base.start_s) * base.rate - 1e-3))
    last = min(base.values.shape[0] - 1, floor((stop - base.start_s) * base.rate + 1e-3))
    if last - first + 1 < QUALITY_LIMITS["record"]["minimum_samples"]:
        raise TraceError("no-overlap", "The signals must overlap in time by at least 3 samples.")
    time_s = base.start_s + np.arange(first, last + 1) / base.rate
    aligned: dict[str, FloatArray] = {}
    for name, signal in signals.items():
        aligned[name] = _onto(signal, base, time_s, first, last)
    return base.rate, base.start_s + first / base.rate, aligned


def _onto(signal: _Uniform, base: _Uniform, time_s: FloatArray, first: int, last: int) -> FloatArray:
    alike = abs(signal.rate - base.rate) <= 1e-9 * base.rate and signal.start_s == base.start_s
    if alike:
        return signal.values[first : last + 1]
    position = (time_s - signal.start_s) * signal.rate
    grid = np.arange(signal.values.shape[0])
    return np.stack([np.interp(position, grid, signal.values[:, axis]) for axis in range(3)], axis=1)


def _at_head_cg(aligned: dict[str, FloatArray], recording: Recording) -> dict[str, FloatArray]:
    """Move the acceleration from the accelerometer to the centre of gravity."""
    mounting = recording.mounting
    if mounting is None or "linear_acceleration" not in aligned or not mounting.offset_m.any():
        return aligned
    if "angular_velocity" not in aligned:
        raise TraceError(
            "no-rotation-for-transfer",
            "Moving the acceleration to the head's centre of gravity needs the angular velocity or acceleration.",
            signal="angular_velocity",
        )
    moved = transfer_to_head_cg(
        aligned["linear_acceleration"],
        aligned["angular_velocity"],
        aligned["angular_acceleration"],
        mounting.offset_m,
    )
    return {**aligned, "linear_acceleration": moved}
