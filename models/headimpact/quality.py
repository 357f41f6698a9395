"""The checks of a recording, each a named note. Their bounds are in data/quality.toml.

Checks of single signals run on the samples as sent, in the criteria's units; checks of the motion run on the filtered
kinematics of the head's centre of gravity.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from headimpact.kinematics import Motion
from headimpact.published import QUALITY_LIMITS
from headimpact.recording import UNITS_OF

FloatArray = NDArray[np.float64]
Severity = Literal["note", "warning"]
AXES = ("x", "y", "z")
CODES: tuple[str, ...] = (
    "low_sample_rate",
    "resampled",
    "gaps_filled",
    "extreme_value",
    "implausible_units",
    "saturated",
    "edge_glitch",
    "constant_channel",
    "identical_channels",
    "record_truncated",
    "peak_cut_off",
    "angular_acceleration_mismatch",
    "vendor_peak_mismatch",
    "angular_velocity_integrated",
    "filter_skipped",
    "low_rate_for_class",
    "out_of_plane_removed",
    "channel_missing",
    "channel_given_twice",
    "questionable_data",
    "sample_count_mismatch",
    "time_origin_mismatch",
    "not_worn",
    "outside_model_population",
    "duplicate_content",
)
"""Every note there is: those of the files and of the athletes too."""


@dataclass(frozen=True, slots=True)
class QualityNote:
    """One finding about a recording: a code, how much it matters, and a sentence with numbers."""

    code: str
    severity: Severity
    detail: str
    signal: str | None = None
    channel: str | None = None


def words(signal: str) -> str:
    """A signal's name as people write it."""
    return signal.replace("_", " ")


@dataclass(frozen=True, slots=True)
class Channel:
    """One component of one signal; `declared_range` is its sensor's full scale, infinite where none is declared."""

    signal: str
    axis: str
    declared_range: float


def highest_of(signal: str, kind: Literal["extreme", "refused"]) -> float:
    """The largest magnitude of a signal within a bound, which is allowed itself in whatever unit it was sent."""
    return float(QUALITY_LIMITS[signal][kind] * (1.0 + QUALITY_LIMITS["conversion"]["rounding"]))


def near_full_scale(declared_range: float) -> float:
    """The least magnitude that is near a sensor's full scale, in whatever unit either was sent."""
    fraction = QUALITY_LIMITS["saturation"]["range_fraction"]
    return float(fraction * declared_range * (1.0 - QUALITY_LIMITS["conversion"]["rounding"]))


def beyond_full_scale(declared_range: float) -> float:
    """The least magnitude that a sensor of this range cannot show."""
    return float(QUALITY_LIMITS["saturation"]["beyond_range"] * declared_range)


def check_channels(
    channels: Sequence[Channel], samples: FloatArray, may_rest: Collection[tuple[str, str]] = ()
) -> Iterator[QualityNote]:
    """Notes on single channels as sent.

    Parameters
    ----------
    channels
        What each column is.
    samples
        n x channels, in the criteria's units.
    may_rest
        Signals and axes of channels outside the plane that the motion was constrained to: that they stay is no finding.
    """
    magnitude = np.abs(samples)
    peaks: FloatArray = magnitude.max(axis=0)
    yield from _extreme_values(channels, peaks)
    yield from _beyond_range(channels, peaks)
    yield from _constant_channels(channels, samples, may_rest)
    yield from _saturated(channels, magnitude, peaks)
    yield from _edge_glitches(channels, samples, peaks)


def _extreme_values(channels: Sequence[Channel], peaks: FloatArray) -> Iterator[QualityNote]:
    for channel, peak in zip(channels, peaks.tolist(), strict=True):
        bound, unit = QUALITY_LIMITS[channel.signal]["extreme"], UNITS_OF[channel.signal][0]
        if peak > highest_of(channel.signal, "extreme"):
            yield _warning(
                "extreme_value",
                channel,
                f"The {words(channel.signal)} reaches {peak:.4g} {unit} on {channel.axis}; few heads go beyond "
                f"{bound:g}.",
            )


