"""From a recording as sent to the motion of the head's centre of gravity: what is done, and in which order."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from waveforms import burst, recording

from headimpact.cut_offs import NO_FILTER, PAPER, LowPass, corner_frequency
from headimpact.filtering import low_pass
from headimpact.kinematics import STANDARD_GRAVITY, differentiate, running_integral
from headimpact.preparation import prepare
from headimpact.recording import Mounting, Recording, Signal
from headimpact.scoring import score

GENERATOR = np.random.default_rng(0)
A, W, ALPHA = burst(GENERATOR, 100, 30.0), burst(GENERATOR, 100, 8.0), burst(GENERATOR, 100, 900.0)


def codes(preparation) -> list[str]:
    return [note.code for note in preparation.notes]


def interpolated(x: np.ndarray, rate_hz: float, time_s: np.ndarray) -> np.ndarray:
    grid = np.arange(x.shape[0]) / rate_hz
    return np.stack([np.interp(time_s, grid, x[:, i]) for i in range(3)], axis=1)


def close(found: np.ndarray, expected: np.ndarray, relative: float = 1e-12) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=relative * np.abs(expected).max())


@pytest.mark.parametrize(
    ("signal", "unit", "factor"),
    [
        ("linear_acceleration", "m/s^2", STANDARD_GRAVITY),
        ("angular_velocity", "deg/s", 180 / pi),
        ("angular_acceleration", "deg/s^2", 180 / pi),
    ],
)
def test_units_are_converted(signal, unit, factor):
    sent = {
        "linear_acceleration": (A, "g"),
        "angular_velocity": (W, "rad/s"),
        "angular_acceleration": (ALPHA, "rad/s^2"),
    }
    plain = Recording(**{name: Signal(x, u, 1000.0) for name, (x, u) in sent.items()})
    other = replace(plain, **{signal: Signal(sent[signal][0] * factor, unit, 1000.0)})
    for name in ("linear_acceleration_g", "angular_velocity", "angular_acceleration"):
        close(getattr(prepare(other).kinematics, name), getattr(prepare(plain).kinematics, name))


def test_one_g_is_9_80665_metres_per_second_squared():
    # 3rd General Conference on Weights and Measures, 1901
    assert STANDARD_GRAVITY == 9.80665


def test_the_angular_acceleration_is_the_derivative_of_the_filtered_velocity():
    # filtered first, then differentiated
    found = prepare(Recording(angular_velocity=Signal(W, "rad/s", 1000.0)))
    filtered = low_pass(W.T, corner_frequency(184.0, 1000.0), 1000.0).T
    close(found.kinematics.angular_velocity, filtered)
    close(found.kinematics.angular_acceleration, differentiate(filtered, 1000.0))
    assert (found.angular_velocity_source, found.angular_acceleration_source) == ("supplied", "five_point_stencil")


def test_a_supplied_angular_acceleration_is_used_as_it_is():
    # never filtered, never derived again
    given = Recording(Signal(A, "g", 1e3), Signal(W, "rad/s", 1e3), Signal(ALPHA, "rad/s^2", 1e3))
    found = prepare(given)
    np.testing.assert_array_equal(found.kinematics.angular_acceleration, ALPHA)
    assert found.angular_acceleration_source == "supplied"
    assert {f.signal for f in found.filters} == {"linear_acceleration", "angular_velocity"}


def test_without_velocity_it_is_the_integral_of_the_acceleration_and_a_note_says_so():
    found = prepare(Recording(angular_acceleration=Signal(ALPHA, "rad/s^2", 1000.0)))
    close(found.kinematics.angular_velocity, running_integral(ALPHA, 1000.0))
    assert (found.angular_velocity_source, found.angular_acceleration_source) == ("integral", "supplied")
    assert codes(found).count("angular_velocity_integrated") == 1
    assert score(found).criteria["bric"].value > 0


def test_without_rotation_there_is_none_and_no_source_is_named():
    found = prepare(Recording(Signal(A, "g", 1000.0)))
    assert found.kinematics.angular_velocity is None
    assert found.kinematics.angular_acceleration is None
    assert (found.angular_velocity_source, found.angular_acceleration_source) == (None, None)


def test_of_two_rates_each_is_filtered_and_differentiated_at_its_own_and_the_lower_is_interpolated():
    # Linx IAS: acceleration at 1600 Hz, angular velocity at 2000 Hz
    a, w = burst(GENERATOR, 80, 30.0, 1600.0), burst(GENERATOR, 100, 8.0, 2000.0)
    found = prepare(Recording(Signal(a, "g", 1600.0), Signal(w, "rad/s", 2000.0))).kinematics
    assert found.sample_rate_hz == 2000.0
    # 80 samples at 1600 Hz end at 49.375 ms, the 99th step of 2000 Hz at 49.5 ms
    assert found.samples == 99
    time_s = np.arange(99) / 2000.0
    filtered = low_pass(w.T, corner_frequency(184.0, 2000.0), 2000.0).T
    close(found.angular_velocity, filtered[:99])
    close(found.angular_acceleration, differentiate(filtered, 2000.0)[:99])
    slow = low_pass(a.T, corner_frequency(300.0, 1600.0), 1600.0).T
    close(found.linear_acceleration_g, interpolated(slow, 1600.0, time_s))


def test_a_lower_rate_of_the_angular_velocity_is_differentiated_before_it_is_interpolated():
    a, w = burst(GENERATOR, 200, 30.0, 4000.0), burst(GENERATOR, 50, 8.0, 1000.0)
    found = prepare(Recording(Signal(a, "g", 4000.0), Signal(w, "rad/s", 1000.0), low_pass=NO_FILTER)).kinematics
    time_s = np.arange(197) / 4000.0
    assert found.samples == 197
    close(found.angular_acceleration, interpolated(differentiate(w, 1000.0), 1000.0, time_s))


def test_signals_on_their_own_stamps_are_kept_where_they_overlap():
    time_s = np.arange(100) / 1000.0
    early, late = Signal(A, "g", time_s=5.0 + time_s), Signal(W, "rad/s", time_s=5.0 + time_s + 0.0305)
    found = prepare(Recording(early, late, low_pass=NO_FILTER, pre_trigger_ms=40.0))
    kinematics = found.kinematics
    # from 30.5 ms, the later one's start, to 99 ms, the earlier one's end; the grid is that of the first signal
    assert kinematics.samples == 69
    assert kinematics.start_time_ms == pytest.approx(31.0 - 40.0, abs=1e-6)
    close(kinematics.linear_acceleration_g, A[31:])
    close(kinematics.angular_velocity, interpolated(W, 1000.0, np.arange(31, 100) / 1000 - 0.0305), 1e-9)


@pytest.mark.parametrize("samples", [99, 60, 3])
@pytest.mark.parametrize("stamped", [False, True], ids=["rate", "stamps"])
@pytest.mark.parametrize("shorter", [0, 1, 2])
def test_records_of_one_rate_and_other_lengths_are_kept_where_they_overlap(samples, stamped, shorter):
    time_s = np.arange(100) / 1000.0
    lengths = [samples if i == shorter else 100 for i in range(3)]
    sent = [
        Signal(x[:n], unit, time_s=time_s[:n]) if stamped else Signal(x[:n], unit, 1000.0)
        for x, n, unit in zip((A, W, ALPHA), lengths, ("g", "rad/s", "rad/s^2"), strict=True)
    ]
    found = prepare(Recording(*sent, low_pass=NO_FILTER)).kinematics
    assert (found.samples, found.sample_rate_hz) == (samples, pytest.approx(1000.0, rel=1e-12))
    for values, all_of_it in zip(
        (found.linear_acceleration_g, found.angular_velocity, found.angular_acceleration), (A, W, ALPHA), strict=True
    ):
        close(values, all_of_it[:samples])


@pytest.mark.parametrize(("at", "noted"), [(70, True), (59, False), (62, True)])
@pytest.mark.parametrize("rate_hz", [1000.0, 3000.0])
def test_a_peak_where_another_signal_was_not_recorded_is_noted(at, noted, rate_hz):
    a = np.zeros((100, 3))
    a[20, 0], a[at, 0] = 30.0, 50.0
    w = burst(GENERATOR, round(59 * rate_hz / 1000) + 1, 8.0)
    notes = prepare(Recording(Signal(a, "g", 1000.0), Signal(w, "rad/s", rate_hz), low_pass=NO_FILTER)).notes
    assert [(note.code, note.severity, note.signal) for note in notes if note.code == "peak_cut_off"] == (
        [("peak_cut_off", "warning", "linear_acceleration")] if noted else []
    )
    assert not noted or ("50" in notes[-1].detail and "30" in notes[-1].detail)


@pytest.mark.parametrize("offset_ms", [0.0, 3.3, 12.418451, -20.5, 1.763665445123e12])
@pytest.mark.parametrize("rate_hz", [500.0, 1000.0, 3200.0, 10_000.0])
def test_the_clock_that_stamps_count_from_changes_nothing(offset_ms, rate_hz):
    stamps = (offset_ms + np.arange(100) * 1000.0 / rate_hz) / 1000.0
    found = prepare(Recording(Signal(A, "g", time_s=stamps), Signal(W, "rad/s", time_s=stamps)))
    expected = prepare(Recording(Signal(A, "g", rate_hz), Signal(W, "rad/s", rate_hz)))
    assert codes(found) == codes(expected)
    assert found.kinematics.sample_rate_hz == rate_hz
    assert (found.motion.stack == expected.motion.stack).all()


def test_of_two_signals_of_one_rate_the_first_is_the_base_whatever_their_last_digits():
    for offset in np.arange(200) / 10.0:
        stamps = (offset + np.arange(100.0)) / 1000.0
        late = stamps + 0.3e-3
        found = prepare(Recording(Signal(A, "g", time_s=stamps), Signal(W, "rad/s", time_s=late), low_pass=NO_FILTER))
        close(found.kinematics.linear_acceleration_g, A[1:])
    faster = Signal(W, "rad/s", time_s=np.arange(100) / 1000.5)
    for other in (Signal(A, "g", 1000.0), Signal(A, "g", time_s=np.arange(100) / 1000.0)):
        assert prepare(Recording(other, faster)).kinematics.sample_rate_hz == 1000.0


@pytest.mark.parametrize("rate_hz", [1000.000001, 1000.5, 1000.9, 1001.5])
def test_of_two_stated_rates_the_higher_is_the_base_however_little_it_is(rate_hz):
    time_s = np.arange(100) / rate_hz
    for slow, fast in ((0, 1), (1, 0)):
        rates = [1000.0, rate_hz] if fast else [rate_hz, 1000.0]
        sent = Recording(Signal(A, "g", rates[0]), Signal(W, "rad/s", rates[1]), low_pass=NO_FILTER)
        found = prepare(sent).kinematics
        assert found.sample_rate_hz == rate_hz
        values = (found.linear_acceleration_g, found.angular_velocity)
        close(values[fast], (A, W)[fast])
        close(values[slow], interpolated((A, W)[slow], 1000.0, time_s), 1e-12)


def test_stated_rates_that_differ_are_told_apart_beside_stamps_that_nearly_say_them():
    stamped = Signal(ALPHA, "rad/s^2", time_s=np.arange(100) / 1000.7)
    sent = Recording(Signal(A, "g", 1000.0), Signal(W, "rad/s", 1000.5), stamped)
    assert prepare(sent).kinematics.sample_rate_hz == 1000.5


def test_overlap_of_three_samples_is_enough():
    time_s = np.arange(100) / 1000.0
    found = prepare(Recording(Signal(A, "g", time_s=time_s), Signal(W, "rad/s", time_s=time_s + 0.097)))
    assert found.kinematics.samples == 3


def test_stamps_that_jitter_are_resampled_before_anything_else():
    # n equal steps from first to last, linear interpolation, before filtering
    steps = 0.0009 * (1 + 0.1 * np.sin(np.arange(99)))
    time_s = 3.0 + np.concatenate(([0.0], np.cumsum(steps)))
    found = prepare(Recording(angular_velocity=Signal(W, "rad/s", time_s=time_s)))
    rate_hz = 99 / (time_s[-1] - time_s[0])
    assert found.kinematics.sample_rate_hz == pytest.approx(rate_hz, rel=1e-15)
    even = np.linspace(time_s[0], time_s[-1], 100)
    resampled = np.stack([np.interp(even, time_s, W[:, i]) for i in range(3)], axis=1)
    close(found.kinematics.angular_velocity, low_pass(resampled.T, corner_frequency(184.0, rate_hz), rate_hz).T)
    assert codes(found) == ["resampled"]


def test_uniform_stamps_and_a_rate_give_the_same_kinematics():
    time_s = 12.5 + np.arange(100) / 1000.0
    by_stamps = prepare(Recording(Signal(A, "g", time_s=time_s), Signal(W, "rad/s", time_s=time_s))).kinematics
    by_rate = prepare(Recording(Signal(A, "g", 1000.0), Signal(W, "rad/s", 1000.0))).kinematics
    assert by_stamps.sample_rate_hz == pytest.approx(1000.0, rel=1e-12)
    assert by_stamps.start_time_ms == by_rate.start_time_ms == 0.0
    for name in ("linear_acceleration_g", "angular_velocity", "angular_acceleration"):
        close(getattr(by_stamps, name), getattr(by_rate, name), 1e-9)


def test_times_count_from_the_trigger_where_it_is_known_and_else_from_the_start():
    for pre_trigger_ms, offset in ((None, 0.0), (0.0, 0.0), (10.0, -10.0)):
        found = prepare(recording(pre_trigger_ms=pre_trigger_ms))
        assert found.kinematics.start_time_ms == offset
        assert found.pre_trigger_known == (pre_trigger_ms is not None)
        scored = score(found)
        plain = score(prepare(recording()))
        for key in ("hic15", "hic36", "ric"):
            expected = [t + offset for t in plain.criteria[key].window_ms]
            assert scored.criteria[key].window_ms == pytest.approx(expected, abs=1e-9)
        expected = [t + offset for t in plain.brain_angle.time_of_peak_ms]
        assert scored.brain_angle.time_of_peak_ms == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("plane", "linear", "rotation"), [("sagittal", "xz", "y"), ("coronal", "yz", "x"), ("axial", "xy", "z")]
)
def test_motion_outside_the_recorded_plane_is_set_to_zero_and_said(plane, linear, rotation):
    # the paper: "all motion outside of the single recorded plane was set to zero"
    found = prepare(recording(constrained_plane=plane))
    free = prepare(recording()).kinematics
    for axis in range(3):
        kept = "xyz"[axis] in linear
        expected = free.linear_acceleration_g[:, axis] if kept else np.zeros(100)
        np.testing.assert_array_equal(found.kinematics.linear_acceleration_g[:, axis], expected)
        turned = "xyz"[axis] in rotation
        for name in ("angular_velocity", "angular_acceleration"):
            expected = getattr(free, name)[:, axis] if turned else np.zeros(100)
            np.testing.assert_array_equal(getattr(found.kinematics, name)[:, axis], expected)
    assert set(codes(found)) == {"out_of_plane_removed"}
    bam = score(found).criteria["bam"].value
    assert [value > 0 for value in bam] == ["xyz"[i] in rotation for i in range(3)]


def test_a_planar_recording_without_out_of_plane_motion_draws_no_note():
    a, w = A * [1, 0, 1], W * [0, 1, 0]
    planar = Recording(Signal(a, "g", 1e3), Signal(w, "rad/s", 1e3), constrained_plane="sagittal")
    assert codes(prepare(planar)) == []
    assert "constant_channel" in codes(prepare(replace(planar, constrained_plane=None)))


def test_the_plane_is_that_of_the_head_not_of_the_sensor():
    # a sensor turned by 90 degrees about z: its x rotation is the head's y
    to_head = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned = Recording(
        angular_velocity=Signal(W, "rad/s", 1e3),
        mounting=Mounting(to_head, to_head, np.zeros(3)),
        constrained_plane="sagittal",
        low_pass=NO_FILTER,
    )
    np.testing.assert_array_equal(prepare(turned).kinematics.angular_velocity[:, 1], W[:, 0])


def test_what_is_sent_is_not_changed():
    a, w = A.copy(), W.copy()
    prepare(Recording(Signal(a, "g", 1e3), Signal(w, "rad/s", 1e3), axes="sae_j211", constrained_plane="sagittal"))
    np.testing.assert_array_equal(a, A)
    np.testing.assert_array_equal(w, W)


@pytest.mark.parametrize("dtype", [np.float32, np.int64])
def test_samples_of_another_number_type_are_taken(dtype):
    x = (A * 3).astype(dtype)
    found = prepare(Recording(Signal(x, "g", 1e3), low_pass=NO_FILTER)).kinematics.linear_acceleration_g
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, x.astype(float))


def test_a_filter_that_the_rate_cannot_carry_is_skipped_and_said():
    # "skipped with a note if f >= fs/2"
    a, w = burst(GENERATOR, 100, 30.0, 600.0), burst(GENERATOR, 100, 8.0, 600.0)
    found = prepare(Recording(Signal(a, "g", 600.0), Signal(w, "rad/s", 600.0), low_pass=PAPER))
    assert [(f.signal, f.applied, f.cut_off) for f in found.filters] == [
        ("linear_acceleration", False, 300.0),
        ("angular_velocity", True, 184.0),
    ]
    assert found.filters[0].corner_hz is None
    np.testing.assert_array_equal(found.kinematics.linear_acceleration_g, a)
    skipped = [note for note in found.notes if note.code == "filter_skipped"]
    assert [(note.signal, note.severity) for note in skipped] == [("linear_acceleration", "warning")]


@pytest.mark.parametrize(("rate_hz", "noted"), [(1799.0, True), (1800.0, False)])
def test_a_rate_under_ten_times_the_channel_frequency_class_is_noted(rate_hz, noted):
    # SAE J211-1
    a = burst(GENERATOR, 200, 30.0, rate_hz)
    found = prepare(Recording(Signal(a, "g", rate_hz), low_pass=LowPass(linear_acceleration="CFC180")))
    assert ("low_rate_for_class" in codes(found)) == noted
    assert found.filters[0].applied


@pytest.mark.parametrize("sensor", ["accelerometer", "gyroscope"])
def test_a_sensors_delay_is_taken_off_its_samples(sensor):
    # the same motion, with one sensor's samples 4 ms late, is the same motion again once the delay is known
    generator = np.random.default_rng(11)
    a, w = burst(generator, 140, 30.0), burst(generator, 140, 8.0)
    late = {"accelerometer": (a[16:116], w[20:120]), "gyroscope": (a[20:120], w[16:116])}[sensor]
    still = {"accelerometer_rotation": np.eye(3), "gyroscope_rotation": np.eye(3), "offset_m": np.array([0.07, 0, 0])}
    true = Recording(
        Signal(a[20:120], "g", 1e3), Signal(w[20:120], "rad/s", 1e3), mounting=Mounting(**still), low_pass=NO_FILTER
    )
    delayed = replace(
        true,
        linear_acceleration=Signal(late[0], "g", 1e3),
        angular_velocity=Signal(late[1], "rad/s", 1e3),
        mounting=Mounting(**still, **{f"{sensor}_delay_s": 0.004}),
    )
    expected, found = prepare(true).kinematics, prepare(delayed).kinematics
    assert found.samples == 96
    shift = round(found.start_time_ms - expected.start_time_ms)
    window = slice(shift + 2, shift + 94)
    np.testing.assert_allclose(found.angular_velocity[2:94], expected.angular_velocity[window], atol=1e-12)
    np.testing.assert_allclose(found.linear_acceleration_g[2:94], expected.linear_acceleration_g[window], atol=1e-9)
