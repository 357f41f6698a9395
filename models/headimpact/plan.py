"""What is done to recordings of one layout, worked out once: units, filters, axes, time base, what is derived."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf

import numpy as np

from headimpact.cut_offs import PAPER, AppliedFilter, CutOff, LowPass, corner_frequency
from headimpact.errors import TraceError
from headimpact.published import FILTERS
from headimpact.quality import AXES, Channel, QualityNote, check_rate, words
from headimpact.recording import SIGNALS, TO_CRITERIA_UNIT, FloatArray, SignalName
from headimpact.screening import Screen
from headimpact.time_base import TimeBase, Track, common_time_base
from headimpact.uniform import Layout, MountingNumbers, SignalLayout

# Components that a plane of motion leaves: (linear axes, rotation axes).
PLANES: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "sagittal": ((0, 2), (1,)),
    "coronal": ((1, 2), (0,)),
    "axial": ((0, 1), (2,)),
}


@dataclass(frozen=True)
class Group:
    """Signals of equal length, which are looked at together: their places in the layout, and their screen."""

    members: tuple[int, ...]
    screen: Screen


@dataclass(frozen=True)
class SignalPlan:
    """What is done to one signal as sent: the factor to the criteria's unit, the corner of its filter [Hz], if any."""

    name: SignalName
    factor: float
    rate_hz: float
    corner_hz: float | None


@dataclass(frozen=True)
class Frame:
    """How one signal comes to head axes: rotation, and which components a plane of motion removes.

    `may_rest`: the channels as sent that show nothing of a motion in that plane; of a turned sensor that may be any.
    """

    rotation: FloatArray | None
    removed: tuple[int, ...]
    may_rest: tuple[int, ...] = ()


@dataclass(frozen=True)
class Plan:
    """What is done to every recording of one layout.

    `signals` are those of the layout, in its order; `tracks` those that come of it, with what is derived, before they
    are brought to their `base`; `comparison` is the time base of a supplied angular acceleration and the derivative of
    the velocity.
    """

    layout: Layout
    groups: tuple[Group, ...]
    signals: tuple[SignalPlan, ...]
    filters: tuple[AppliedFilter, ...]
    notes: tuple[QualityNote, ...]
    tracks: dict[SignalName, Track]
    angular_velocity_source: str | None
    angular_acceleration_source: str | None
    mirrored: bool
    frames: dict[SignalName, Frame]
    base: TimeBase
    comparison: TimeBase | None
    offset_m: FloatArray | None
    start_time_ms: float
    units_plan: Plan | None
    """Where a signal is not filtered, how its motion is filtered to be looked at for a wrong unit."""


@lru_cache(maxsize=512)
def plan_of(layout: Layout) -> Plan:
    """The plan of a layout.

    Raises
    ------
    TraceError
        Its signals do not overlap, or an acceleration cannot be moved without rotation.
    """
    notes: list[QualityNote] = []
    for signal in layout.signals:
        notes += check_rate(signal.name, signal.track.rate_hz)
    notes += _trigger_notes(layout)
    signals, filters = _filters(layout, notes)
    tracks, velocity_source, acceleration_source = _held_tracks(layout, notes)
    comparison = None
    if velocity_source == acceleration_source == "supplied":
        rotation: tuple[SignalName, ...] = ("angular_velocity", "angular_acceleration")
        comparison = common_time_base({name: tracks[name] for name in rotation})
    in_time = {name: _undelayed(name, track, layout.mounting) for name, track in tracks.items()}
    base = common_time_base(in_time)
    return Plan(
        layout=layout,
        groups=_groups(layout),
        signals=signals,
        filters=filters,
        notes=tuple(notes),
        tracks=tracks,
        angular_velocity_source=velocity_source,
        angular_acceleration_source=acceleration_source,
        mirrored=layout.axes == "sae_j211",
        frames={name: _frame(name, layout) for name in tracks},
        base=base,
        comparison=comparison,
        offset_m=_offset(layout, tracks),
        start_time_ms=(base.start_s - layout.clock_start_s) * 1000.0 - (layout.pre_trigger_ms or 0.0),
        units_plan=_units_plan(layout, tracks),
    )


def _units_plan(layout: Layout, tracks: dict[SignalName, Track]) -> Plan | None:
    """The plan with the paper's filter for each signal that has none; None where all have one, or nothing compares."""
    chosen, recorded = layout.low_pass, {signal.name for signal in layout.signals}
    bare = chosen.linear_acceleration is None or (chosen.angular_velocity is None and "angular_velocity" in recorded)
    if not bare or not {"linear_acceleration", "angular_acceleration"} <= set(tracks):
        return None
    filtered = LowPass(
        PAPER.linear_acceleration if chosen.linear_acceleration is None else chosen.linear_acceleration,
        PAPER.angular_velocity if chosen.angular_velocity is None else chosen.angular_velocity,
    )
    return plan_of(replace(layout, low_pass=filtered))


def _trigger_notes(layout: Layout) -> Iterator[QualityNote]:
    """Stamps that go through zero at another time than the trigger is said to be."""
    stamped = [signal.track for signal in layout.signals if not signal.track.stated]
    said = layout.pre_trigger_ms
    if said is None or not stamped or layout.clock_start_s >= 0.0:
        return
    ends = max(track.start_s + (track.samples - 1) / track.rate_hz for track in stamped)
    before, step = -1000.0 * layout.clock_start_s, 1000.0 / min(track.rate_hz for track in stamped)
    if ends >= 0.0 and abs(said - before) > step:
        detail = (
            f"The time stamps begin {before:g} ms before zero, and the trigger is said to be {said:g} ms after the "
            "first sample, which was taken."
        )
        yield QualityNote("time_origin_mismatch", "note", detail)