def _beyond_range(channels: Sequence[Channel], peaks: FloatArray) -> Iterator[QualityNote]:
    for channel, peak in zip(channels, peaks.tolist(), strict=True):
        if peak > beyond_full_scale(channel.declared_range):
            yield _warning(
                "implausible_units",
                channel,
                f"The {words(channel.signal)} reaches {peak:.4g} {UNITS_OF[channel.signal][0]} on {channel.axis}, and "
                f"its sensor shows {channel.declared_range:.4g} at most: the unit or the range is not what it says.",
            )


def _constant_channels(
    channels: Sequence[Channel], samples: FloatArray, may_rest: Collection[tuple[str, str]]
) -> Iterator[QualityNote]:
    constant = (samples == samples[0]).all(axis=0)
    if not constant.any():
        return
    for column in np.flatnonzero(constant).tolist():
        channel = channels[column]
        if (channel.signal, channel.axis) in may_rest:
            continue
        level = "zero" if samples[0, column] == 0 else "one value"
        yield _warning(
            "constant_channel",
            channel,
            f"The {words(channel.signal)} is {level} on {channel.axis} for the whole record.",
        )


def _saturated(channels: Sequence[Channel], magnitude: FloatArray, peaks: FloatArray) -> Iterator[QualityNote]:
    """Runs of equal samples at the largest value or within 5 % of the declared range."""
    level = np.minimum(peaks, [near_full_scale(channel.declared_range) for channel in channels])
    repeated = (magnitude[1:] == magnitude[:-1]) & (magnitude[1:] >= level)
    # a run of three equal samples is two equal pairs in a row
    runs = repeated[1:] & repeated[:-1]
    if not runs.any():
        return
    moving = ~(magnitude == peaks).all(axis=0)
    for column in np.flatnonzero(runs.any(axis=0) & moving).tolist():
        channel = channels[column]
        # a sample belongs to a run that starts at it or at one of the two before it
        count = np.count_nonzero(np.convolve(runs[:, column], np.ones(QUALITY_LIMITS["saturation"]["run"])))
        yield _warning(
            "saturated",
            channel,
            f"The {words(channel.signal)} stays at one value for {count} samples at its maximum on {channel.axis}.",
        )


def _edge_glitches(channels: Sequence[Channel], samples: FloatArray, peaks: FloatArray) -> Iterator[QualityNote]:
    limits = QUALITY_LIMITS["edge"]
    near = limits["steps"] + 1
    if samples.shape[0] < 2 * near:
        return
    for which, end in (("first", samples[: near + 1]), ("last", samples[: -near - 2 : -1])):
        steps = np.abs(end[1:] - end[:-1])
        bound = np.maximum(limits["ratio"] * steps[1:].max(axis=0), limits["share_of_peak"] * peaks)
        far = steps[0] > bound
        if far.any():
            for column in np.flatnonzero(far).tolist():
                channel = channels[column]
                yield _warning(
                    "edge_glitch",
                    channel,
                    f"The {which} sample of the {words(channel.signal)} is far off its neighbours on {channel.axis}: a "
                    f"step of {steps[0, column]:.4g}, over {limits['ratio']:g} times those beside it.",
                )


def _warning(code: str, channel: Channel, detail: str) -> QualityNote:
    return QualityNote(code, "warning", detail, channel.signal, channel.axis)


