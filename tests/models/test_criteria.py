"""The thirteen criteria against their definitions written out, and the laws they obey."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from exact_brain import exact_histories
from hypothesis import given, settings
from hypothesis import strategies as st
from waveforms import impact, rotation_matrix, values_of
from waveforms import linear as linear_only
from waveforms import rotational as rotation_only

from headimpact.brain import BRAIN, Oscillators, brain_angle_history
from headimpact.criteria import CRITERIA, CRITERION_KEYS, evaluate
from headimpact.kinematics import HeadKinematics

# How each criterion grows when every signal is multiplied by one factor; VTCP is a probability and obeys no such law.
DEGREES = {
    "peak_angular_acceleration": 1,
    "delta_angular_velocity": 1,
    "bric": 1,
    "ric": 2.5,
    "peak_linear_acceleration": 1,
    "hic15": 2.5,
    "hic36": 2.5,
    "si": 2.5,
    "hip": 2,
    "hip3d": 2,
    "gambit": 1,
    "bam": 1,
}
seeds = st.integers(0, 2**32 - 1)
lengths = st.integers(5, 130)
rates = st.sampled_from([500.0, 1000.0, 3200.0])
some = settings(deadline=None, max_examples=40)


def scaled(k: HeadKinematics, linear: np.ndarray | float, angular: np.ndarray | float) -> HeadKinematics:
    return HeadKinematics(
        k.sample_rate_hz,
        k.linear_acceleration_g * linear,
        k.angular_velocity * angular,
        k.angular_acceleration * angular,
    )


def values(kinematics: HeadKinematics) -> dict[str, np.ndarray]:
    return values_of(kinematics)


def windowed_maximum(x: np.ndarray, rate_hz: float, limit_s: float) -> float:
    integral = np.concatenate(([0.0], np.cumsum((x[1:] + x[:-1]) / 2 / rate_hz)))
    longest = int(np.floor(limit_s * rate_hz + 1e-6))
    return max(
        (k / rate_hz) * float(np.max(integral[k:] - integral[:-k]) * rate_hz / k) ** 2.5
        for k in range(1, min(longest, x.size - 1) + 1)
    )


def by_definition(k: HeadKinematics) -> dict[str, np.ndarray | float]:
    """Each criterion as the paper's supplementary section defines it (misprints corrected), one line of NumPy each."""
    a, w, alpha, rate = k.linear_acceleration_g, k.angular_velocity, k.angular_acceleration, k.sample_rate_hz
    norm_a, norm_alpha = np.linalg.norm(a, axis=1), np.linalg.norm(alpha, axis=1)

    def running(x: np.ndarray) -> np.ndarray:
        return np.array([np.trapezoid(x[: i + 1], dx=1 / rate, axis=0) for i in range(x.shape[0])])

    metres = a * 9.80665
    power = 4.5 * metres * running(metres) + np.array([0.016, 0.024, 0.022]) * alpha * running(alpha)
    peak_a, peak_alpha = norm_a.max(), norm_alpha.max()
    e = -10.2 + 0.0433 * peak_a + 0.000873 * peak_alpha - 9.2e-7 * peak_a * peak_alpha
    return {
        "peak_angular_acceleration": np.abs(alpha).max(axis=0),
        "delta_angular_velocity": np.ptp(w, axis=0),
        "bric": sqrt(sum((np.abs(w).max(axis=0) / np.array([66.2, 59.1, 44.2])) ** 2)),
        "ric": windowed_maximum(norm_alpha, rate, 0.036),
        "peak_linear_acceleration": np.abs(a).max(axis=0),
        "hic15": windowed_maximum(norm_a, rate, 0.015),
        "hic36": windowed_maximum(norm_a, rate, 0.036),
        "si": np.trapezoid(norm_a**2.5, dx=1 / rate),
        "hip": power.sum(axis=1).max(),
        "hip3d": power.max(axis=0),
        "gambit": np.sqrt((norm_alpha / 25_000) ** 2 + (norm_a / 250) ** 2).max(),
        "vtcp": 1 / (1 + np.exp(-e)),
        "bam": np.abs(exact_histories(alpha, rate)).max(axis=0),
    }


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("samples", "rate_hz"), [(5, 1000.0), (100, 1000.0), (160, 3200.0)])
def test_every_criterion_equals_its_definition(samples, rate_hz, seed):
    kinematics = impact(seed, samples, rate_hz)
    expected, found = by_definition(kinematics), values(kinematics)
    assert list(expected) == list(CRITERION_KEYS)
    for key in CRITERION_KEYS:
        np.testing.assert_allclose(found[key], expected[key], rtol=1e-11, err_msg=key)


