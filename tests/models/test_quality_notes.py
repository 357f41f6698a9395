"""Each quality note at its bound and just inside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from waveforms import burst, recording

from headimpact.cut_offs import NO_FILTER, PAPER
from headimpact.errors import TraceError
from headimpact.kinematics import HeadKinematics, differentiate
from headimpact.preparation import Preparation, prepare
from headimpact.quality import QualityNote, check_truncation
from headimpact.recording import Recording, Signal
from headimpact.scoring import score

GENERATOR = np.random.default_rng(5)
A, W, ALPHA = burst(GENERATOR, 100, 30.0), burst(GENERATOR, 100, 8.0), burst(GENERATOR, 100, 900.0)


def notes(given: Recording, code: str) -> list[QualityNote]:
    return [note for note in score(prepare(given)).quality if note.code == code]


def linear(a: np.ndarray, **given: float) -> Recording:
    return Recording(Signal(a, "g", 1000.0, **given), low_pass=NO_FILTER)


def at(x: np.ndarray, index: int, axis: int, value: float) -> np.ndarray:
    changed = x.copy()
    changed[index, axis] = value
    return changed


def test_a_clean_recording_draws_no_note():
    assert score(prepare(recording())).quality == ()


@pytest.mark.parametrize(
    ("signal", "unit", "bound"),
    [
        ("linear_acceleration", "g", 250.0),
        ("angular_velocity", "rad/s", 70.0),
        ("angular_acceleration", "rad/s^2", 25_000.0),
    ],
)
@pytest.mark.parametrize("sign", [1, -1])
def test_extreme_values_are_named_with_their_channel(signal, unit, bound, sign):
    x = {"linear_acceleration": A, "angular_velocity": W, "angular_acceleration": ALPHA}[signal]
    beyond = recording(**{signal: Signal(at(x, 40, 1, sign * bound * 1.001), unit, 1e3)})
    (note,) = notes(beyond, "extreme_value")
    assert (note.signal, note.channel, note.severity) == (signal, "y", "warning")
    assert notes(recording(**{signal: Signal(at(x, 40, 1, sign * bound), unit, 1e3)}), "extreme_value") == []


@pytest.mark.parametrize("level", [0.0, -3.5])
def test_a_constant_channel_is_named(level):
    x = A.copy()
    x[:, 2] = level
    (note,) = notes(linear(x), "constant_channel")
    assert (note.signal, note.channel, note.severity) == ("linear_acceleration", "z", "warning")
    assert notes(linear(at(x, 50, 2, level + 1e-6)), "constant_channel") == []


@pytest.mark.parametrize(("run", "noted"), [(2, False), (3, True), (5, True)])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_flat_run_of_three_samples_at_the_maximum_is_saturation(run, noted, sign):
    x = A.copy()
    x[40 : 40 + run, 0] = sign * 90.0
    found = notes(linear(x), "saturated")
    assert bool(found) == noted
    if noted:
        assert (found[0].signal, found[0].channel) == ("linear_acceleration", "x")
        assert f"{run} samples" in found[0].detail


def test_the_samples_of_every_flat_run_are_counted():
    x = A.copy()
    x[30:33, 0] = x[60:64, 0] = 90.0
    (note,) = notes(linear(x), "saturated")
    assert "7 samples" in note.detail


@pytest.mark.parametrize(("level", "noted"), [(0.951, True), (0.949, False)])
def test_equal_samples_within_5_percent_of_the_declared_range_are_saturation(level, noted):
    # a clipped sensor whose filter or offset keeps it just under its range; the peak is elsewhere
    x = A.copy()
    x[40:43, 1] = level * 100.0
    x[60, 1] = 99.9
    assert bool(notes(linear(x, declared_range=100.0), "saturated")) == noted
    assert notes(linear(x), "saturated") == []


def test_the_declared_range_is_in_the_unit_of_its_signal():
    # a gyroscope of 2000 deg/s clips at 34.9 rad/s
    degrees = np.rad2deg(W)
    degrees[40:43, 1] = 1950.0
    degrees[60, 1] = 1990.0
    clipped = recording(angular_velocity=Signal(degrees, "deg/s", 1e3, declared_range=2000.0))
    assert [note.channel for note in notes(clipped, "saturated")] == ["y"]


def test_samples_that_are_5_percent_under_the_range_are_saturation_in_every_unit():
    # 0.95 * 100 is 95; in m/s^2 and back either may come out a hair less
    for unit, size in (("g", 1.0), ("m/s^2", 9.80665)):
        for full in np.arange(80.0, 120.0):
            x = at(A, 60, 1, 0.99 * full) * size
            x[40:43, 1] = 0.95 * full * size
            signal = Signal(x, unit, 1e3, declared_range=full * size)
            assert len(notes(Recording(linear_acceleration=signal), "saturated")) == 1


def test_a_value_at_the_bound_of_extreme_ones_earns_no_note_in_another_unit():
    x = np.rad2deg(at(ALPHA, 40, 1, 25_000.0))
    assert notes(recording(angular_acceleration=Signal(x, "deg/s^2", 1e3)), "extreme_value") == []


@pytest.mark.parametrize(("end", "index"), [("first", 0), ("last", -1)])
@pytest.mark.parametrize(("ratio", "noted"), [(5.01, True), (4.99, False)])
def test_an_edge_sample_far_off_its_neighbours_is_a_glitch(end, index, ratio, noted):
    # its step is over 5 times the largest of the five beside it and over a fifth of the channel's peak
    x = np.zeros((100, 3))
    x[:, 0] = np.arange(100) % 2  # steps of 1
    x[50, 1] = 1.0
    inner = 1 if index == 0 else -2
    x[index, 0] = x[inner, 0] + ratio
    found = notes(linear(x), "edge_glitch")
    assert bool(found) == noted
    if noted:
        assert (found[0].channel, found[0].signal) == ("x", "linear_acceleration")
        assert end in found[0].detail


@pytest.mark.parametrize(("share", "noted"), [(0.201, True), (0.199, False)])
def test_an_edge_step_that_is_small_beside_the_peak_is_no_glitch(share, noted):
    x = np.zeros((100, 3))
    x[50:53, 0] = [50.0, 100.0, 50.0]
    x[0, 0] = 100.0 * share
    assert bool(notes(linear(x), "edge_glitch")) == noted


def test_channels_that_are_the_same_numbers_are_named():
    w = W.copy()
    w[:, 2] = A[:, 0]
    doubled = Recording(Signal(A, "g", 1e3), Signal(w, "rad/s", 1e3))
    (note,) = notes(doubled, "identical_channels")
    assert (note.signal, note.channel) == ("linear_acceleration", "x")
    assert "angular velocity on z" in note.detail
    w[99, 2] += 1e-9
    assert notes(Recording(Signal(A, "g", 1e3), Signal(w, "rad/s", 1e3)), "identical_channels") == []


@pytest.mark.parametrize(("rate_hz", "noted"), [(500.0, True), (998.0, True), (999.5, False), (1000.0, False)])
def test_a_rate_under_1_khz_is_noted(rate_hz, noted):
    # stamps read to the microsecond scatter a 1 kHz device by parts per thousand
    found = notes(Recording(Signal(A, "g", rate_hz)), "low_sample_rate")
    assert [note.signal for note in found] == (["linear_acceleration"] if noted else [])


@pytest.mark.parametrize("start_s", [0.0, -0.01, 1.7e9])
def test_a_step_at_the_bound_of_jitter_is_within_it_on_either_side(start_s):
    time_s = start_s + 1e-3 * np.arange(100)
    time_s[50] += 0.15e-3
    assert len(notes(Recording(Signal(A, "g", time_s=time_s)), "resampled")) == 1
    time_s[50] += 0.002e-3
    with pytest.raises(TraceError) as caught:
        prepare(Recording(Signal(A, "g", time_s=time_s)))
    assert caught.value.code == "time-jitter"


@pytest.mark.parametrize(("jitter", "noted"), [(2e-6, True), (0.5e-6, False)])
def test_stamps_are_resampled_beyond_a_millionth_of_a_step(jitter, noted):
    time_s = np.arange(100) / 1000.0
    time_s[50] += jitter * 1e-3
    found = notes(Recording(Signal(A, "g", time_s=time_s)), "resampled")
    assert [note.severity for note in found] == (["note"] if noted else [])


def with_ratio(ratio: float) -> HeadKinematics:
    """Peaks whose R = PAA 0.07 m / (PLA 9.81) is `ratio`, at 100 g."""
    a, alpha = np.zeros((100, 3)), np.zeros((100, 3))
    a[50, 0], alpha[50, 1] = 100.0, ratio * 100.0 * 9.81 / 0.07
    return HeadKinematics(1000.0, a, None, alpha)


def doubts(kinematics: HeadKinematics) -> list[str]:
    return [note.code for note in score(Preparation.of(kinematics)).quality]


@pytest.mark.parametrize(
    ("ratio", "noted"), [(0.1199, True), (0.1201, False), (1.0, False), (1.999, False), (2.001, True)]
)
def test_the_unit_check_accepts_ratios_from_0_12_to_2(ratio, noted):
    assert ("implausible_units" in doubts(with_ratio(ratio))) == noted


@pytest.mark.parametrize(
    ("signal", "wrong"),
    [("linear_acceleration", 9.80665), ("angular_velocity", 180 / np.pi)],
    ids=["m/s^2 as g", "deg/s as rad/s"],
)
def test_a_wrong_unit_is_noticed_and_nothing_is_guessed(signal, wrong):
    a, w = 0.15 * A, 0.15 * W  # a mild impact, so that no other bound is met
    right = Recording(Signal(a, "g", 1e3), Signal(w, "rad/s", 1e3), low_pass=NO_FILTER)
    assert notes(right, "implausible_units") == []
    sent = getattr(right, signal)
    changed = replace(right, **{signal: replace(sent, values=sent.values * wrong)})
    (note,) = notes(changed, "implausible_units")
    assert note.severity == "warning"
    kinematics = prepare(changed).kinematics
    kept = kinematics.linear_acceleration_g if signal == "linear_acceleration" else kinematics.angular_velocity
    np.testing.assert_array_equal(kept, sent.values * wrong)


def test_the_unit_check_needs_both_signals_and_motion_in_both():
    whole = with_ratio(5.0)
    assert "implausible_units" in doubts(whole)
    for lacking in (
        replace(whole, angular_acceleration=None),
        replace(whole, linear_acceleration_g=None),
        replace(whole, angular_acceleration=np.zeros((100, 3))),
        replace(whole, linear_acceleration_g=np.zeros((100, 3))),
    ):
        assert "implausible_units" not in doubts(lacking)


@pytest.mark.parametrize(
    ("samples", "pre_trigger_ms", "noted"),
    [(59, None, True), (60, None, False), (70, 10.0, False), (69, 10.0, True), (60, 0.0, False), (100, 60.0, True)],
)
def test_a_record_that_ends_before_60_ms_is_truncated(samples, pre_trigger_ms, noted):
    # from the trigger where it is known, else from the start; a step of slack
    x = np.zeros((samples, 3))
    x[20:25] = 10.0
    given = replace(linear(x), pre_trigger_ms=pre_trigger_ms)
    found = notes(given, "record_truncated")
    assert bool(found) == noted
    if noted:
        assert ("trigger" if pre_trigger_ms is not None else "start") in found[0].detail


@pytest.mark.parametrize(("index", "noted"), [(0, True), (1, False), (98, False), (99, True)])
def test_a_linear_peak_at_the_edge_is_truncation(index, noted):
    x = np.ones((100, 3))
    x[index] = 50.0
    assert bool(notes(linear(x), "record_truncated")) == noted


@pytest.mark.parametrize(("peak", "noted"), [(94, False), (95, True), (99, True)])
def test_a_brain_angle_that_peaks_in_the_last_5_percent_is_truncation(peak, noted):
    # 100 samples: the last 5 % begin after sample 94.05
    kinematics = HeadKinematics(1000.0, None, None, np.ones((100, 3)))
    found = list(check_truncation(kinematics.motion, None, [40, peak, 0], pre_trigger_known=False))
    assert bool(found) == noted
    if noted:
        assert "(y)" in found[0].detail


def test_a_response_that_still_rises_at_the_end_is_truncation():
    # half a pulse: the angle has not turned yet
    alpha = np.zeros((100, 3))
    alpha[85:, 2] = 2000.0
    found = notes(Recording(angular_acceleration=Signal(alpha, "rad/s^2", 1e3)), "record_truncated")
    assert "brain angle" in found[0].detail


@pytest.mark.parametrize(("scale", "noted"), [(0.3, False), (2.0, True)])
def test_a_supplied_angular_acceleration_that_is_not_the_derivative_is_noted(scale, noted):
    # correlation under 0.9 between what is supplied and what follows from the velocity
    own = differentiate(W, 1000.0)
    other = np.random.default_rng(9).normal(size=own.shape) * own.std() * scale
    correlation = np.corrcoef((own + other).ravel(), own.ravel())[0, 1]
    assert (correlation < 0.9) == noted
    given = Recording(None, Signal(W, "rad/s", 1e3), Signal(own + other, "rad/s^2", 1e3), low_pass=NO_FILTER)
    found = notes(given, "angular_acceleration_mismatch")
    assert bool(found) == noted
    if noted:
        assert f"{correlation:.3f}" in found[0].detail


def test_a_head_that_does_not_turn_has_no_mismatch_of_its_rotation():
    still = np.zeros((100, 3))
    given = Recording(Signal(A, "g", 1e3), Signal(still, "rad/s", 1e3), Signal(still, "rad/s^2", 1e3))
    assert notes(given, "angular_acceleration_mismatch") == []


def test_an_angular_acceleration_in_degrees_keeps_its_shape_and_is_caught_by_the_unit_check():
    own = np.rad2deg(differentiate(recording().angular_velocity.values, 1000.0))
    given = replace(recording(), angular_acceleration=Signal(own, "rad/s^2", 1e3))
    assert notes(given, "angular_acceleration_mismatch") == []
    assert len(notes(given, "implausible_units")) == 1


def test_every_note_has_a_code_a_severity_and_a_sentence():
    x = A.copy()
    x[:, 2] = 0.0
    x[30:40, 0] = 300.0
    found = score(prepare(Recording(Signal(x, "g", 700.0), Signal(W[:100], "rad/s", 700.0)))).quality
    assert {"constant_channel", "saturated", "extreme_value", "low_sample_rate"} <= {note.code for note in found}
    for note in found:
        assert note.code.replace("_", "").isalpha()
        assert note.code.islower()
        assert note.severity in ("note", "warning")
        assert note.detail[0].isupper()
        assert note.detail.endswith(".")


def test_notes_of_preparation_and_of_scoring_come_together():
    prepared = prepare(linear(A[:50]))
    assert isinstance(prepared, Preparation)
    assert [note.code for note in score(prepared).quality][-1] == "record_truncated"


@pytest.mark.parametrize(("level", "noted"), [(126.0, True), (-126.0, True), (124.0, False)])
def test_a_sample_far_beyond_the_declared_range_is_named(level: float, noted: bool):
    found = notes(linear(at(A, 40, 1, level), declared_range=100.0), "implausible_units")
    assert [(note.signal, note.channel) for note in found] == [("linear_acceleration", "y")] * noted
    assert all("its sensor shows 100 at most" in note.detail for note in found)


@pytest.mark.parametrize(("pre_trigger_ms", "noted"), [(30.0, True), (10.4, False), (None, False)])
def test_stamps_that_go_through_zero_at_another_time_than_the_trigger_are_noted(
    pre_trigger_ms: float | None, noted: bool
):
    stamps = (np.arange(100) - 10.0) / 1000.0
    given = Recording(Signal(A, "g", time_s=stamps), low_pass=NO_FILTER, pre_trigger_ms=pre_trigger_ms)
    found = notes(given, "time_origin_mismatch")
    assert [note.severity for note in found] == ["note"] * noted
    assert all("begin 10 ms before zero" in note.detail for note in found)


def noisy(noise_rad_s: float, scale: float = 1.0, **filters: object) -> Recording:
    """At 20 kHz, where a gyroscope's noise alone gives a large derivative."""
    clean = recording(samples=2000, rate_hz=20_000.0)
    w = clean.angular_velocity.values + np.random.default_rng(3).normal(scale=noise_rad_s, size=(2000, 3))
    a = Signal(clean.linear_acceleration.values * scale, "g", 2e4)
    return replace(clean, linear_acceleration=a, angular_velocity=Signal(w, "rad/s", 2e4), **filters)