def check_identical(first: tuple[str, FloatArray], second: tuple[str, FloatArray]) -> Iterator[QualityNote]:
    """A channel that was sent twice under two names."""
    (name_a, a), (name_b, b) = first, second
    if a.shape != b.shape:
        return
    sums_a, sums_b = a.sum(axis=0), b.sum(axis=0)
    for i, j in zip(*np.nonzero(sums_a[:, None] == sums_b), strict=True):
        if np.array_equal(a[:, i], b[:, j]) and np.any(a[:, i] != a[0, i]):
            yield QualityNote(
                "identical_channels",
                "warning",
                f"The {words(name_a)} on {AXES[i]} and the {words(name_b)} on {AXES[j]} are the same numbers.",
                name_a,
                AXES[i],
            )


def check_rate(signal: str, sample_rate_hz: float) -> Iterator[QualityNote]:
    """A rate that is allowed, but low for an impact."""
    bound = QUALITY_LIMITS["record"]["low_rate_hz"]
    # stamps read to the microsecond put a 1 kHz device a hair on either side of its rate
    if sample_rate_hz < bound * (1 - 1e-3):
        yield QualityNote(
            "low_sample_rate",
            "warning",
            f"The {words(signal)} was sampled at {sample_rate_hz:.4g} Hz; peaks are under-read below {bound:g} Hz.",
            signal,
        )


def check_cut_off(signal: str, kept: float, cut_off: float) -> Iterator[QualityNote]:
    """The largest resultant of a signal within the time that all signals share, against that outside of it."""
    if cut_off > kept:
        detail = (
            f"The {words(signal)} is larger where not all signals were recorded, {cut_off:.4g}, than in the time that "
            f"they share, {kept:.4g}; only that was scored."
        )
        yield QualityNote("peak_cut_off", "warning", detail, signal)


def check_angular_acceleration(supplied: FloatArray, derived: FloatArray) -> Iterator[QualityNote]:
    """Supplied angular acceleration against the derivative of the angular velocity, on one time base."""
    bound = QUALITY_LIMITS["consistency"]["minimum_correlation"]
    a, b = supplied.ravel(), derived.ravel()
    if not a.any() and not b.any():
        return
    a, b = a - a.mean(), b - b.mean()
    scale = float(np.sqrt((a @ a) * (b @ b)))
    correlation = float(a @ b) / scale if scale > 0 else 0.0
    if correlation < bound:
        yield QualityNote(
            "angular_acceleration_mismatch",
            "warning",
            "The supplied angular acceleration and the derivative of the angular velocity have a correlation of "
            f"{correlation:.3f}, under {bound:g}.",
            "angular_acceleration",
        )


def check_reported_resultant(signal: str, unit: str, reported: FloatArray, values: FloatArray) -> Iterator[QualityNote]:
    """Resultants that a device supplies against those of its own samples.

    Parameters
    ----------
    signal, unit
        What is compared, and the unit of both.
    reported
        The supplied resultant, n samples; a value that is no number is not compared.
    values
        The signal as sent, n x 3.
    """
    own = np.sqrt((values * values).sum(axis=1))
    difference = np.abs(reported - own)
    if not np.isfinite(difference).any():
        return
    worst = int(np.nanargmax(difference))
    if difference[worst] > QUALITY_LIMITS["reported"]["tolerance"] * float(np.nanmax(own)):
        yield _mismatch(signal, f"resultant at sample {worst}", unit, float(reported[worst]), float(own[worst]))


def check_reported_peak(signal: str, unit: str, reported: float, values: FloatArray) -> Iterator[QualityNote]:
    """A peak resultant that a device supplies against that of its own samples."""
    own = np.sqrt((values * values).sum(axis=1))
    if not np.isfinite(own).any():
        return
    peak = float(np.nanmax(own))
    if abs(reported - peak) > QUALITY_LIMITS["reported"]["tolerance"] * peak:
        yield _mismatch(signal, "peak resultant", unit, reported, peak)


def _mismatch(signal: str, what: str, unit: str, reported: float, own: float) -> QualityNote:
    return QualityNote(
        "vendor_peak_mismatch",
        "warning",
        f"The supplied {what} of the {words(signal)} is {reported:.5g} {unit} where the samples give {own:.5g} {unit}.",
        signal,
    )