def test_the_registry_names_thirteen_criteria_with_their_components_and_units():
    # science: the table of criteria
    assert [(c.key, c.components, c.unit) for c in CRITERIA] == [
        ("peak_angular_acceleration", 3, "rad/s^2"),
        ("delta_angular_velocity", 3, "rad/s"),
        ("bric", 1, "-"),
        ("ric", 1, "(rad/s^2)^2.5 s"),
        ("peak_linear_acceleration", 3, "g"),
        ("hic15", 1, "g^2.5 s"),
        ("hic36", 1, "g^2.5 s"),
        ("si", 1, "g^2.5 s"),
        ("hip", 1, "W"),
        ("hip3d", 3, "W"),
        ("gambit", 1, "-"),
        ("vtcp", 1, "-"),
        ("bam", 3, "rad"),
    ]


@given(seeds, lengths, rates, st.floats(1e-3, 1e3))
@some
def test_each_criterion_grows_with_its_own_power_of_the_motion(seed, samples, rate_hz, factor):
    kinematics = impact(seed, samples, rate_hz)
    before, after = values(kinematics), values(scaled(kinematics, factor, factor))
    assert set(DEGREES) == set(CRITERION_KEYS) - {"vtcp"}
    for key, degree in DEGREES.items():
        np.testing.assert_allclose(after[key], before[key] * factor**degree, rtol=1e-11, atol=0, err_msg=key)


@given(seeds, lengths, st.lists(st.sampled_from([-1.0, 1.0]), min_size=6, max_size=6))
@some
def test_turning_the_sign_of_any_axis_changes_none_of_the_thirteen(seed, samples, signs):
    kinematics = impact(seed, samples)
    before = values(kinematics)
    after = values(scaled(kinematics, np.array(signs[:3]), np.array(signs[3:])))
    for key in CRITERION_KEYS:
        np.testing.assert_array_equal(after[key], before[key], err_msg=key)


@given(seeds, lengths, st.permutations(range(3)))
@some
def test_exchanging_axes_moves_the_components_of_the_peaks_and_leaves_the_resultants(seed, samples, order):
    k = impact(seed, samples)
    moved = HeadKinematics(
        k.sample_rate_hz,
        k.linear_acceleration_g[:, order],
        k.angular_velocity[:, order],
        k.angular_acceleration[:, order],
    )
    before, after = values(k), values(moved)
    for key in ("peak_angular_acceleration", "delta_angular_velocity", "peak_linear_acceleration"):
        np.testing.assert_array_equal(after[key], before[key][order], err_msg=key)
    for key in ("ric", "hic15", "hic36", "si", "gambit", "vtcp"):
        np.testing.assert_allclose(after[key], before[key], rtol=1e-12, err_msg=key)
    # HIP3D moves too, but for the head's moments of inertia, which stay with their axes
    linear_before, linear_after = (values(scaled(x, 1.0, 0.0))["hip3d"] for x in (k, moved))
    np.testing.assert_array_equal(linear_after, linear_before[order])


@given(seeds, lengths, st.permutations(range(3)))
@some
def test_exchanging_axes_moves_the_brain_angles_with_their_oscillators(seed, samples, order):
    # each axis has its own oscillator: the angles move exactly when these are exchanged too
    alpha = impact(seed, samples).angular_acceleration
    exchanged = Oscillators(tuple(BRAIN.decay_rate[i] for i in order), tuple(BRAIN.damped_frequency[i] for i in order))
    np.testing.assert_array_equal(
        brain_angle_history(alpha[:, order], 1000.0, exchanged), brain_angle_history(alpha, 1000.0)[:, order]
    )


