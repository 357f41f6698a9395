"""From recordings as sent to the motion of the head's centre of gravity.

The order of work is fixed, so that two implementations agree: units; uniform samples; filter and differentiation at
each signal's own rate; axes and rotation; one time base; transfer to the centre of gravity. Recordings of one layout
are worked on together; one recording is a block of one, on the same way.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from headimpact.cut_offs import AppliedFilter
from headimpact.errors import TraceError
from headimpact.filtering import low_pass
from headimpact.kinematics import (
    HeadKinematics,
    Motion,
    differentiate,
    empty_stack,
    rotated,
    running_integral,
    squared_norm,
    transfer_to_head_cg,
)
from headimpact.plan import Group, Plan, channels_of, plan_of
from headimpact.quality import (
    AXES,
    QualityNote,
    check_angular_acceleration,
    check_channels,
    check_cut_off,
    check_identical,
    highest_of,
    words,
)
from headimpact.record_rules import (
    derived_out_of_range,
    integrated_out_of_range,
    require_samples,
    transferred_out_of_range,
)
from headimpact.recording import FloatArray, Recording, SignalName
from headimpact.time_base import brought, kept_of
from headimpact.uniform import Layout, Uniform, uniform

# Impacts that are worked on at once: enough to spread NumPy's cost per call, few enough to stay in the processor's
# cache.
BLOCK = 128
# Samples of one component in a block: a few of the longest records fill the cache alone, and take their memory.
BLOCK_SAMPLES = 40_000

Tracks = dict[SignalName, FloatArray]


@dataclass(frozen=True)
class Preparation:
    """A recording made ready for scoring: the motion of its block, its place there, and what was done to it."""

    motion: Motion
    filters: tuple[AppliedFilter, ...]
    notes: tuple[QualityNote, ...]
    angular_velocity_source: str | None
    angular_acceleration_source: str | None
    pre_trigger_known: bool
    place: int = 0
    filtered_peaks: tuple[float, float] | None = None
    """Peaks of linear [g] and angular acceleration [rad/s^2] after the paper's filters, where a signal has none."""

    @classmethod
    def of(cls, kinematics: HeadKinematics, *, pre_trigger_known: bool = False) -> Preparation:
        """Motion of the head's centre of gravity that needs no preparation; whether its times count from a trigger."""
        rotation = "supplied" if kinematics.angular_acceleration is not None else None
        velocity = "supplied" if kinematics.angular_velocity is not None else None
        return cls(kinematics.motion, (), (), velocity, rotation, pre_trigger_known)

    @cached_property
    def kinematics(self) -> HeadKinematics:
        """The motion of this impact."""
        return self.motion.impact(self.place)


def prepare(recording: Recording) -> Preparation:
    """Convert, resample, filter, differentiate, rotate and transfer a recording to the head's centre of gravity.

    Raises
    ------
    TraceError
        The recording breaks a rule; its code, signal, channel and sample say which and where.
    """
    sent = uniform(recording)
    (found,) = _prepared(plan_of(sent.layout), [sent])
    if isinstance(found, TraceError):
        raise found
    return found


def prepare_many(recordings: Iterable[Recording]) -> list[Preparation | TraceError]:
    """The same for many, in their order and with the same digits; the fault of one stands in its place."""
    found: dict[int, Preparation | TraceError] = {}
    alike: dict[Layout, list[tuple[int, Uniform]]] = {}
    for number, recording in enumerate(recordings):
        try:
            sent = uniform(recording)
            plan_of(sent.layout)
        except TraceError as error:
            found[number] = error
        else:
            alike.setdefault(sent.layout, []).append((number, sent))
    for layout, members in alike.items():
        size = _block_size(max(signal.track.samples for signal in layout.signals))
        for first in range(0, len(members), size):
            numbers, block = zip(*members[first : first + size], strict=True)
            found |= zip(numbers, _prepared(plan_of(layout), block), strict=True)
    return [found[number] for number in range(len(found))]