def population_reason(sex: str | None, age_years: float | None, level: str | None) -> str | None:
    """Why a person is outside the published model's population of adult men, as far as that is known."""
    limits = QUALITY_LIMITS["population"]
    if sex is not None and sex != "male":
        return "sex"
    if age_years is not None and age_years < limits["adult_age_years"]:
        return f"under {limits['adult_age_years']} years"
    if level is not None and _is_youth(level, limits["youth_levels"]):
        return "a youth level of play"
    return None


def _is_youth(level: str, youth_levels: list[str]) -> bool:
    """Whether a level of play is one of youth: one of the common words, or an age group below 18 such as U16."""
    word = "_".join(re.findall(r"[a-z]+|[0-9]+", level.casefold()))
    group = re.fullmatch(r"u(?:nder)?_([0-9]{1,2})", word)
    if group is not None:
        return bool(int(group[1]) <= QUALITY_LIMITS["population"]["adult_age_years"])
    return word in youth_levels or word.startswith("youth_")


def check_units(peak_linear_acceleration_g: float, peak_angular_acceleration: float) -> Iterator[QualityNote]:
    """Angular against linear peaks: catches m/s^2 sent as g and deg/s sent as rad/s, which no single bound can."""
    limits = QUALITY_LIMITS["unit_check"]
    if peak_linear_acceleration_g == 0 or peak_angular_acceleration == 0:
        return
    ratio = peak_angular_acceleration * limits["lever_arm_m"] / (peak_linear_acceleration_g * limits["gravity_m_s2"])
    if not limits["lowest"] <= ratio <= limits["highest"]:
        yield QualityNote(
            "implausible_units",
            "warning",
            f"Peak angular over peak linear acceleration gives R = {ratio:.3g}, outside {limits['lowest']:g} to "
            f"{limits['highest']:g}: one of the units is probably not what it says.",
        )


def check_truncation(
    motion: Motion, acceleration_peak: int | None, angle_peaks: Sequence[int] | None, *, pre_trigger_known: bool
) -> Iterator[QualityNote]:
    """Records that end too early (the brain model is slow) or whose peak is at an edge.

    Parameters
    ----------
    motion
        Whose length and times are looked at.
    acceleration_peak
        The sample at which the linear acceleration peaks; None where it was not recorded, or nothing moved.
    angle_peaks
        The samples at which the brain angle peaks, by axis; 0 for an axis without rotation. None without any.
    pre_trigger_known
        Whether times are counted from the trigger.
    """
    reasons = list(_truncation_reasons(motion, acceleration_peak, angle_peaks, pre_trigger_known))
    if reasons:
        yield QualityNote("record_truncated", "warning", " ".join(reasons))


def _truncation_reasons(
    motion: Motion, acceleration_peak: int | None, angle_peaks: Sequence[int] | None, pre_trigger_known: bool
) -> Iterator[str]:
    limits = QUALITY_LIMITS["record"]
    last = motion.samples - 1
    length_ms = last / motion.sample_rate_hz * 1000.0
    after_ms = length_ms + motion.start_time_ms if pre_trigger_known else length_ms
    if after_ms < limits["post_trigger_ms"] - 1000.0 / motion.sample_rate_hz:
        since = "trigger" if pre_trigger_known else "start"
        yield f"The record ends {after_ms:.4g} ms after its {since}, before {limits['post_trigger_ms']:g} ms."
    if acceleration_peak in {0, last}:
        yield "The linear acceleration peaks at the record's edge."
    if angle_peaks is not None:
        late = (1 - limits["late_peak_fraction"]) * last
        axes = [axis for axis, sample in zip(AXES, angle_peaks, strict=True) if sample >= late]
        if axes:
            share = limits["late_peak_fraction"]
            yield f"The brain angle peaks in the record's last {share:.0%} ({', '.join(axes)})."