def test_the_same_rotation_about_each_axis_gives_three_brain_angles_and_three_shares_of_bric():
    # so an exchange of axes alone changes BAM, BrIC and HIP
    k = impact(8)
    found = {"bam": [], "bric": [], "hip": []}
    for axis in range(3):
        only = np.zeros(3)
        only[axis] = 1.0
        alpha, w = (x[:, [0]] * only for x in (k.angular_acceleration, k.angular_velocity))
        result = values(HeadKinematics(1000.0, np.zeros_like(alpha), w, alpha))
        assert np.count_nonzero(result["bam"]) == 1
        found["bam"].append(float(result["bam"][axis]))
        found["bric"].append(float(result["bric"]))
        found["hip"].append(float(result["hip"]))
    for key, three in found.items():
        assert len({round(v, 9) for v in three}) == 3, key
    np.testing.assert_allclose(np.divide(found["hip"], [0.016, 0.024, 0.022]).std(), 0, atol=1e-6)


@given(seeds, st.floats(0, 2 * np.pi))
@some
def test_turning_the_linear_acceleration_changes_only_what_is_read_by_axis(seed, angle):
    generator = np.random.default_rng(seed)
    k = impact(seed)
    turned = linear_only(k.linear_acceleration_g @ rotation_matrix(generator.normal(size=3), angle).T, 1000.0)
    before, after = values(k), values(turned)
    for key in ("hic15", "hic36", "si"):
        np.testing.assert_allclose(after[key], before[key], rtol=1e-11)


@given(seeds, lengths, rates)
@some
def test_hic36_is_never_below_hic15(seed, samples, rate_hz):
    found = values(impact(seed, samples, rate_hz))
    assert found["hic36"] >= found["hic15"]


@given(seeds, lengths, rates)
@some
def test_hic_is_never_above_the_severity_index(seed, samples, rate_hz):
    # Jensen's inequality, window by window; trapezoids keep it for the powers of the samples
    found = values(impact(seed, samples, rate_hz))
    assert found["hic36"] <= found["si"] * (1 + 1e-12)


@given(seeds, lengths, rates, st.integers(1, 300))
@some
def test_rest_before_the_impact_changes_nothing_but_the_times(seed, samples, rate_hz, rest):
    k = impact(seed, samples, rate_hz)
    signals = []
    for x in (k.linear_acceleration_g, k.angular_velocity, k.angular_acceleration):
        still = x.copy()
        still[0] = 0.0
        signals.append(still)
    before = evaluate(HeadKinematics(rate_hz, *signals).motion)
    later = HeadKinematics(rate_hz, *(np.concatenate((np.zeros((rest, 3)), x)) for x in signals))
    after = evaluate(later.motion)
    for key in CRITERION_KEYS:
        np.testing.assert_allclose(after.values[key], before.values[key], rtol=1e-11, err_msg=key)
    for key, window in before.windows.items():
        np.testing.assert_array_equal(np.array(after.windows[key]), np.array(window) + rest)


@given(seeds, st.integers(1, 300))
@some
def test_rest_after_the_impact_never_lowers_a_criterion(seed, rest):
    # BAM's free vibration may peak later; the others stay
    k = impact(seed, 60)
    longer = HeadKinematics(
        1000.0,
        *(
            np.concatenate((x * np.append(np.ones(59), 0)[:, None], np.zeros((rest, 3))))
            for x in (k.linear_acceleration_g, k.angular_velocity, k.angular_acceleration)
        ),
    )
    shorter = HeadKinematics(
        1000.0,
        *(x[:60] for x in (longer.linear_acceleration_g, longer.angular_velocity, longer.angular_acceleration)),
    )
    before, after = values(shorter), values(longer)
    for key in CRITERION_KEYS:
        assert np.all(after[key] >= before[key] * (1 - 1e-12)), key


