"""The brain model: Table 2, closed forms, and an independent solution at 40 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from exact_brain import TABLE_2, exact_histories
from hypothesis import given, settings
from hypothesis import strategies as st
from waveforms import along, burst, pulse

from headimpact.brain import BRAIN, brain_angle_history, peak_brain_angles
from headimpact.published import BRAIN_MODEL

RATES = [500.0, 1000.0, 3200.0, 10_000.0, 20_000.0]


def shapes(rate_hz: float, samples: int) -> dict[str, np.ndarray]:
    generator = np.random.default_rng(7)
    return {
        "noise": generator.normal(0, 2000, (samples, 3)),
        "burst": burst(generator, samples, 3000.0, rate_hz),
        "half sine": np.stack([pulse("half_sine", 0.03, 4000.0, rate_hz, samples) * k for k in (1, -0.5, 2)], axis=1),
        "step": np.full((samples, 3), 1000.0),
    }


def relative_error(found: np.ndarray, expected: np.ndarray) -> float:
    return float((np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())


@pytest.mark.parametrize("shape", ["noise", "burst", "half sine", "step"])
@pytest.mark.parametrize("rate_hz", RATES)
def test_the_history_equals_a_40_digit_solution(rate_hz, shape):
    # at every sample, relative to the axis' peak; the requirement is 1e-9
    alpha = shapes(rate_hz, round(0.2 * rate_hz) + 1)[shape]
    expected = exact_histories(alpha, rate_hz)
    assert relative_error(brain_angle_history(alpha, rate_hz), expected) < 1e-12
    peaks, resultant = peak_brain_angles(alpha, rate_hz)
    np.testing.assert_allclose(peaks, np.abs(expected).max(axis=0), rtol=1e-12)
    assert resultant == pytest.approx(np.sqrt((expected**2).sum(axis=1).max()), rel=1e-12)


@pytest.mark.parametrize("rate_hz", RATES)
def test_a_record_of_20_000_samples_equals_a_40_digit_solution(rate_hz):
    # the longest record there is: 40 s at 500 Hz, a hundred times the time constants
    alpha = np.random.default_rng(11).normal(0, 2000, (20_000, 3))
    expected = exact_histories(alpha, rate_hz)
    assert relative_error(brain_angle_history(alpha, rate_hz), expected) < 1e-12


@pytest.mark.parametrize("rate_hz", [1000.0, 20_000.0])
def test_a_pulse_early_in_a_long_record_decays_without_a_trace_of_rounding(rate_hz):
    # after the pulse the angle falls by exp(-L t); an unstable recursion would leave its rounding behind
    samples = 10_000
    alpha = np.stack([pulse("half_sine", 0.02, 5000.0, rate_hz, samples)] * 3, axis=1)
    found, expected = brain_angle_history(alpha, rate_hz), exact_histories(alpha, rate_hz)
    largest = np.abs(expected).max(axis=0)
    assert np.all(np.abs(found - expected) <= 1e-12 * largest)
    quiet = np.arange(samples) / rate_hz > 0.04 + 0.3
    assert np.all(np.abs(found[quiet]) < np.exp(-30 * 0.29) * largest)


@pytest.mark.parametrize("samples", [3, 4, 7])
def test_the_shortest_records_are_solved_too(samples):
    alpha = np.random.default_rng(3).normal(0, 2000, (samples, 3))
    assert relative_error(brain_angle_history(alpha, 1000.0), exact_histories(alpha, 1000.0)) < 1e-12


def test_at_a_million_samples_a_second_no_digits_are_lost():
    # where exp(s dt) - 1 - s dt cancels
    alpha = np.random.default_rng(5).normal(0, 2000, (2000, 3))
    assert relative_error(brain_angle_history(alpha, 1e6), exact_histories(alpha, 1e6)) < 1e-11


@pytest.mark.parametrize("axis", range(3))
def test_the_response_to_a_step_equals_its_closed_form_at_every_sample(axis):
    decay, damped_hz = TABLE_2["xyz"[axis]]
    wd = 2 * np.pi * damped_hz
    t = np.arange(400) / 1000.0
    expected = -1000.0 / (wd**2 + decay**2) * (1 - np.exp(-decay * t) * (np.cos(wd * t) + decay / wd * np.sin(wd * t)))
    found = brain_angle_history(along(np.full(400, 1000.0), axis), 1000.0)[:, axis]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_a_held_step_of_1000_rad_s2_reaches_the_known_brain_angles():
    # closed form: (alpha/wn^2)(1 + exp(-pi L/wd)) = 0.07368, 0.06917, 0.06056 rad
    closed = []
    for decay, damped_hz in TABLE_2.values():
        wd = 2 * mpmath.pi * damped_hz
        closed.append(float(1000 / (wd**2 + decay**2) * (1 + mpmath.exp(-mpmath.pi * decay / wd))))
    assert [round(value, 5) for value in closed] == [0.07368, 0.06917, 0.06056]
    # the peak is read at the samples: within (wd dt)^2 / 8 of the crest
    found, _ = peak_brain_angles(np.full((2000, 3), 1000.0), 20_000.0)
    np.testing.assert_allclose(found, closed, rtol=1e-5)


def test_an_impulse_of_1_rad_s_reaches_the_known_brain_angles():
    # closed form: exp(-(L/wd) atan(wd/L))/wn = 5.164, 4.876, 4.802 mrad
    closed = []
    for decay, damped_hz in TABLE_2.values():
        wd = 2 * mpmath.pi * damped_hz
        closed.append(float(mpmath.exp(-decay / wd * mpmath.atan(wd / decay)) / mpmath.sqrt(wd**2 + decay**2)))
    assert [round(value * 1000, 3) for value in closed] == [5.164, 4.876, 4.802]
    rate_hz = 1e6
    alpha = np.zeros((20_000, 3))
    alpha[1] = rate_hz  # a triangle of two steps, area 1
    np.testing.assert_allclose(peak_brain_angles(alpha, rate_hz)[0], closed, rtol=1e-7)


def test_stiffness_and_damping_as_printed_follow_from_the_damped_frequency_and_the_decay_rate():
    # Table 2: k = I wn^2, c = 2 I L; misprint 7
    inertia = np.array(BRAIN_MODEL["inertia_kg_m2"])
    stiffness = inertia * BRAIN.natural_frequency_squared
    damping = 2 * inertia * np.array(BRAIN_MODEL["decay_rate_per_s"])
    np.testing.assert_allclose(stiffness, [322.105, 493.237, 562.628], atol=5e-4)
    assert [round(k, 1) for k in stiffness] == BRAIN_MODEL["printed"]["stiffness_n_m_per_rad"] == [322.1, 493.2, 562.6]
    assert [round(c, 3) for c in damping] == BRAIN_MODEL["printed"]["damping_n_m_s_per_rad"] == [1.024, 1.824, 1.320]


def test_with_the_printed_frequency_as_the_undamped_one_the_printed_stiffness_does_not_follow():
    # misprint 7: the other reading of "natural frequency"
    inertia = np.array(BRAIN_MODEL["inertia_kg_m2"])
    undamped = inertia * (2 * np.pi * np.array(BRAIN_MODEL["damped_frequency_hz"])) ** 2
    printed = np.array(BRAIN_MODEL["printed"]["stiffness_n_m_per_rad"])
    assert np.all(np.abs(undamped / printed - 1) > 0.03)


@given(st.integers(0, 2**32 - 1), st.floats(-10, 10), st.floats(-10, 10))
@settings(deadline=None, max_examples=50)
def test_the_brain_model_is_linear(seed, p, q):
    generator = np.random.default_rng(seed)
    a, b = generator.normal(0, 1000, (2, 80, 3))
    found = brain_angle_history(p * a + q * b, 1000.0)
    parts = p * brain_angle_history(a, 1000.0) + q * brain_angle_history(b, 1000.0)
    np.testing.assert_allclose(found, parts, rtol=0, atol=1e-12 * (abs(p) + abs(q) + 1))


@given(st.integers(0, 2**32 - 1), st.sampled_from([2, 3, 5]))
@settings(deadline=None, max_examples=30)
def test_resampling_by_linear_interpolation_changes_nothing_at_the_old_samples(seed, factor):
    # the input is the same function of time: linear between samples
    alpha = np.random.default_rng(seed).normal(0, 1000, (60, 3))
    fine_t = np.arange(59 * factor + 1) / factor
    fine = np.stack([np.interp(fine_t, np.arange(60), alpha[:, i]) for i in range(3)], axis=1)
    found = brain_angle_history(fine, 1000.0 * factor)[::factor]
    expected = brain_angle_history(alpha, 1000.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize(("rate_hz", "samples"), [(1000.0, 100), (500.0, 5000), (3200.0, 4000)])
def test_a_block_of_impacts_equals_each_of_them_bit_for_bit(rate_hz, samples):
    # the longer ones cross the segments that the solution works in
    block = np.random.default_rng(2).normal(0, 2000, (samples, 3, 20))
    together = brain_angle_history(block, rate_hz)
    for i in range(block.shape[2]):
        np.testing.assert_array_equal(together[..., i], brain_angle_history(block[..., i], rate_hz))


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(60))
def test_random_records_of_many_lengths_and_rates_equal_a_40_digit_solution(seed):
    generator = np.random.default_rng(seed)
    rate_hz, samples = float(generator.uniform(500, 20_000)), int(generator.integers(3, 20_001))
    alpha = generator.normal(0, 10 ** generator.uniform(0, 5), (samples, 3))
    assert relative_error(brain_angle_history(alpha, rate_hz), exact_histories(alpha, rate_hz)) < 1e-12


@given(st.integers(0, 10_000), st.floats(1e-6, 1e6))
@settings(deadline=None, max_examples=50)
def test_peaks_are_the_largest_samples_of_the_history_to_the_last_bit(seed, scale):
    alpha = np.random.default_rng(seed).normal(size=(60, 3)) * scale
    history = brain_angle_history(alpha, 1000.0)
    components, resultant = peak_brain_angles(alpha, 1000.0)
    assert components.tolist() == np.abs(history).max(axis=0).tolist()
    assert resultant == pytest.approx(np.linalg.norm(history, axis=1).max(), rel=1e-15)


def test_more_impacts_than_a_block_holds_have_the_peaks_of_each():
    alpha = np.random.default_rng(5).normal(size=(12_000, 3, 19)) * 500
    together, resultants = peak_brain_angles(alpha, 10_000.0)
    for impact in range(19):
        components, resultant = peak_brain_angles(np.ascontiguousarray(alpha[..., impact]), 10_000.0)
        np.testing.assert_array_equal(together[:, impact], components)
        assert resultants[impact] == resultant
