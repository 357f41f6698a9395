"""Every rule that a recording can break: its code, where it points, and a message that never repeats the value."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from waveforms import burst, recording, rotation_matrix

from headimpact.cut_offs import NO_FILTER
from headimpact.errors import HeadimpactError, TraceError
from headimpact.preparation import prepare, prepare_many
from headimpact.record_rules import broken_rules
from headimpact.recording import Mounting, Recording, Signal

# A value that no message may repeat.
MARK = 987.654321
GENERATOR = np.random.default_rng(0)
A, W, ALPHA = burst(GENERATOR, 100, 30.0), burst(GENERATOR, 100, 8.0), burst(GENERATOR, 100, 900.0)
# a jump by 150 rad/s
STEP = np.repeat([[0.0] * 3, [150.0] * 3], 50, axis=0)
STILL = np.tile([1.0, -2.0, MARK], (100, 1))


def at(x: np.ndarray, index: int, axis: int, value: float) -> np.ndarray:
    changed = x.copy()
    changed[index, axis] = value
    return changed


def stamped(time_s: np.ndarray, x: np.ndarray = W) -> Recording:
    return Recording(Signal(A, "g", 1000.0), Signal(x, "rad/s", time_s=time_s))


def stamps(**changes: float) -> np.ndarray:
    """100 stamps of 1 ms; `s5=0.2` sets the stamp of sample 5."""
    time_s = np.arange(100) / 1000
    for name, value in changes.items():
        time_s[int(name[1:])] = value
    return time_s


def linear(x: np.ndarray = A, unit: str = "g", rate_hz: float = 1e3) -> Recording:
    return recording(linear_acceleration=Signal(x, unit, rate_hz))


def velocity(x: np.ndarray = W, unit: str = "rad/s", rate_hz: float = 1e3) -> Recording:
    return recording(angular_velocity=Signal(x, unit, rate_hz))


def acceleration(x: np.ndarray) -> Recording:
    return recording(angular_acceleration=Signal(x, "rad/s^2", 1e3))


@dataclass
class Case:
    code: str
    recording: Recording
    signal: str | None = None
    channel: str | None = None
    index: int | None = None


CASES = {
    "no signal at all": Case("no-signal", Recording()),
    "two components": Case(
        "wrong-shape", recording(angular_velocity=Signal(W[:, :2], "rad/s", 1e3)), "angular_velocity"
    ),
    "one row": Case("wrong-shape", recording(angular_velocity=Signal(W[:, 0], "rad/s", 1e3)), "angular_velocity"),
    "no sample": Case("sample-count", Recording(Signal(A[:0], "g", 1e3)), "linear_acceleration"),
    "2 samples": Case("sample-count", Recording(Signal(A[:2], "g", 1e3)), "linear_acceleration"),
    "20 001 samples": Case(
        "sample-count", Recording(Signal(np.tile(A, (201, 1))[:20_001], "g", 1e3)), "linear_acceleration"
    ),
    "a unit of another signal": Case("unknown-unit", velocity(unit="g"), "angular_velocity"),
    "no such unit": Case("unknown-unit", linear(unit="ft/s^2"), "linear_acceleration"),
    "neither rate nor stamps": Case("time-base", recording(angular_velocity=Signal(W, "rad/s")), "angular_velocity"),
    "rate and stamps": Case(
        "time-base", recording(angular_velocity=Signal(W, "rad/s", 1e3, stamps())), "angular_velocity"
    ),
    "a stamp short": Case("stamp-count", stamped(stamps()[:-1]), "angular_velocity"),
    "NaN": Case("missing-sample", velocity(at(W, 7, 1, np.nan)), "angular_velocity", "y", 7),
    "infinity": Case("missing-sample", linear(at(A, 99, 2, np.inf)), "linear_acceleration", "z", 99),
    "minus infinity": Case("missing-sample", linear(at(A, 0, 0, -np.inf)), "linear_acceleration", "x", 0),
    "nothing moves": Case("constant-signal", Recording(Signal(STILL, "g", 1e3), Signal(STILL / 100, "rad/s", 1e3))),
    "all zero": Case("constant-signal", Recording(angular_velocity=Signal(0 * W, "rad/s", 1e3))),
    "beyond 1000 g": Case("value-out-of-range", linear(at(A, 12, 0, 1e3 + MARK)), "linear_acceleration", "x", 12),
    "beyond 1000 g in m/s^2": Case(
        "value-out-of-range", linear(at(A, 12, 0, -9807.0), "m/s^2"), "linear_acceleration", "x", 12
    ),
    "beyond 200 rad/s": Case("value-out-of-range", velocity(at(W, 3, 2, -MARK)), "angular_velocity", "z", 3),
    "beyond 200 rad/s in deg/s": Case(
        "value-out-of-range", velocity(at(W, 3, 2, 11460.0), "deg/s"), "angular_velocity", "z", 3
    ),
    "beyond 200 000 rad/s^2": Case(
        "value-out-of-range", acceleration(at(ALPHA, 4, 1, 1e6 + MARK)), "angular_acceleration", "y", 4
    ),
    "an overflowing product": Case(
        "value-out-of-range", acceleration(at(ALPHA, 4, 1, 1.7e308)), "angular_acceleration", "y", 4
    ),
    "a derivative beyond 200 000 rad/s^2": Case(
        "value-out-of-range",
        Recording(angular_velocity=Signal(STEP, "rad/s", 1e4), low_pass=NO_FILTER),
        "angular_velocity",
    ),
    "an integral beyond 200 rad/s": Case(
        "value-out-of-range",
        Recording(angular_acceleration=Signal(at(STEP * 20, 99, 0, 0.0), "rad/s^2", 500.0)),
        "angular_acceleration",
    ),
    "time stands still": Case("time-not-increasing", stamped(stamps(s5=0.004)), "angular_velocity", None, 5),
    "time runs backwards": Case("time-not-increasing", stamped(stamps(s5=0.0031)), "angular_velocity", None, 5),
    "time is not a number": Case("time-not-increasing", stamped(stamps(s5=np.nan)), "angular_velocity", None, 5),
    "a gap": Case(
        "time-jitter", stamped(np.concatenate((stamps()[:50], stamps()[50:] + 0.002))), "angular_velocity", None, 50
    ),
    "time runs to infinity": Case("time-jitter", stamped(stamps(s99=np.inf)), "angular_velocity", None, 99),
    "100 Hz": Case("sample-rate", velocity(rate_hz=100.0), "angular_velocity"),
    "499.9 Hz": Case("sample-rate", linear(rate_hz=499.9), "linear_acceleration"),
    "over a million Hz": Case("sample-rate", linear(rate_hz=1.1e6), "linear_acceleration"),
    "a rate of zero": Case("sample-rate", linear(rate_hz=0.0), "linear_acceleration"),
    "a negative rate": Case("sample-rate", linear(rate_hz=-MARK), "linear_acceleration"),
    "a rate that is no number": Case("sample-rate", linear(rate_hz=np.nan), "linear_acceleration"),
    "stamps of 400 Hz": Case("sample-rate", stamped(stamps() * 2.5), "angular_velocity"),
    "no overlap": Case(
        "no-overlap",
        Recording(Signal(A, "g", time_s=stamps()), Signal(W, "rad/s", time_s=stamps() + 0.0985)),
    ),
    "an offset without any rotation": Case(
        "no-rotation-for-transfer",
        Recording(Signal(A, "g", 1e3), mounting=Mounting(np.eye(3), np.eye(3), np.array([0.07, 0.0, 0.0]))),
        "angular_velocity",
    ),
}


@pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))
def test_each_broken_rule_has_its_code_and_says_where(case):
    with pytest.raises(TraceError) as raised:
        prepare(case.recording)
    error = raised.value
    assert (error.code, error.signal, error.channel, error.index) == (case.code, case.signal, case.channel, case.index)


@pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))
def test_each_message_is_a_sentence_that_does_not_repeat_the_value(case):
    with pytest.raises(TraceError) as raised:
        prepare(case.recording)
    message = str(raised.value)
    assert message[0].isupper()
    assert message.endswith(".")
    for fragment in ("987", "654", "nan", "inf", "1.7e", "9807", "11460", "499.9", "-9"):
        assert fragment not in message


def test_errors_of_a_recording_are_value_errors_of_this_package():
    with pytest.raises(TraceError) as raised:
        prepare(Recording())
    assert isinstance(raised.value, HeadimpactError)
    assert isinstance(raised.value, ValueError)


@pytest.mark.parametrize(
    ("name", "unit", "bound"),
    [
        ("linear_acceleration", "g", 1000.0),
        ("angular_velocity", "rad/s", 200.0),
        ("angular_acceleration", "rad/s^2", 200_000.0),
    ],
)
def test_a_value_at_its_bound_is_still_accepted(name, unit, bound):
    x = {"linear_acceleration": A, "angular_velocity": W, "angular_acceleration": ALPHA}[name]
    for value in (bound, -bound):
        changed = recording(low_pass=NO_FILTER, **{name: Signal(at(x, 50, 1, value), unit, 1e3)})
        assert prepare(changed).kinematics.samples == 100
    with pytest.raises(TraceError, match=f"{bound:g}"):
        prepare(recording(**{name: Signal(at(x, 50, 1, bound * (1.0 + 1e-11)), unit, 1e3)}))


@pytest.mark.parametrize(
    ("name", "unit", "value"),
    [
        ("linear_acceleration", "m/s^2", 1000.0 * 9.80665),
        ("angular_velocity", "deg/s", np.degrees(200.0)),
        ("angular_acceleration", "deg/s^2", 11459155.902616465),  # 200 000 rad/s^2, and by its conversion a hair more
        ("angular_acceleration", "rad/s^2", 11459155.902616465 * np.radians(1.0)),
    ],
)
@pytest.mark.parametrize("time", [{"sample_rate_hz": 1e3}, {"time_s": stamps()}])
def test_a_value_at_its_bound_is_accepted_in_every_unit(name, unit, value, time):
    x = {"linear_acceleration": A, "angular_velocity": W, "angular_acceleration": ALPHA}[name]
    for sign in (1.0, -1.0):
        given = recording(low_pass=NO_FILTER, **{name: Signal(at(x, 50, 1, sign * value), unit, **time)})
        assert prepare(given).kinematics.samples == 100
        assert list(broken_rules(given)) == []
    beyond = recording(**{name: Signal(at(x, 50, 1, value * (1.0 + 1e-11)), unit, **time)})
    with pytest.raises(TraceError, match="must stay within"):
        prepare(beyond)
    assert [fault.code for fault in broken_rules(beyond)] == ["value-out-of-range"]


def test_an_integral_at_its_bound_is_still_accepted_and_one_of_a_block_is_refused_alone():
    def pushed(size: float) -> Recording:
        return Recording(angular_acceleration=Signal(at(np.zeros((101, 3)), 50, 1, size), "rad/s^2", 500.0))

    whole, beyond, other = prepare_many([pushed(1e5), pushed(1.001e5), pushed(9e4)])
    assert whole.kinematics.angular_velocity.max() == 200.0
    assert (beyond.code, beyond.signal) == ("value-out-of-range", "angular_acceleration")
    assert other.kinematics.angular_velocity.max() == 180.0


@pytest.mark.parametrize("samples", [3, 20_000])
def test_the_shortest_and_the_longest_record_are_accepted(samples):
    x = np.tile(A, (200, 1))[:samples]
    assert prepare(Recording(Signal(x, "g", 1000.0))).kinematics.samples == samples


@pytest.mark.parametrize("rate_hz", [500.0, 1e6])
def test_the_lowest_and_the_highest_rate_are_accepted(rate_hz):
    assert prepare(Recording(Signal(A, "g", rate_hz))).kinematics.sample_rate_hz == rate_hz


def test_steps_within_15_percent_of_their_median_are_accepted():
    steps = np.full(99, 0.001)
    steps[10], steps[40] = 0.00086, 0.00114
    time_s = np.concatenate(([0.0], np.cumsum(steps)))
    assert prepare(stamped(time_s)).kinematics.samples > 90
    steps[10] = 0.00084
    with pytest.raises(TraceError, match="15%") as raised:
        prepare(stamped(np.concatenate(([0.0], np.cumsum(steps)))))
    assert raised.value.index == 11


@pytest.mark.parametrize("digits", [3, 4])
@pytest.mark.parametrize("start_s", [0.0, -0.01, 1_764_270_000.0])
def test_stamps_that_may_be_rounded_are_refused_with_the_remedy(digits, start_s):
    with pytest.raises(TraceError) as caught:
        prepare(stamped(np.round(start_s + np.arange(100) / 3200.0, digits)))
    assert caught.value.code == ("time-not-increasing" if digits == 3 else "time-jitter")
    assert str(caught.value).endswith("; if they are rounded, give sample_rate_hz for them.")


@pytest.mark.parametrize(
    "time_s",
    [
        np.concatenate((stamps()[:50], stamps()[50:] + 0.002)),  # a gap of two whole samples
        stamps(s99=np.inf),
        stamps(s5=np.nan),
        stamps(s5=0.0031),
        np.round(stamps(s5=0.00523), 5),
        np.zeros(100),
    ],
)
def test_stamps_that_no_rounding_explains_are_refused_without_it(time_s):
    with pytest.raises(TraceError) as caught:
        prepare(stamped(time_s))
    assert "rounded" not in str(caught.value)


def test_one_moving_channel_is_enough():
    still = np.zeros((100, 3))
    assert prepare(Recording(angular_velocity=Signal(at(still, 50, 2, 0.1), "rad/s", 1e3))).kinematics.samples == 100


@pytest.mark.parametrize("sensor", ["accelerometer", "gyroscope"])
@pytest.mark.parametrize(
    "matrix",
    [
        np.diag([1.0, 1.0, -1.0]),  # a public vendor's axis map is of this kind: determinant -1
        np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        np.eye(3) * 1.01,
        np.zeros((3, 3)),
        np.full((3, 3), np.nan),
        np.eye(3) + np.array([[0, 0.002, 0], [0, 0, 0], [0, 0, 0]]),
    ],
    ids=["mirrored z", "swapped x and y", "scaled", "zero", "not a number", "sheared"],
)
def test_a_mounting_that_is_no_rotation_is_refused(matrix, sensor):
    rotations = {"accelerometer": (matrix, np.eye(3)), "gyroscope": (np.eye(3), matrix)}[sensor]
    with pytest.raises(TraceError, match=sensor) as raised:
        Mounting(*rotations, np.zeros(3))
    assert raised.value.code == "improper-rotation"


def test_a_mirrored_mounting_is_told_from_one_that_is_not_orthonormal():
    with pytest.raises(TraceError, match="mirrors"):
        Mounting(np.diag([1.0, -1.0, 1.0]), np.eye(3), np.zeros(3))
    with pytest.raises(TraceError, match="orthonormal"):
        Mounting(np.eye(3) * 2, np.eye(3), np.zeros(3))


def test_a_rotation_printed_to_four_digits_is_accepted():
    matrix = np.round(rotation_matrix([1, 2, 3], 0.7), 4)
    assert Mounting(matrix, np.eye(3), np.zeros(3)).accelerometer_rotation is matrix


def test_an_offset_of_zero_needs_no_rotation():
    mounting = Mounting(np.eye(3), np.eye(3), np.zeros(3))
    assert prepare(replace(recording(angular_velocity=None), mounting=mounting)).kinematics.samples == 100


def test_an_offset_that_is_no_length_is_refused():
    with pytest.raises(TraceError) as raised:
        Mounting(np.eye(3), np.eye(3), np.array([0.0, np.nan, 0.0]))
    assert raised.value.code == "improper-offset"


def test_a_missing_sample_is_named_where_it_was_sent_though_others_were_filled_in_before_it():
    keep = np.setdiff1d(np.arange(100), [20, 21, 40])  # gaps that the stamps show and that are filled
    values = recording().linear_acceleration.values[keep].copy()
    values[80:84, 1] = np.nan  # too many to be filled
    sent = Recording(Signal(values, "g", time_s=keep / 1000.0), fill_gaps=True)
    faults = [(fault.code, fault.channel, fault.index) for fault in broken_rules(sent)]
    assert faults == [("missing-sample", "y", index) for index in range(80, 84)]
