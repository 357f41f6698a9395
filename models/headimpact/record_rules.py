"""The rules of a recording: what breaks one is refused with where, and nothing is scored.

The bounds are in data/quality.toml. Messages name the bound, never the offending value.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from headimpact.errors import TraceError
from headimpact.kinematics import FloatArray
from headimpact.published import QUALITY_LIMITS
from headimpact.quality import AXES, words
from headimpact.recording import Signal, SignalName

UNITS_OF: dict[str, tuple[str, str]] = {
    "linear_acceleration": ("g", "m/s^2"),
    "angular_velocity": ("rad/s", "deg/s"),
    "angular_acceleration": ("rad/s^2", "deg/s^2"),
}


def require_form(signals: list[tuple[SignalName, Signal]]) -> None:
    """Refuse signals whose form no samples could make up for: none at all, their shape, length, unit or times."""
    if not signals:
        raise TraceError("no-signal", "A recording needs linear acceleration, angular velocity or both.")
    limits = QUALITY_LIMITS["record"]
    for name, signal in signals:
        if signal.values.ndim != 2 or signal.values.shape[1] != 3:
            raise TraceError("wrong-shape", f"The {words(name)} must have three components.", signal=name)
        if not limits["minimum_samples"] <= signal.values.shape[0] <= limits["maximum_samples"]:
            raise TraceError(
                "sample-count",
                f"The {words(name)} must have {limits['minimum_samples']} to {limits['maximum_samples']} samples.",
                signal=name,
            )
        if signal.unit not in UNITS_OF[name]:
            raise TraceError(
                "unknown-unit", f"The {words(name)} must be in {' or '.join(UNITS_OF[name])}.", signal=name
            )
        _require_time_base(name, signal)


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
    finite = np.isfinite(values)
    if not finite.all():
        index, axis = np.argwhere(~finite)[0]
        raise TraceError(
            "missing-sample",
            f"The {words(name)} holds a value that is no number.",
            signal=name,
            channel=AXES[axis],
            index=int(index),
        )


def _require_time_base(name: SignalName, signal: Signal) -> None:
    """Refuse a signal whose times are not known, or known twice."""
    if (signal.sample_rate_hz is None) == (signal.time_s is None):
        raise TraceError(
            "time-base", f"The {words(name)} must have either a sample rate or time stamps, and not both.", signal=name
        )
    if signal.time_s is not None and signal.time_s.shape != signal.values.shape[:1]:
        raise TraceError("stamp-count", f"The {words(name)} must have one time stamp per sample.", signal=name)


def rate_of(name: SignalName, time_s: FloatArray) -> float:
    """Samples per second of stamps that increase, each step within 15 % of the median one [Hz]."""
    steps = np.diff(time_s)
    stuck = np.flatnonzero(~(steps > 0))
    if stuck.size:
        raise TraceError(
            "time-not-increasing",
            f"The time stamps of the {words(name)} must increase from sample to sample.",
            signal=name,
            index=int(stuck[0]) + 1,
        )
    bound = QUALITY_LIMITS["record"]["maximum_jitter"]
    median = float(np.median(steps))
    far = np.flatnonzero(np.abs(steps - median) > bound * median)
    if far.size:
        raise TraceError(
            "time-jitter",
            f"The steps between time stamps of the {words(name)} must stay within {bound:.0%} of their median.",
            signal=name,
            index=int(far[0]) + 1,
        )
    return float((time_s.size - 1) / (time_s[-1] - time_s[0]))


def require_within(name: SignalName, values: FloatArray) -> None:
    """Refuse samples that no head survives to send: they are another unit or a broken channel."""
    bound = QUALITY_LIMITS[name]["refused"]
    if values.max() <= bound and values.min() >= -bound:
        return
    index, axis = np.argwhere(np.abs(values) > bound)[0]
    raise TraceError(
        "value-out-of-range",
        f"The {words(name)} must stay within {bound:g} {UNITS_OF[name][0]}; check the unit it was sent in.",
        signal=name,
        channel=AXES[axis],
        index=int(index),
    )


def derived_out_of_range() -> TraceError:
    """The same bound for angular acceleration that was derived: the velocity is to blame, but no one sample of it."""
    bound = QUALITY_LIMITS["angular_acceleration"]["refused"]
    return TraceError(
        "value-out-of-range",
        f"The derivative of the angular velocity must stay within {bound:g} rad/s^2; check its unit and its rate.",
        signal="angular_velocity",
    )