def _groups(layout: Layout) -> tuple[Group, ...]:
    lengths = dict.fromkeys(signal.track.samples for signal in layout.signals)
    groups = []
    for length in lengths:
        members = tuple(i for i, signal in enumerate(layout.signals) if signal.track.samples == length)
        groups.append(Group(members, Screen.of(channels_of([layout.signals[i] for i in members]))))
    return tuple(groups)


def channels_of(signals: list[SignalLayout]) -> list[Channel]:
    """The channels of signals, with the declared range in the criteria's unit; infinite where none is declared."""
    return [Channel(signal.name, axis, _full_scale(signal)) for signal in signals for axis in AXES]


def _full_scale(signal: SignalLayout) -> float:
    return inf if signal.declared_range is None else signal.declared_range * TO_CRITERIA_UNIT[signal.unit]


def _filters(layout: Layout, notes: list[QualityNote]) -> tuple[tuple[SignalPlan, ...], tuple[AppliedFilter, ...]]:
    """Each recorded signal is low-passed at its own rate; supplied angular acceleration is used as it is."""
    choices: dict[SignalName, CutOff] = {
        "linear_acceleration": layout.low_pass.linear_acceleration,
        "angular_velocity": layout.low_pass.angular_velocity,
    }
    signals, filters = [], []
    for signal in layout.signals:
        applied = _applied_filter(signal, choices.get(signal.name), notes)
        corner = None if applied is None else applied.corner_hz
        signals.append(SignalPlan(signal.name, TO_CRITERIA_UNIT[signal.unit], signal.track.rate_hz, corner))
        if applied is not None:
            filters.append(applied)
    return tuple(signals), tuple(filters)


def _applied_filter(signal: SignalLayout, cut_off: CutOff, notes: list[QualityNote]) -> AppliedFilter | None:
    if cut_off is None:
        return None
    name, rate = signal.name, signal.track.rate_hz
    corner = corner_frequency(cut_off, rate)
    label = cut_off if isinstance(cut_off, str) else f"{cut_off:g} Hz"
    if corner is None:
        detail = f"The {words(name)} was not filtered: its rate of {rate:.6g} Hz cannot carry {label}."
        notes.append(QualityNote("filter_skipped", "warning", detail, name))
        return AppliedFilter(name, cut_off, None, applied=False)
    if isinstance(cut_off, str) and rate < FILTERS["channel_frequency_class_rate"] * float(cut_off[3:]):
        detail = (
            f"The {words(name)} was sampled at {rate:.6g} Hz, under {FILTERS['channel_frequency_class_rate']} times "
            f"the class {label}."
        )
        notes.append(QualityNote("low_rate_for_class", "note", detail, name))
    return AppliedFilter(name, cut_off, corner, applied=True)


def _held_tracks(layout: Layout, notes: list[QualityNote]) -> tuple[dict[SignalName, Track], str | None, str | None]:
    """The signals with what one rotation signal says of the other, and where velocity and acceleration come from."""
    tracks = {signal.name: signal.track for signal in layout.signals}
    velocity, acceleration = "angular_velocity" in tracks, "angular_acceleration" in tracks
    if not velocity and not acceleration:
        return tracks, None, None
    sources = ("supplied" if velocity else "integral", "supplied" if acceleration else "five_point_stencil")
    if not velocity:
        tracks["angular_velocity"] = tracks["angular_acceleration"]
        detail = "No angular velocity was recorded; it is the integral of the angular acceleration, zero at the start."
        notes.append(QualityNote("angular_velocity_integrated", "note", detail, "angular_velocity"))
    if not acceleration:
        tracks["angular_acceleration"] = tracks["angular_velocity"]
    return {name: tracks[name] for name in SIGNALS if name in tracks}, *sources


def _undelayed(name: SignalName, track: Track, mounting: MountingNumbers | None) -> Track:
    """A signal at the time of the motion rather than at that of its sensor's samples."""
    if mounting is None:
        return track
    linear = name == "linear_acceleration"
    delay_s = mounting.accelerometer_delay_s if linear else mounting.gyroscope_delay_s
    return replace(track, start_s=track.start_s - delay_s)


def _frame(name: SignalName, layout: Layout) -> Frame:
    linear = name == "linear_acceleration"
    rotation = None
    if layout.mounting is not None:
        numbers = layout.mounting.accelerometer_rotation if linear else layout.mounting.gyroscope_rotation
        rotation = np.array(numbers).reshape(3, 3)
    if layout.constrained_plane is None:
        return Frame(rotation, ())
    kept = PLANES[layout.constrained_plane][0 if linear else 1]
    removed = tuple(axis for axis in range(3) if axis not in kept)
    return Frame(rotation, removed, removed if rotation is None else (0, 1, 2))


def _offset(layout: Layout, tracks: dict[SignalName, Track]) -> FloatArray | None:
    """The accelerometer's place, where its acceleration is to be moved to the centre of gravity."""
    if layout.mounting is None or "linear_acceleration" not in tracks or not any(layout.mounting.offset_m):
        return None
    if "angular_velocity" not in tracks:
        raise TraceError(
            "no-rotation-for-transfer",
            "Moving the acceleration to the head's centre of gravity needs the angular velocity or acceleration.",
            signal="angular_velocity",
        )
    return np.array(layout.mounting.offset_m)
