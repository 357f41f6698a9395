"""The paper's Figure 8: contours of risk over half-sine pulses, L-shaped for BAM, straight for the others.

Over duration and amplitude, or over velocity change and acceleration, as the paper's axes are: a contour at constant
amplitude is a horizontal line in both, one at constant amplitude x duration a vertical line in the second.
"""

from __future__ import annotations

from math import atan, exp, pi, sqrt

import numpy as np
import pytest
from exact_brain import TABLE_2
from figure8 import AMPLITUDES, CRITERIA, DURATIONS_S, draw, surface, velocity_change

from headimpact.risk import LAKSARI_2020, linear_predictor_of

RISKS = [0.1, 0.5, 0.9]
each_risk = pytest.mark.parametrize("risk", RISKS)


def weighted(responses: list[float]) -> float:
    """Sum of -b_i times the response of axis i: what multiplies the amplitude in BAM's linear predictor."""
    return -float(np.dot(LAKSARI_2020.curves["bam"].b, responses))


def margin(risk: float) -> float:
    return LAKSARI_2020.curves["bam"].b0 - linear_predictor_of(risk)


def slopes(x: np.ndarray) -> np.ndarray:
    """Slopes of a contour in log-log axes: -1 is a hyperbola, 0 a level line."""
    return np.diff(np.log(x)) / np.diff(np.log(DURATIONS_S))


@pytest.mark.parametrize("key", CRITERIA)
def test_every_criterion_is_proportional_to_the_amplitude_so_that_contours_are_exact(key):
    e = surface().predictors[key] - LAKSARI_2020.curves[key].b0
    np.testing.assert_allclose(e / AMPLITUDES, np.broadcast_to(e[:, :1] / AMPLITUDES[0], e.shape), rtol=1e-9)


@each_risk
def test_long_pulses_reach_a_risk_of_bam_at_one_acceleration_whatever_their_duration(risk):
    # the quasi-static end: the brain angle is alpha/wn^2, the horizontal leg of the L
    static = [1 / ((2 * pi * damped) ** 2 + decay**2) for decay, damped in TABLE_2.values()]
    contour = surface().contour("bam", risk)
    assert contour[-1] == pytest.approx(margin(risk) / weighted(static), rel=2e-3)
    assert np.all(np.abs(slopes(contour)[DURATIONS_S[:-1] > 0.2]) < 0.03)


@each_risk
def test_short_pulses_reach_a_risk_of_bam_at_one_velocity_change_whatever_their_duration(risk):
    # the impulsive end: exp(-(L/wd) atan(wd/L))/wn for each rad/s, the vertical leg of the L
    impulse = []
    for decay, damped in TABLE_2.values():
        wd = 2 * pi * damped
        impulse.append(exp(-decay / wd * atan(wd / decay)) / sqrt(wd**2 + decay**2))
    contour = surface().contour("bam", risk)
    assert velocity_change(DURATIONS_S, contour)[0] == pytest.approx(margin(risk) / weighted(impulse), rel=1e-3)
    np.testing.assert_allclose(slopes(contour)[DURATIONS_S[1:] < 0.003], -1, atol=0.01)


@each_risk
def test_contours_of_bam_fall_steeply_then_flatten(risk):
    # one corner: the slope rises from -1 through the corner and stays near 0, but for the resonance's shallow dip
    contour = surface().contour("bam", risk)
    found = slopes(contour)
    bottom = int(contour.argmin())
    assert np.all(np.diff(contour[: bottom + 1]) < 0)
    assert np.all(np.diff(found[:bottom]) > 0)
    assert 0.02 < DURATIONS_S[bottom] < 0.06
    level = contour[-1]
    assert 0.7 * level < contour[bottom] < level
    assert np.all(contour[bottom:] < 1.01 * level)
    assert contour[0] > 25 * level


def test_the_corner_of_the_l_lies_among_impacts_of_contact_sports():
    # "injuries in our dataset lie near the corner": where the two legs meet, some 10 ms to 30 ms and 3000 rad/s^2
    contour = surface().contour("bam", 0.5)
    constant_velocity = contour[0] * DURATIONS_S[0]
    corner_s = constant_velocity / contour[-1]
    assert 0.010 < corner_s < 0.030
    assert 2000 < contour[-1] < 4000


@each_risk
def test_contours_of_peak_angular_acceleration_are_level_lines(risk):
    contour = surface().contour("peak_angular_acceleration", risk)
    curve = LAKSARI_2020.curves["peak_angular_acceleration"]
    # a half-sine's crest is a sample of it, to (pi/100)^2/8 of its height
    np.testing.assert_allclose(contour, (curve.b0 - linear_predictor_of(risk)) / -sum(curve.b), rtol=5e-4)


@each_risk
def test_contours_of_bric_are_straight_at_one_angular_velocity(risk):
    curve = LAKSARI_2020.curves["bric"]
    shares = sqrt(sum(1 / critical**2 for critical in (66.2, 59.1, 44.2)))
    expected = (curve.b0 - linear_predictor_of(risk)) / -curve.b[0] / shares
    contour = surface().contour("bric", risk)
    np.testing.assert_allclose(velocity_change(DURATIONS_S, contour), expected, rtol=1e-3)
    np.testing.assert_allclose(slopes(contour), -1, atol=0.01)


@pytest.mark.parametrize("key", CRITERIA)
def test_contours_of_a_higher_risk_lie_at_higher_amplitudes(key):
    low, middle, high = (surface().contour(key, risk) for risk in RISKS)
    assert np.all(low < middle)
    assert np.all(middle < high)


def test_in_a_slow_motion_bam_is_calm_where_bric_is_not_and_in_a_short_blow_where_acceleration_is_not():
    # Discussion: voluntary motion at high velocity; very short blows at high acceleration
    bam, alpha, bric = (surface().contour(key, 0.5) for key in CRITERIA)
    slow, short = DURATIONS_S > 0.15, DURATIONS_S < 0.003
    assert np.all(bric[slow] < 0.2 * bam[slow])
    assert np.all(alpha[short] < 0.5 * bam[short])


@pytest.mark.campaign
def test_the_figure_can_be_drawn(tmp_path):
    draw(str(tmp_path / "figure8.png"))
    assert (tmp_path / "figure8.png").stat().st_size > 10_000