def _block_size(samples: int) -> int:
    """How many records of this length are worked on at once."""
    return max(1, min(BLOCK, BLOCK_SAMPLES // samples))


def _prepared(plan: Plan, block: Sequence[Uniform]) -> list[Preparation | TraceError]:
    """Recordings of one layout, each prepared or with its fault."""
    samples = [_in_criteria_units(plan, group, block) for group in plan.groups]
    noted: list[list[QualityNote]] = [[] for _ in block]
    faults: dict[int, TraceError] = {}
    for place in _suspects(plan, samples):
        try:
            noted[place] += _looked_at(plan, samples, place)
        except TraceError as error:
            faults[place] = error
    if faults:
        return _without(plan, block, faults)
    motion = _motion(plan, samples, noted)
    faults = _computed_out_of_range(plan, motion)
    if faults:
        return _without(plan, block, faults)
    filtered = _filtered_peaks(plan, samples)
    return [
        Preparation(
            motion,
            plan.filters,
            (*sent.notes, *plan.notes, *noted[place]),
            plan.angular_velocity_source,
            plan.angular_acceleration_source,
            plan.layout.pre_trigger_ms is not None,
            place,
            None if filtered is None else filtered[place],
        )
        for place, sent in enumerate(block)
    ]


def _filtered_peaks(plan: Plan, samples: Sequence[FloatArray]) -> list[tuple[float, float]] | None:
    """The peaks that tell a wrong unit, of signals that are not filtered themselves; None where they are, or lack one.

    The bounds are those of filtered motion: the derivative of a gyroscope's noise alone goes beyond them.
    """
    if plan.units_plan is None:
        return None
    motion = _motion(plan.units_plan, samples, [[] for _ in range(samples[0].shape[0])])
    of_signal = dict(zip(motion.signals, motion.peaks.tolist(), strict=True))
    return list(zip(of_signal["linear_acceleration"], of_signal["angular_acceleration"], strict=True))


def _without(plan: Plan, block: Sequence[Uniform], faults: dict[int, TraceError]) -> list[Preparation | TraceError]:
    """The others of a block, with the faults in their places."""
    others = [sent for place, sent in enumerate(block) if place not in faults]
    prepared = iter(_prepared(plan, others)) if others else iter(())
    return [faults[place] if place in faults else next(prepared) for place in range(len(block))]


def _in_criteria_units(plan: Plan, group: Group, block: Sequence[Uniform]) -> FloatArray:
    """The samples of a group of signals, m x channels x n."""
    n = plan.layout.signals[group.members[0]].track.samples
    samples = np.empty((len(block), 3 * len(group.members), n))
    for row, number in enumerate(group.members):
        channels = samples[:, 3 * row : 3 * row + 3]
        for place, sent in enumerate(block):
            channels[place] = sent.samples[number].T
        if plan.signals[number].factor != 1.0:
            channels *= plan.signals[number].factor
    return samples


def _suspects(plan: Plan, samples: Sequence[FloatArray]) -> list[int]:
    """The places of those recordings that a rule or a check may find something in."""
    suspect = plan.groups[0].screen.suspects(samples[0])
    for group, found in zip(plan.groups[1:], samples[1:], strict=True):
        suspect |= group.screen.suspects(found)
    places: list[int] = np.flatnonzero(suspect).tolist()
    return places


def _looked_at(plan: Plan, samples: Sequence[FloatArray], place: int) -> Iterator[QualityNote]:
    """The rules and checks of one recording's samples, one by one."""
    signals = plan.layout.signals
    values: Tracks = {
        signals[number].name: found[place, 3 * row : 3 * row + 3].T
        for group, found in zip(plan.groups, samples, strict=True)
        for row, number in enumerate(group.members)
    }
    require_samples([(signal.name, values[signal.name]) for signal in signals])
    may_rest = {(name, AXES[axis]) for name, frame in plan.frames.items() for axis in frame.may_rest}
    for group, found in zip(plan.groups, samples, strict=True):
        yield from check_channels(channels_of([signals[i] for i in group.members]), found[place].T, may_rest)
    for name in ("angular_velocity", "angular_acceleration"):
        if "linear_acceleration" in values and name in values:
            yield from check_identical(("linear_acceleration", values["linear_acceleration"]), (name, values[name]))


def _motion(plan: Plan, samples: Sequence[FloatArray], noted: list[list[QualityNote]]) -> Motion:
    """The motion of the heads' centres of gravity."""
    signals, impacts = tuple(plan.tracks), samples[0].shape[0]
    stack = empty_stack(plan.base.samples, len(signals), impacts)
    in_place = plan.base.keeps_all
    tracks = {
        name: stack[:, row] if in_place else empty_stack(track.samples, 1, impacts)[:, 0]
        for row, (name, track) in enumerate(plan.tracks.items())
    }
    _fill(plan, samples, tracks)
    _derive(plan, tracks)
    for name, values in tracks.items():
        _to_head_axes(plan, name, values, noted)
    _compare_rotation(plan, tracks, noted)
    if not in_place:
        _look_outside(plan, tracks, noted)
        for row, name in enumerate(signals):
            stack[:, row] = brought(tracks[name], plan.base.ways[name])
    if plan.offset_m is not None:
        a, w, alpha = (stack[:, row] for row in range(3))
        a[...] = transfer_to_head_cg(a, w, alpha, plan.offset_m)
    return Motion(plan.base.rate_hz, signals, stack, plan.start_time_ms)


def _fill(plan: Plan, samples: Sequence[FloatArray], tracks: Tracks) -> None:
    """The signals as sent, filtered where they are to be."""
    for group, found in zip(plan.groups, samples, strict=True):
        for row, number in enumerate(group.members):
            signal = plan.signals[number]
            values = found[:, 3 * row : 3 * row + 3]
            if signal.corner_hz is not None:
                values = low_pass(values, signal.corner_hz, signal.rate_hz)
            tracks[signal.name][...] = values.transpose(2, 1, 0)


def _derive(plan: Plan, tracks: Tracks) -> None:
    """What one rotation signal says of the other: velocity by its integral, acceleration by its derivative."""
    if plan.angular_velocity_source is None:
        return
    w, alpha = tracks["angular_velocity"], tracks["angular_acceleration"]
    if plan.angular_velocity_source == "integral":
        w[...] = running_integral(alpha, plan.tracks["angular_acceleration"].rate_hz)
        return
    if plan.angular_acceleration_source == "five_point_stencil":
        differentiate(w, plan.tracks["angular_velocity"].rate_hz, out=alpha)


def _compare_rotation(plan: Plan, tracks: Tracks, noted: list[list[QualityNote]]) -> None:
    """Hold a supplied angular acceleration, as it is scored, against the derivative of the angular velocity."""
    if plan.comparison is None:
        return
    ways, w = plan.comparison.ways, tracks["angular_velocity"]
    derived = brought(differentiate(w, plan.tracks["angular_velocity"].rate_hz), ways["angular_velocity"])
    supplied = brought(tracks["angular_acceleration"], ways["angular_acceleration"])
    for place, notes in enumerate(noted):
        notes += check_angular_acceleration(supplied[..., place], derived[..., place])


def _to_head_axes(plan: Plan, name: SignalName, values: FloatArray, noted: list[list[QualityNote]]) -> None:
    """Take SAE J211's axes to the anatomical ones, sensor axes to head axes, and keep to a plane; in place."""
    frame = plan.frames[name]
    if plan.mirrored:
        values[:, 1:] *= -1.0
    if frame.rotation is not None:
        values[...] = rotated(values, frame.rotation)
    if not frame.removed:
        return
    beyond = [np.abs(values[:, axis]).max(axis=0) for axis in frame.removed]
    for axis in frame.removed:
        values[:, axis] = 0.0
    for notes, removed in zip(noted, np.max(beyond, axis=0).tolist(), strict=True):
        if removed > 0:
            detail = (
                f"The {words(name)} outside the {plan.layout.constrained_plane} plane, up to {removed:.4g}, was set to "
                "zero."
            )
            notes.append(QualityNote("out_of_plane_removed", "note", detail, name))


def _look_outside(plan: Plan, tracks: Tracks, noted: list[list[QualityNote]]) -> None:
    """Note the signals as sent whose largest sample is in none that are kept."""
    for signal in plan.layout.signals:
        way, size = plan.base.ways[signal.name], squared_norm(tracks[signal.name])
        kept = kept_of(way)
        if kept.start == 0 and kept.stop >= size.shape[0]:
            continue
        within = np.sqrt(squared_norm(brought(tracks[signal.name], way)).max(axis=0))
        beyond = np.sqrt(np.delete(size, kept, axis=0).max(axis=0))
        for place, notes in enumerate(noted):
            notes += check_cut_off(signal.name, float(within[place]), float(beyond[place]))


def _computed_out_of_range(plan: Plan, motion: Motion) -> dict[int, TraceError]:
    """Those of which what was computed from the samples is more than any head survives."""
    faults: dict[int, TraceError] = {}
    if plan.offset_m is not None:
        faults |= {place: transferred_out_of_range() for place in _beyond(motion, "linear_acceleration")}
    if plan.angular_acceleration_source == "five_point_stencil":
        faults |= {place: derived_out_of_range() for place in _beyond(motion, "angular_acceleration")}
    if plan.angular_velocity_source == "integral":
        faults |= {place: integrated_out_of_range() for place in _beyond(motion, "angular_velocity")}
    return faults


def _beyond(motion: Motion, name: SignalName) -> list[int]:
    """The places of the impacts that a signal's bound refuses."""
    largest = motion.magnitudes[motion.signals.index(name)].max(axis=0)
    places: list[int] = np.flatnonzero(largest > highest_of(name, "refused")).tolist()
    return places


@dataclass(frozen=True)
class Block:
    """Preparations that can be scored together: their motion, and which of them it holds, in its order."""

    motion: Motion
    members: list[int]


def blocks_of(preparations: Sequence[Preparation]) -> Iterator[Block]:
    """The blocks that preparations were made in, and others of those that were made alone."""
    together: dict[int, list[int]] = {}
    alone: dict[tuple[object, ...], list[int]] = {}
    for number, preparation in enumerate(preparations):
        motion = preparation.motion
        if motion.impacts > 1:
            together.setdefault(id(motion), []).append(number)
        else:
            alike = (motion.samples, motion.sample_rate_hz, motion.signals, motion.start_time_ms)
            alone.setdefault(alike, []).append(number)
    for members in together.values():
        yield Block(_chosen(preparations[members[0]].motion, [preparations[i].place for i in members]), members)
    for members in alone.values():
        size = _block_size(preparations[members[0]].motion.samples)
        for first in range(0, len(members), size):
            block = members[first : first + size]
            yield Block(_joined([preparations[i].motion for i in block]), block)


def _chosen(motion: Motion, places: list[int]) -> Motion:
    """Some of a motion's impacts."""
    if places == list(range(motion.impacts)):
        return motion
    return replace(motion, stack=np.ascontiguousarray(motion.stack[..., places]))


def _joined(motions: list[Motion]) -> Motion:
    """Motions of one impact each, side by side."""
    first = motions[0]
    if len(motions) == 1:
        return first
    stack = empty_stack(first.samples, len(first.signals), len(motions))
    for place, motion in enumerate(motions):
        stack[..., place] = motion.stack[..., 0]
    return replace(first, stack=stack)