@given(seeds, st.sampled_from([2, 3, 4]))
@some
def test_resampling_between_the_samples_changes_bam_only_by_what_lies_between_them(seed, factor):
    alpha = impact(seed, 100).angular_acceleration
    t = np.arange(99 * factor + 1) / factor
    fine = np.stack([np.interp(t, np.arange(100), alpha[:, i]) for i in range(3)], axis=1)
    coarse, dense = values(rotation_only(alpha, 1000.0)), values(rotation_only(fine, 1000.0 * factor))
    assert np.all(dense["bam"] >= coarse["bam"] * (1 - 1e-12))
    # between two samples the angle is off its larger neighbour by at most (slope change)/8 dt^2 ~ 1e6/8 1e-6 alpha/wn^2
    bound = np.abs(alpha).max(axis=0) * 1.5e-3**2
    assert np.all(dense["bam"] <= coarse["bam"] + bound)
    np.testing.assert_array_equal(dense["peak_angular_acceleration"], coarse["peak_angular_acceleration"])


@pytest.mark.parametrize(
    ("signal", "has"),
    [
        ("linear_acceleration_g", {"peak_linear_acceleration", "hic15", "hic36", "si"}),
        ("angular_velocity", {"delta_angular_velocity", "bric"}),
        ("angular_acceleration", {"peak_angular_acceleration", "ric", "bam"}),
    ],
)
def test_each_signal_alone_allows_its_own_criteria(signal, has):
    k = impact(1)
    alone = dict.fromkeys(("linear_acceleration_g", "angular_velocity", "angular_acceleration"))
    alone[signal] = getattr(k, signal)
    assert set(values(HeadKinematics(1000.0, **alone))) == has


def test_a_gambit_of_one_is_either_critical_acceleration_alone():
    # the paper: alpha_c = 25 000 rad/s^2, a_c = 250 g, n = m = s = 2 (misprint 9; Newman 1985 used 10 000 rad/s^2)
    peak, still = np.array([[0.0] * 3, [0.0, 1.0, 0.0], [0.0] * 3]), np.zeros((3, 3))
    assert values(HeadKinematics(1000.0, peak * 250, None, still))["gambit"] == pytest.approx(1.0)
    assert values(HeadKinematics(1000.0, still, None, peak * 25_000))["gambit"] == pytest.approx(1.0)
    assert values(HeadKinematics(1000.0, peak * 250, None, peak * 25_000))["gambit"] == pytest.approx(sqrt(2))


def test_a_head_at_rest_has_a_vtcp_near_zero():
    # misprint 3: with the printed signs, 1/(1 + e^(-10.2)), no acceleration at all would be a certain concussion
    still = np.zeros((3, 3))
    found = float(values(HeadKinematics(1000.0, still, None, still))["vtcp"])
    assert found == pytest.approx(1 / (1 + np.exp(10.2)), rel=1e-12)
    assert found < 4e-5 < 0.9999 < 1 / (1 + np.exp(-10.2))


def test_vtcp_rises_with_each_acceleration():
    # misprint 3: Rowson & Duma 2013 have +0.0433
    peak, still = np.array([[0.0] * 3, [1.0, 0.0, 0.0], [0.0] * 3]), np.zeros((3, 3))

    def of(a: float, alpha: float) -> float:
        return float(values(HeadKinematics(1000.0, still + peak * a, None, still + peak * alpha))["vtcp"])

    assert of(0, 0) < of(50, 0) < of(100, 0) < of(150, 0)
    assert of(0, 0) < of(0, 3000) < of(0, 6000)
    assert of(100, 6000) == pytest.approx(1 / (1 + np.exp(10.2 - 4.33 - 5.238 + 0.552)), rel=1e-12)


def test_vtcp_of_motions_far_beyond_any_head_is_a_probability_still():
    # a transfer to the centre of gravity can carry a past what is accepted as sent
    peak = np.array([[0.0] * 3, [1.0, 1.0, 1.0], [0.0] * 3])
    assert float(values(HeadKinematics(1000.0, peak * 5000, None, peak * 200_000))["vtcp"]) == 0.0
