"""The criteria beyond the paper's thirteen, against differential-equation solvers and their sources' formulas."""

from __future__ import annotations

from math import exp, log, sqrt

import numpy as np
import pytest
from damage_ode import damage_by_ode
from waveforms import impact, rotational, values_of

from headimpact.criteria.extra import EXTRA_CRITERIA
from headimpact.errors import UnknownCriterion
from headimpact.kinematics import HeadKinematics
from headimpact.preparation import Preparation
from headimpact.scoring import score


def value(name: str, kinematics: HeadKinematics) -> float:
    return EXTRA_CRITERIA[name].evaluate(kinematics).value


def prepared(kinematics: HeadKinematics) -> Preparation:
    return Preparation.of(kinematics)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_damage_equals_an_ode_solution_at_the_samples(seed):
    kinematics = impact(seed)
    sampled, crest = damage_by_ode(kinematics)
    found = value("damage", kinematics)
    assert found == pytest.approx(sampled, rel=1e-8)
    # read at the samples, the crest between them is missed by little, and never exceeded
    assert found <= crest * (1 + 1e-9)
    assert found == pytest.approx(crest, rel=0.005)


def test_damage_depends_on_the_relative_sign_of_x_and_z_only():
    # K couples x and z; in the anatomical frame no sign of alpha is changed
    kinematics = impact(1)
    alpha = kinematics.angular_acceleration

    def of(*signs: float) -> float:
        return value("damage", rotational(alpha * np.array(signs), 1000.0))

    assert of(-1, -1, -1) == pytest.approx(of(1, 1, 1), rel=1e-12)
    assert of(1, -1, 1) == pytest.approx(of(1, 1, 1), rel=1e-12)
    assert of(-1, 1, -1) == pytest.approx(of(1, 1, 1), rel=1e-12)
    assert of(1, 1, -1) != pytest.approx(of(1, 1, 1), rel=1e-3)


@pytest.mark.parametrize(("name", "a", "b"), [("ais1", 4.078, 0.394), ("ais2", 3.875, 0.459), ("ais4", 6.051, 0.646)])
def test_damage_carries_the_risks_of_its_source(name, a, b):
    # P(AIS k+) = 1 - exp(-exp(a (ln(0.957 D + 0.017) - ln b)))
    found = EXTRA_CRITERIA["damage"].evaluate(impact(2))
    expected = 1 - exp(-exp(a * (log(0.957 * found.value + 0.017) - log(b))))
    assert found.risks[name] == pytest.approx(expected, rel=1e-12)


def ubric(w: list[float], a: list[float]) -> float:
    kinematics = HeadKinematics(1000.0, None, np.array([[0.0] * 3, w, [0.0] * 3]), np.array([[0.0] * 3, a, [0.0] * 3]))
    return value("ubric_mps", kinematics)


def test_ubric_follows_its_formula():
    # Gabler et al. 2018, r = 2, strain criticals
    w, a = [20.0, 30.0, 10.0], [3000.0, 2000.0, 900.0]
    ratios = zip(w, (211.0, 171.0, 115.0), a, (20000.0, 10300.0, 7760.0), strict=True)
    terms = [(x / xc, y / yc) for x, xc, y, yc in ratios]
    expected = sqrt(sum((u + (v - u) * exp(-v / u)) ** 2 for u, v in terms))
    assert ubric(w, a) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("w", [1e-3, 1e-6, 1e-12, 1e-300])
def test_ubric_without_velocity_is_its_formulas_limit_and_that_is_zero(w):
    # a/w grows without bound, exp(-a/w) vanishes and the velocity is left: 0, and never NaN
    assert ubric([w, 0, 0], [5000.0, 0, 0]) == pytest.approx(w / 211.0, rel=1e-9, abs=1e-300)
    assert ubric([0, 0, 0], [5000.0, 0, 0]) == 0.0


def test_ubric_of_a_slow_motion_is_twice_its_acceleration_term():
    # the other limit, a/w to 0: w + (a - w)(1 - a/w) = 2 a - a^2/w
    assert ubric([50.0, 0, 0], [0.1, 0, 0]) == pytest.approx(2 * 0.1 / 20000.0, rel=1e-4)