@pytest.mark.parametrize(("noise_rad_s", "scale", "noted"), [(0.4, 0.5, False), (0.2, 4.5, True)])
def test_the_unit_check_is_of_filtered_motion_also_where_none_is_scored(noise_rad_s, scale, noted):
    found = [
        notes(noisy(noise_rad_s, scale, **filters), "implausible_units")
        for filters in ({}, {"low_pass": NO_FILTER}, {"low_pass": replace(PAPER, angular_velocity=None)})
    ]
    assert found[0] == found[1] == found[2]
    assert bool(found[0]) == noted
    bare = score(prepare(noisy(noise_rad_s, scale, low_pass=NO_FILTER))).peaks
    ratio = bare.angular_acceleration_rad_s2 * 0.07 / (bare.linear_acceleration_g * 9.81)
    assert (0.12 <= ratio <= 2.0) == noted  # by itself it would say the opposite


@pytest.mark.parametrize("offset", [0.3, 35.0])
def test_the_rounding_of_a_gyroscope_s_offset_is_no_late_peak(offset):
    w = burst(GENERATOR, 1500, 8.0, 10_000.0)
    w[:, 0] = offset
    scored = score(prepare(recording(samples=1500, rate_hz=1e4, angular_velocity=Signal(w, "rad/s", 1e4))))
    assert {note.code for note in scored.quality} == {"constant_channel"}
    assert scored.brain_angle.time_of_peak_ms[0] == 0.0


