"""The rules of a recording: what breaks one is refused with where, and nothing is scored.

The bounds are in data/quality.toml. Messages name the bound, never the offending value. Preparation stops at the first
fault that it meets; :func:`broken_rules` then looks for all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from headimpact.errors import TraceError
from headimpact.gaps import fill_gaps
from headimpact.kinematics import FloatArray
from headimpact.published import QUALITY_LIMITS
from headimpact.quality import AXES, highest_of, words
from headimpact.recording import TO_CRITERIA_UNIT, UNITS_OF, Recording, Signal, SignalName
from headimpact.stamps import is_like, may_be_rounded, rate_said


def require_form(signals: list[tuple[SignalName, Signal]]) -> None:
    """Refuse signals whose form no samples could make up for: none at all, their shape, length, unit or times."""
    if not signals:
        raise TraceError("no-signal", "A recording needs linear acceleration, angular velocity or both.")
    for name, signal in signals:
        if (fault := _fault_of_form(name, signal)) is not None:
            raise fault


def _fault_of_form(name: SignalName, signal: Signal) -> TraceError | None:
    """What is wrong with a signal before its samples are looked at; None if nothing."""
    limits = QUALITY_LIMITS["record"]
    if signal.values.ndim != 2 or signal.values.shape[1] != 3:
        return TraceError("wrong-shape", f"The {words(name)} must have three components.", signal=name)
    if not limits["minimum_samples"] <= signal.values.shape[0] <= limits["maximum_samples"]:
        return TraceError(
            "sample-count",
            f"The {words(name)} must have {limits['minimum_samples']} to {limits['maximum_samples']} samples.",
            signal=name,
        )
    if signal.unit not in UNITS_OF[name]:
        return TraceError("unknown-unit", f"The {words(name)} must be in {' or '.join(UNITS_OF[name])}.", signal=name)
    if (signal.sample_rate_hz is None) == (signal.time_s is None):
        return TraceError(
            "time-base", f"The {words(name)} must have either a sample rate or time stamps, and not both.", signal=name
        )
    if signal.time_s is not None and signal.time_s.shape != signal.values.shape[:1]:
        return TraceError("stamp-count", f"The {words(name)} must have one time stamp per sample.", signal=name)
    return None


def require_rate(name: SignalName, rate_hz: float) -> None:
    """Refuse a rate that is too low for an impact, or that no sensor has."""
    limits = QUALITY_LIMITS["record"]
    if not limits["minimum_rate_hz"] <= rate_hz <= limits["maximum_rate_hz"]:
        raise TraceError(
            "sample-rate",
            f"The {words(name)} must be sampled at {limits['minimum_rate_hz']:g} to {limits['maximum_rate_hz']:g} Hz.",
            signal=name,
        )


def require_samples(signals: Sequence[tuple[SignalName, FloatArray]]) -> None:
    """Refuse samples that no criterion can use, and a record in which nothing moves.

    Each signal's name and its samples in the criteria's unit, n x 3.
    """
    for name, values in signals:
        require_finite(name, values)
    if all((values == values[0]).all() for _, values in signals):
        raise TraceError("constant-signal", "Every channel of every signal is constant: nothing moved.")
    for name, values in signals:
        require_within(name, values)


def require_finite(name: SignalName, values: FloatArray) -> None:
    """Refuse a missing sample."""
    if not np.isfinite(values).all():
        raise next(_missing(name, values))


def _missing(name: SignalName, values: FloatArray) -> Iterator[TraceError]:
    for index, axis in np.argwhere(~np.isfinite(values)):
        yield TraceError(
            "missing-sample",
            f"The {words(name)} holds a value that is no number.",
            signal=name,
            channel=AXES[axis],
            index=int(index),
        )


def rate_of(name: SignalName, time_s: FloatArray) -> float:
    """Samples per second of stamps that increase, each step within 15 % of the median one [Hz]."""
    for fault in _faults_of_stamps(name, time_s):
        raise fault
    return rate_said(time_s)


def _faults_of_stamps(name: SignalName, time_s: FloatArray) -> Iterator[TraceError]:
    """Every stamp that does not follow the one before it; where all do, every step that is not like the others."""
    steps = np.diff(time_s)
    stuck = np.flatnonzero(~(steps > 0))
    remedy = _if_rounded(time_s) if stuck.size else ""
    for place in stuck:
        yield TraceError(
            "time-not-increasing",
            f"The time stamps of the {words(name)} must increase from sample to sample{remedy}.",
            signal=name,
            index=int(place) + 1,
        )
    if stuck.size:
        return
    bound = QUALITY_LIMITS["record"]["maximum_jitter"]
    median = float(np.median(steps))
    uneven = np.flatnonzero(~is_like(steps, median, time_s))
    remedy = _if_rounded(time_s) if uneven.size else ""
    for place in uneven:
        yield TraceError(
            "time-jitter",
            f"The steps between time stamps of the {words(name)} must stay within {bound:.0%} of their median{remedy}.",
            signal=name,
            index=int(place) + 1,
        )


def _if_rounded(time_s: FloatArray) -> str:
    """What helps where the digits of stamps may be to blame."""
    return "; if they are rounded, give sample_rate_hz for them" if may_be_rounded(time_s) else ""


def require_within(name: SignalName, values: FloatArray) -> None:
    """Refuse samples that no head survives to send: they are another unit or a broken channel."""
    bound = highest_of(name, "refused")
    if values.max() > bound or values.min() < -bound:
        raise next(_beyond(name, values))


def _beyond(name: SignalName, values: FloatArray) -> Iterator[TraceError]:
    bound = QUALITY_LIMITS[name]["refused"]
    highest = highest_of(name, "refused")
    for index, axis in np.argwhere((np.abs(values) > highest) & np.isfinite(values)):
        yield TraceError(
            "value-out-of-range",
            f"The {words(name)} must stay within {bound:g} {UNITS_OF[name][0]}; check the unit it was sent in.",
            signal=name,
            channel=AXES[axis],
            index=int(index),
        )


def broken_rules(recording: Recording) -> Iterator[TraceError]:
    """Every fault of a recording's signals, signal by signal, for the answer to whoever sent it.

    What can only be seen once the signals are prepared is not among them: that nothing moves, a derivative beyond any
    head, a rotation that is none.
    """
    for name, signal in recording.signals():
        fault = _fault_of_form(name, signal)
        if fault is not None:
            yield fault
            continue
        whole = fill_gaps(signal)[0] if recording.fill_gaps else signal
        for found in (*_missing(name, whole.values), *_beyond(name, whole.values * TO_CRITERIA_UNIT[whole.unit])):
            yield _at_sent_sample(found, signal, whole)
        yield from _faults_of_times(name, whole)


def _at_sent_sample(fault: TraceError, sent: Signal, whole: Signal) -> TraceError:
    """The fault at the sample that was sent, where filled ones stand before it."""
    if fault.index is None or sent.time_s is None or whole.time_s is None or whole.time_s.size == sent.time_s.size:
        return fault
    index = min(int(np.searchsorted(sent.time_s, whole.time_s[fault.index])), sent.time_s.size - 1)
    return TraceError(fault.code, str(fault), signal=fault.signal, channel=fault.channel, index=index)


def _faults_of_times(name: SignalName, signal: Signal) -> Iterator[TraceError]:
    """Of the stamps, or of the rate that they say or that was given."""
    rate = signal.sample_rate_hz
    if signal.time_s is not None:
        faults = list(_faults_of_stamps(name, signal.time_s))
        yield from faults
        rate = None if faults else rate_of(name, signal.time_s)
    if rate is not None:
        try:
            require_rate(name, rate)
        except TraceError as fault:
            yield fault


def transferred_out_of_range() -> TraceError:
    """The same bound for acceleration that was moved to the head's centre of gravity: its offset may be to blame."""
    bound = QUALITY_LIMITS["linear_acceleration"]["refused"]
    return TraceError(
        "value-out-of-range",
        f"The linear acceleration at the head's centre of gravity must stay within {bound:g} g; check the offset of "
        "the mounting and the unit of the rotation.",
        signal="linear_acceleration",
    )


def derived_out_of_range() -> TraceError:
    """The same bound for angular acceleration that was derived: the velocity is to blame, but no one sample of it."""
    bound = QUALITY_LIMITS["angular_acceleration"]["refused"]
    return TraceError(
        "value-out-of-range",
        f"The derivative of the angular velocity must stay within {bound:g} rad/s^2; check its unit and its rate.",
        signal="angular_velocity",
    )


def integrated_out_of_range() -> TraceError:
    """The same bound for angular velocity that was integrated: the acceleration is to blame."""
    bound = QUALITY_LIMITS["angular_velocity"]["refused"]
    return TraceError(
        "value-out-of-range",
        f"The integral of the angular acceleration must stay within {bound:g} rad/s; check its unit, its rate and its "
        "offset from zero.",
        signal="angular_acceleration",
    )