def test_ubric_without_any_motion_is_zero():
    assert ubric([0, 0, 0], [0, 0, 0]) == 0.0


def test_the_two_readings_of_ubrics_velocity_are_two_criteria():
    # sources disagree: largest absolute value or peak to peak
    w = np.array([[0.0] * 3, [10.0, 0, 0], [-10.0, 0, 0], [0.0] * 3])
    kinematics = HeadKinematics(1000.0, None, w, np.ones((4, 3)))
    doubled = HeadKinematics(1000.0, None, np.abs(2 * w), np.ones((4, 3)))
    assert value("ubric_mps_peak_to_peak", kinematics) == value("ubric_mps", doubled)


@pytest.mark.parametrize(
    ("name", "critical"), [("bric_mps", (66.30, 53.80, 41.50)), ("bric_average", (66.25, 56.45, 42.87))]
)
def test_brics_other_critical_sets_are_those_of_takhounts_2013(name, critical):
    kinematics = impact(3)
    expected = sqrt(sum((np.abs(kinematics.angular_velocity[:, i]).max() / critical[i]) ** 2 for i in range(3)))
    assert value(name, kinematics) == pytest.approx(expected, rel=1e-14)


def test_harm_and_hic_d_follow_their_formulas():
    # Bailey et al. 2020; 49 CFR 571.201
    kinematics = impact(5)
    found = values_of(kinematics)
    assert value("harm", kinematics) == pytest.approx(
        0.0148 * float(found["hic15"]) + 15.6 * value("damage", kinematics), rel=1e-14
    )
    assert value("hic_d", kinematics) == pytest.approx(0.75446 * float(found["hic36"]) + 166.4, rel=1e-14)


@pytest.mark.parametrize(
    ("name", "signal", "intercept", "slope"),
    [
        ("rwe_linear_collegiate", "linear_acceleration_g", -9.805, 0.0510),
        ("rwe_linear_nfl", "linear_acceleration_g", -4.897, 0.0606),
        ("rwe_rotational", "angular_acceleration", -12.531, 0.0020),
    ],
)
def test_risk_weights_follow_their_curves_of_the_peak_resultant(name, signal, intercept, slope):
    kinematics = impact(6)
    peak = float(np.linalg.norm(getattr(kinematics, signal), axis=1).max())
    assert value(name, kinematics) == pytest.approx(1 / (1 + exp(-(intercept + slope * peak))), rel=1e-12)


def test_the_combined_risk_weight_is_vtcp():
    kinematics = impact(6)
    assert value("rwe_combined", kinematics) == float(values_of(kinematics)["vtcp"])


def test_extra_criteria_are_scored_by_name_only_and_stay_out_of_the_thirteen():
    plain = score(prepared(impact(1)))
    asked = score(prepared(impact(1)), extra_criteria=("damage", "harm"))
    assert dict(plain.extra_criteria) == {}
    assert list(asked.extra_criteria) == ["damage", "harm"]
    assert asked.criteria == plain.criteria
    assert asked.extra_criteria["damage"].probability is None


def test_every_extra_criterion_gives_a_number_or_the_reason_why_not():
    whole = score(prepared(impact(1)), extra_criteria=tuple(EXTRA_CRITERIA)).extra_criteria
    assert all(isinstance(found.value, float) and found.reason is None for found in whole.values())
    only_rotation = rotational(impact(1).angular_acceleration, 1000.0)
    partial = score(prepared(only_rotation), extra_criteria=tuple(EXTRA_CRITERIA)).extra_criteria
    for name, found in partial.items():
        can = EXTRA_CRITERIA[name].needs == ("angular_acceleration",)
        assert (found.value is not None) == can
        assert (found.reason is None) == can


def test_an_unknown_extra_criterion_is_refused_with_those_that_exist():
    with pytest.raises(UnknownCriterion, match="damage") as raised:
        score(prepared(impact(1)), extra_criteria=("hitsp",))
    assert "hitsp" not in str(raised.value)


@pytest.mark.parametrize("name", ["klc", "rvci", "cibic", "prhic", "hitsp"])
def test_criteria_without_a_source_for_their_constants_are_not_shipped(name):
    assert not any(name in key for key in EXTRA_CRITERIA)