@pytest.mark.parametrize("peak", range(25, 40))
def test_a_peak_counts_as_cut_off_by_what_is_scored(peak):
    # w at 500 Hz goes on when a at 5000 Hz has ended, between two of its samples
    w = np.zeros((60, 3))
    w[10] = w[peak - 1] = w[peak + 1] = 9.0
    w[peak] = 37.0
    a = np.zeros((306, 3))
    a[100] = 20.0
    given = Recording(Signal(a, "g", 5000.0), Signal(w, "rad/s", 500.0), low_pass=NO_FILTER)
    scored = score(prepare(given))
    found = [note.detail for note in scored.quality if note.code == "peak_cut_off"]
    assert len(found) == (scored.peaks.angular_velocity_rad_s < 64.0)
    if found:
        assert f"{scored.peaks.angular_velocity_rad_s:.4g};" in found[0]


class TestInAPlane:
    """The notes are of what is scored."""

    @staticmethod
    def planar(**changes: object) -> Recording:
        return replace(recording(), constrained_plane="axial", low_pass=NO_FILTER, **changes)

    def test_a_channel_within_the_plane_that_rests_is_named(self):
        a, w = A.copy(), W.copy()
        a[:, 1] = a[:, 2] = w[:, 2] = w[:, 0] = 0.0
        found = notes(
            self.planar(linear_acceleration=Signal(a, "g", 1e3), angular_velocity=Signal(w, "rad/s", 1e3)),
            "constant_channel",
        )
        assert [(note.signal, note.channel) for note in found] == [
            ("linear_acceleration", "y"),
            ("angular_velocity", "z"),
        ]

    @pytest.mark.parametrize(("within", "outside", "noted"), [(1.0, -1.0, False), (-1.0, 1.0, True)])
    def test_rotation_is_compared_within_the_plane(self, within, outside, noted):
        alpha = differentiate(W, 1000.0) * (outside, outside, within)
        given = self.planar(
            angular_velocity=Signal(W, "rad/s", 1e3), angular_acceleration=Signal(alpha, "rad/s^2", 1e3)
        )
        assert bool(notes(given, "angular_acceleration_mismatch")) == noted
