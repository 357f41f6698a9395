"""The low-pass filters, against SciPy's own zero-phase filter and their definitions."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal
from waveforms import recording

from headimpact import filtering
from headimpact.cut_offs import CHANNEL_FREQUENCY_CLASSES, NO_FILTER, PAPER, LowPass, corner_frequency
from headimpact.filtering import low_pass
from headimpact.preparation import prepare

RATES = [1000.0, 3200.0, 10_000.0, 20_000.0]


def zero_phase(x: np.ndarray, corner_hz: float, rate_hz: float) -> np.ndarray:
    """The filter as the paper's convention defines it."""
    sections = signal.butter(2, corner_hz, fs=rate_hz, output="sos")
    return signal.sosfiltfilt(sections, x, axis=0, padtype="odd", padlen=min(9, x.shape[0] - 1))


@pytest.mark.parametrize("samples", [1, 2, 3, 5, 9, 10, 11, 100, 5000])
@pytest.mark.parametrize("cut_off", [300.0, 184.0, "CFC60", "CFC180"])
@pytest.mark.parametrize("rate_hz", RATES)
def test_the_filter_equals_scipys_zero_phase_filter(rate_hz, cut_off, samples):
    x = np.random.default_rng(1).normal(3, 20, (samples, 3)) + np.arange(samples)[:, None] * 0.01
    corner = corner_frequency(cut_off, rate_hz)
    expected = zero_phase(x, corner, rate_hz)
    np.testing.assert_allclose(low_pass(x.T, corner, rate_hz).T, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("samples", [1, 2, 3, 50])
def test_nothing_is_read_of_memory_that_was_not_written(monkeypatch: pytest.MonkeyPatch, samples: int):
    """Whatever is in fresh memory, not even a warning comes of it."""
    x = np.random.default_rng(3).normal(0, 20, (3, samples))
    expected = low_pass(x, 300.0, 1000.0)
    filtering._bands.cache_clear()
    for name in ("empty", "empty_like"):
        made = getattr(np, name)
        monkeypatch.setattr(np, name, lambda *a, made=made, **k: poisoned(made(*a, **k)))
    found = low_pass(x, 300.0, 1000.0)
    monkeypatch.undo()
    np.testing.assert_array_equal(found, expected)


def poisoned(fresh: np.ndarray) -> np.ndarray:
    fresh.view(np.uint64).fill(0x7FF0_0000_0000_0001)  # a NaN that arithmetic warns of
    return fresh


def test_a_block_of_impacts_is_filtered_as_each_of_them():
    x = np.random.default_rng(1).normal(0, 20, (7, 3, 100))
    together = low_pass(x, 300.0, 1000.0)
    for i in range(7):
        np.testing.assert_array_equal(together[i], low_pass(x[i], 300.0, 1000.0))


@pytest.mark.parametrize("rate_hz", RATES)
@pytest.mark.parametrize("cut_off", [300.0, 184.0])
def test_both_passes_together_have_a_gain_of_one_over_root_two_at_the_cut_off(cut_off, rate_hz):
    # "CFC180 filter of 300Hz", "sensor bandwidth of 184Hz": the -3 dB frequencies of what is applied
    sections = signal.butter(2, corner_frequency(cut_off, rate_hz), fs=rate_hz, output="sos")
    _, (response,) = signal.freqz_sos(sections, worN=[cut_off], fs=rate_hz)
    assert abs(response) ** 2 == pytest.approx(1 / sqrt(2), rel=1e-12)


def test_a_sine_at_the_cut_off_comes_out_with_one_over_root_two_of_its_amplitude():
    rate_hz = 10_000.0
    x = np.sin(2 * np.pi * 300 * np.arange(20_000) / rate_hz)
    y = low_pass(x, corner_frequency(300.0, rate_hz), rate_hz)
    middle = slice(5000, 15_000)
    assert float((x[middle] * y[middle]).mean() / (x[middle] ** 2).mean()) == pytest.approx(1 / sqrt(2), rel=1e-9)


def test_a_butterworth_filter_designed_at_the_cut_off_would_be_at_one_half_there():
    # why the corner is moved: scipy.signal.filtfilt at f is -6 dB at f
    _, (response,) = signal.freqz_sos(signal.butter(2, 300.0, fs=10_000.0, output="sos"), worN=[300.0], fs=10_000.0)
    assert abs(response) ** 2 == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("name", ["CFC60", "CFC180", "CFC600", "CFC1000"])
def test_a_channel_frequency_class_is_minus_3_db_at_five_thirds_of_its_number(name):
    # SAE J211-1: -3 dB at CFC x 5/3, corner 2.0775 CFC; at rates far above the class
    number = CHANNEL_FREQUENCY_CLASSES[name]
    rate_hz = 1e6
    assert corner_frequency(name, rate_hz) == pytest.approx(2.0775 * number, rel=1e-15)
    sections = signal.butter(2, corner_frequency(name, rate_hz), fs=rate_hz, output="sos")
    frequencies = np.linspace(number, 3 * number, 2001)
    _, response = signal.freqz_sos(sections, worN=frequencies, fs=rate_hz)
    assert np.interp(-1 / sqrt(2), -(np.abs(response) ** 2), frequencies) == pytest.approx(number * 5 / 3, rel=0.002)


def test_at_1_khz_the_digital_cfc_180_really_cuts_at_347_hz():
    # the bilinear transform bends the axis where the rate is low: hence the note low_rate_for_class
    sections = signal.butter(2, corner_frequency("CFC180", 1000.0), fs=1000.0, output="sos")
    _, (at_347,) = signal.freqz_sos(sections, worN=[347.0], fs=1000.0)
    _, (at_300,) = signal.freqz_sos(sections, worN=[300.0], fs=1000.0)
    assert abs(at_347) ** 2 < 1 / sqrt(2) + 0.01
    assert abs(at_300) ** 2 > 0.8


@pytest.mark.parametrize("cut_off", [300.0, 184.0, 500.0, "CFC180", "CFC600"])
def test_a_cut_off_at_or_above_half_the_rate_has_no_corner(cut_off):
    corner = 2.0775 * float(cut_off[3:]) if isinstance(cut_off, str) else cut_off
    assert corner_frequency(cut_off, 2 * corner) is None
    assert corner_frequency(cut_off, 2 * corner * 1.001) is not None


@pytest.mark.parametrize(
    ("choice", "corners"),
    [
        (PAPER, {"linear_acceleration": 373.3411421132866, "angular_velocity": 229.21564836152442}),
        (LowPass("CFC1000", "CFC180"), {"linear_acceleration": 2077.5, "angular_velocity": 373.95}),
        (LowPass(angular_velocity="CFC60"), {"angular_velocity": 124.65}),
        (NO_FILTER, {}),
    ],
    ids=["paper", "classes", "one signal", "none"],
)
def test_the_corners_that_were_applied_are_reported(choice, corners):
    # the paper's corners at 10 kHz: tests/data/recordings.json
    prepared = prepare(recording(samples=1000, rate_hz=10_000.0, low_pass=choice))
    assert {f.signal: f.corner_hz for f in prepared.filters} == pytest.approx(corners, rel=1e-14)
    assert all(f.applied for f in prepared.filters)


@given(st.integers(0, 2**32 - 1), st.integers(3, 200), st.sampled_from([1000.0, 3200.0, 10_000.0]))
@settings(deadline=None, max_examples=40)
def test_the_filter_is_linear_and_keeps_an_offset(seed, samples, rate_hz):
    # "no offset removal": what a sensor reads at rest stays
    generator = np.random.default_rng(seed)
    x, z = generator.normal(0, 10, (2, 3, samples))
    corner = corner_frequency(184.0, rate_hz)
    found = low_pass(2 * x - 3 * z + 5, corner, rate_hz)
    expected = 2 * low_pass(x, corner, rate_hz) - 3 * low_pass(z, corner, rate_hz) + 5
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("samples", [1, 2, 3, 7, 10, 64, 100, filtering.SHORT])
def test_the_product_of_a_short_record_is_what_the_recursion_gives(samples: int) -> None:
    x = np.random.default_rng(samples).normal(0, 20, (5, 3, samples))
    expected = filtering._recursion(x, 229.2, 1000.0)
    np.testing.assert_allclose(low_pass(x, 229.2, 1000.0), expected, rtol=0, atol=1e-14 * np.abs(expected).max())


@given(st.integers(0, 2**32 - 1), st.integers(1, 140), st.sampled_from([1000.0, 1600.0, 1007.3]))
@settings(deadline=None, max_examples=60)
def test_a_component_has_the_same_bits_wherever_it_stands(seed: int, samples: int, rate_hz: float) -> None:
    """Alone, among others, under another name, turned over, and however it lies in memory."""
    x = np.random.default_rng(seed).normal(0, 20, (4, 3, samples))
    expected = low_pass(x, 229.2, rate_hz)
    wide = np.empty((4, 5, samples + 3))
    wide[:, 1:4, 2 : samples + 2] = x
    np.testing.assert_array_equal(low_pass(wide[:, 1:4, 2 : samples + 2], 229.2, rate_hz), expected)
    np.testing.assert_array_equal(low_pass(np.asfortranarray(x), 229.2, rate_hz), expected)
    np.testing.assert_array_equal(low_pass(x[:, [2, 0, 1]], 229.2, rate_hz), expected[:, [2, 0, 1]])
    np.testing.assert_array_equal(low_pass(-x, 229.2, rate_hz), -expected)
    np.testing.assert_array_equal(low_pass(x[2, 1], 229.2, rate_hz), expected[2, 1])
