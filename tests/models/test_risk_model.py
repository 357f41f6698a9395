"""The published risk model: Table 3, Figure 7's intercepts and planes, operating points, incidence."""

from __future__ import annotations

from dataclasses import replace
from math import exp, log

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from waveforms import impact

from headimpact.criteria import BY_KEY, CRITERION_KEYS
from headimpact.errors import OperatingPointUnreachable, UnknownModel
from headimpact.preparation import Preparation
from headimpact.risk import (
    DEFAULT_OPERATING_POINTS,
    LAKSARI_2020,
    OperatingPointRequest,
    critical_values,
    linear_predictor_of,
    load_model,
    probability_of,
    resolve_operating_point,
)
from headimpact.scoring import score

# Laksari et al. 2020, Table 3: b0, then each coefficient; True where the table has an asterisk (p < 0.05).
TABLE_3 = {
    "peak_angular_acceleration": (8.446, (-1.63e-4, 5.17e-5, -0.0014), (False, False, True)),
    "delta_angular_velocity": (10.69, (-0.145, -0.0046, -0.172), (True, False, True)),
    "bric": (10.57, (-11.10,), (True,)),
    "ric": (5.559, (-4.3e-8,), (True,)),
    "peak_linear_acceleration": (9.041, (-0.071, -0.071, -0.031), (True, True, False)),
    "hic15": (6.071, (-0.0072,), (True,)),
    "hic36": (5.928, (-0.0056,), (True,)),
    "si": (5.673, (-0.0024,), (True,)),
    "hip": (5.549, (-4.11e-5,), (True,)),
    "hip3d": (5.882, (-1.43e-5, -2.26e-4, 1.50e-4), (False, True, False)),
    "gambit": (7.501, (-9.599,), (True,)),
    "vtcp": (5.910, (-5.126,), (True,)),
    "bam": (9.845, (-28.84, -10.23, -37.95), (True, False, True)),
}
# Results and Figure 7: where BAM's classifier planes cut the axes, coronal, sagittal, axial [rad].
INTERCEPTS = {
    "50 % risk": (0.34, 0.96, 0.26),
    "50 % sensitivity": (0.29, 0.83, 0.22),
    "90 % sensitivity": (0.17, 0.49, 0.13),
}
INJURIES, NON_INJURIES = 27, 887


def intercepts(probability: float) -> list[float]:
    return [found.value for found in critical_values(LAKSARI_2020, "bam", probability)]


def test_the_shipped_model_is_table_3_to_the_last_printed_digit():
    model = load_model("laksari-2020")
    found = {key: (curve.b0, curve.b, curve.significant) for key, curve in model.curves.items()}
    assert found == TABLE_3
    assert tuple(found) == CRITERION_KEYS
    assert all(len(curve.b) == BY_KEY[key].components for key, curve in model.curves.items())


def test_the_shipped_model_states_its_cohort_and_its_incidence():
    # 5.5 concussions per 1000 impacts; 914 recordings, 27 concussions; adult men
    assert LAKSARI_2020.incidence == 0.0055
    assert "adult men" in LAKSARI_2020.population
    assert "Table 3" in LAKSARI_2020.source


def test_the_prior_correction_of_the_papers_cohort_is_1_7055():
    # King & Zeng 2001: ln[((1 - tau)/tau)(ybar/(1 - ybar))], tau = 0.0055, ybar = 27/914
    from_sample = LAKSARI_2020.incidence_shift(INJURIES / 914)
    assert -from_sample == pytest.approx(log((1 - 0.0055) / 0.0055 * INJURIES / NON_INJURIES), rel=1e-12)
    assert -from_sample == pytest.approx(1.7055, abs=5e-5)


def test_a_model_that_does_not_exist_is_refused():
    with pytest.raises(UnknownModel, match="laksari-2019"):
        load_model("laksari-2019")


def test_the_50_percent_risk_plane_cuts_the_axes_where_figure_7_prints_it():
    # misprint 1: with Table 3's signs and p = 1/(1 + exp(b0 + b.x)); 9.845/28.84 = 0.341
    assert [round(value, 2) for value in intercepts(0.5)] == list(INTERCEPTS["50 % risk"])


@pytest.mark.parametrize(("sensitivity", "plane"), [(0.5, "50 % sensitivity"), (0.9, "90 % sensitivity")])
def test_the_sensitivity_planes_cut_the_axes_where_the_paper_prints_them(sensitivity, plane):
    point = resolve_operating_point(OperatingPointRequest("bam", sensitivity=sensitivity), LAKSARI_2020)
    assert [round(value, 2) for value in intercepts(point.threshold)] == list(INTERCEPTS[plane])
    for threshold in point.threshold_interval:
        # its ends are where one of the intercepts would start to print differently
        np.testing.assert_allclose(intercepts(threshold), INTERCEPTS[plane], rtol=0, atol=0.00502)


@pytest.mark.parametrize(
    ("plane", "low", "high", "middle"),
    [("50 % sensitivity", 1.337, 1.405, 1.371), ("90 % sensitivity", 4.798, 4.883, 4.841)],
)
def test_the_intervals_of_the_linear_predictor_follow_from_the_rounded_intercepts(plane, low, high, middle):
    # each intercept x, printed to 0.01, bounds e = b0 + b (x -+ 0.005); all three together leave [low, high]
    b0, b, _ = TABLE_3["bam"]
    lowest = max(b0 + bi * (x + 0.005) for bi, x in zip(b, INTERCEPTS[plane], strict=True))
    highest = min(b0 + bi * (x - 0.005) for bi, x in zip(b, INTERCEPTS[plane], strict=True))
    assert lowest == pytest.approx(low, abs=6e-4)
    assert highest == pytest.approx(high, abs=6e-4)
    shipped = {point.printed[:16]: point for point in LAKSARI_2020.operating_points["bam"]}[plane]
    assert shipped.linear_predictor_interval == (low, high)
    assert shipped.linear_predictor == middle
    assert middle == pytest.approx((low + high) / 2, abs=6e-4)
    assert shipped.axis_intercepts == INTERCEPTS[plane]


@pytest.mark.parametrize(
    ("sensitivity", "p", "interval"), [(0.5, 0.2025, (0.197, 0.208)), (0.9, 0.00784, (0.0075, 0.0082))]
)
def test_thresholds_of_the_sensitivity_planes_are_those_of_the_notes(sensitivity, p, interval):
    point = resolve_operating_point(OperatingPointRequest("bam", sensitivity=sensitivity), LAKSARI_2020)
    assert point.basis == "published"
    assert point.threshold == pytest.approx(p, rel=1e-3)
    assert point.threshold_interval == pytest.approx(interval, rel=0.007)
    assert point.threshold_interval[0] < point.threshold < point.threshold_interval[1]


def test_the_50_percent_planes_counts_are_the_only_ones_with_its_printed_figures():
    # sensitivity 29.6 %, specificity 99.9 %, accuracy 97.8 %, precision 88.9 % of 27 injuries and 887 others
    found = [
        (tp, fp)
        for tp in range(INJURIES + 1)
        for fp in range(NON_INJURIES + 1)
        if tp + fp
        and round(100 * tp / INJURIES, 1) == 29.6
        and round(100 * (NON_INJURIES - fp) / NON_INJURIES, 1) == 99.9
        and round(100 * (tp + NON_INJURIES - fp) / 914, 1) == 97.8
        and round(100 * tp / (tp + fp), 1) == 88.9
    ]
    assert found == [(8, 1)]  # so FN 19, TN 886
    point = LAKSARI_2020.operating_points["bam"][0]
    assert (point.sensitivity, point.specificity) == (8 / 27, 886 / 887)
    assert point.linear_predictor == 0.0


def test_the_50_percent_planes_precision_falls_from_89_to_59_percent_at_the_incidence_of_sport():
    # misprint 11: "not affected by the imbalanced sample proportions": it is
    point = LAKSARI_2020.operating_points["bam"][0]

    def precision(prevalence: float) -> float:
        hits, alarms = point.sensitivity * prevalence, (1 - point.specificity) * (1 - prevalence)
        return hits / (hits + alarms)

    assert precision(INJURIES / 914) == pytest.approx(8 / 9)
    assert round(precision(0.0055), 2) == 0.59


def test_the_false_positive_rate_is_one_minus_specificity_not_one_minus_precision():
    # misprint 4: 1 of 887 non-injuries is called an injury, 1 of 9 calls is wrong
    point = LAKSARI_2020.operating_points["bam"][0]
    assert 1 - point.specificity == pytest.approx(1 / NON_INJURIES)
    assert 90 * (1 - point.specificity) < 1 - 8 / 9


def test_with_the_signs_that_the_methods_print_a_head_at_rest_would_be_injured_for_certain():
    # misprint 1
    b0 = TABLE_3["bam"][0]
    assert 1 / (1 + exp(-b0)) > 0.9999
    assert probability_of(b0) < 1e-4


def test_the_coefficients_of_bam_are_table_3s_not_the_texts():
    # misprint 5: the text has -28.86, -10.23, -37.94; both print the same intercepts
    assert LAKSARI_2020.curves["bam"].b == (-28.84, -10.23, -37.95)
    text = replace(LAKSARI_2020.curves["bam"], b=(-28.86, -10.23, -37.94))
    other = replace(LAKSARI_2020, curves={"bam": text})
    assert [round(found.value, 2) for found in critical_values(other, "bam")] == list(INTERCEPTS["50 % risk"])


def test_vtcps_risk_is_at_most_31_percent_and_its_50_percent_value_is_null_with_the_reason():
    # misprint 10
    curve = LAKSARI_2020.curves["vtcp"]
    assert probability_of(curve.b0 + curve.b[0] * 1.0) == pytest.approx(0.31, abs=0.005)
    (found,) = critical_values(LAKSARI_2020, "vtcp")
    assert found.value is None
    assert "at most 1" in found.reason
    assert "0.31" in found.reason
    (reached,) = critical_values(LAKSARI_2020, "vtcp", 0.2)
    assert 0 < reached.value < 1


@pytest.mark.parametrize(("key", "axis"), [("peak_angular_acceleration", "y"), ("hip3d", "z")])
def test_where_risk_falls_with_a_component_its_critical_value_is_null_never_negative(key, axis):
    # misprint 10: sagittal alpha, axial HIP
    for found in critical_values(LAKSARI_2020, key):
        if found.axis == axis:
            assert found.value is None
            assert "does not rise" in found.reason
        else:
            assert found.value > 0
            assert found.reason is None


@pytest.mark.parametrize("key", CRITERION_KEYS)
@pytest.mark.parametrize("probability", [0.01, 0.2, 0.5, 0.9])
def test_a_critical_value_alone_gives_the_probability_it_was_asked_for(key, probability):
    curve = LAKSARI_2020.curves[key]
    for found, b in zip(critical_values(LAKSARI_2020, key, probability), curve.b, strict=True):
        if found.value is not None:
            assert probability_of(curve.b0 + b * found.value) == pytest.approx(probability, rel=1e-9)


def test_a_probability_below_the_risk_at_rest_has_no_critical_value():
    (found,) = critical_values(LAKSARI_2020, "hic15", 0.001)
    assert found.value is None
    assert "without any motion" in found.reason


@pytest.mark.parametrize("key", CRITERION_KEYS)
def test_risk_rises_with_a_component_exactly_where_its_coefficient_is_negative(key):
    # p = 1/(1 + exp(b0 + b.x))
    curve = LAKSARI_2020.curves[key]
    rising = {("peak_angular_acceleration", 1), ("hip3d", 2)}
    for i, b in enumerate(curve.b):
        low, high = (probability_of(curve.b0 + b * x / abs(b)) for x in (0.0, 1.0))
        assert (high > low) == ((key, i) not in rising)


@given(st.floats(-700, 700))
@settings(deadline=None)
def test_probability_and_linear_predictor_are_each_others_inverse_and_never_overflow(e):
    p = probability_of(e)
    assert 0.0 <= p <= 1.0
    if abs(e) < 12:
        assert linear_predictor_of(p) == pytest.approx(e, rel=1e-6, abs=1e-9)


@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
@settings(deadline=None)
def test_probability_never_rises_with_the_linear_predictor(a, b):
    assert (probability_of(min(a, b)) >= probability_of(max(a, b))) is True


@pytest.mark.parametrize("key", CRITERION_KEYS)
@pytest.mark.parametrize("incidence", [0.0001, 0.0055, 0.02, 0.3])
def test_the_incidence_shift_is_king_and_zengs_prior_correction_for_every_curve(key, incidence):
    # in the usual sign b0 <- b0 - ln[((1 - tau)/tau)(y/(1 - y))]; Table 3's signs are opposite
    shift = LAKSARI_2020.incidence_shift(incidence)
    odds = (1 - 0.0055) / 0.0055 / ((1 - incidence) / incidence)
    assert shift == pytest.approx(-log(odds), abs=1e-12)
    b0 = LAKSARI_2020.curves[key].b0
    before, after = exp(-b0), exp(-(b0 + shift))  # odds at rest
    assert after / before == pytest.approx(incidence / (1 - incidence) / (0.0055 / (1 - 0.0055)), rel=1e-12)


@pytest.mark.parametrize("incidence", [0.0005, 0.0055, 0.05])
@pytest.mark.parametrize("sensitivity", [0.5, 0.7, 0.9])
def test_thresholds_shift_with_the_probabilities_so_that_who_exceeds_one_does_not_change(sensitivity, incidence):
    request = OperatingPointRequest("bam", sensitivity=sensitivity)
    here = resolve_operating_point(request, LAKSARI_2020, incidence)
    own = resolve_operating_point(request, LAKSARI_2020)
    for seed in range(30):
        one = Preparation.of(impact(seed))
        shifted = score(one, incidence=incidence).criteria["bam"].probability
        plain = score(one).criteria["bam"].probability
        assert (shifted >= here.threshold) == (plain >= own.threshold)
    assert linear_predictor_of(here.threshold) - linear_predictor_of(own.threshold) == pytest.approx(
        LAKSARI_2020.incidence_shift(incidence), abs=1e-9
    )
    assert here.threshold_interval[0] < here.threshold < here.threshold_interval[1]


@pytest.mark.parametrize(("sensitivity", "share"), [(0.6, 0.25), (0.7, 0.5), (0.88, 0.95)])
def test_between_published_points_the_linear_predictor_is_interpolated_and_said_so(sensitivity, share):
    point = resolve_operating_point(OperatingPointRequest("bam", sensitivity=sensitivity), LAKSARI_2020)
    assert point.basis == "interpolated"
    assert linear_predictor_of(point.threshold) == pytest.approx(1.371 + share * (4.841 - 1.371), rel=1e-9)
    ends = [linear_predictor_of(p) for p in point.threshold_interval]
    assert ends == pytest.approx([1.405 + share * (4.883 - 1.405), 1.337 + share * (4.798 - 1.337)], rel=1e-9)
    assert (point.sensitivity, point.specificity) == (sensitivity, None)


def test_between_the_50_percent_risk_plane_and_50_percent_sensitivity_is_interpolated_too():
    point = resolve_operating_point(OperatingPointRequest("bam", sensitivity=0.4), LAKSARI_2020)
    share = (0.4 - 8 / 27) / (0.5 - 8 / 27)
    assert point.basis == "interpolated"
    assert linear_predictor_of(point.threshold) == pytest.approx(share * 1.371, rel=1e-9)


@given(st.floats(0.2963, 0.9), st.floats(0.2963, 0.9))
@settings(deadline=None)
def test_a_higher_sensitivity_never_has_a_higher_threshold(one, other):
    low, high = (
        resolve_operating_point(OperatingPointRequest("bam", sensitivity=s), LAKSARI_2020).threshold
        for s in sorted((one, other))
    )
    assert high <= low


@pytest.mark.parametrize("sensitivity", [0.296, 8 / 27])
def test_the_50_percent_risk_plane_is_found_by_its_printed_sensitivity(sensitivity):
    point = resolve_operating_point(OperatingPointRequest("bam", sensitivity=sensitivity), LAKSARI_2020)
    assert (point.threshold, point.basis) == (0.5, "published")
    assert point.threshold_interval == (0.5, 0.5)


@pytest.mark.parametrize("specificity", [0.999, 886 / 887])
def test_the_50_percent_risk_plane_is_found_by_its_specificity(specificity):
    point = resolve_operating_point(OperatingPointRequest("bam", specificity=specificity), LAKSARI_2020)
    assert (point.threshold, point.basis) == (0.5, "published")
    assert point.sensitivity == 8 / 27


@pytest.mark.parametrize(
    "request_",
    [
        OperatingPointRequest("bam", sensitivity=0.95),
        OperatingPointRequest("bam", sensitivity=0.2),
        OperatingPointRequest("bam", specificity=0.95),
        OperatingPointRequest("hic15", sensitivity=0.5),
        OperatingPointRequest("vtcp", specificity=0.999),
    ],
    ids=["too sensitive", "too little", "specificity", "no points", "no points, specificity"],
)
def test_points_that_no_source_gives_are_refused_never_extrapolated(request_):
    with pytest.raises(OperatingPointUnreachable) as raised:
        resolve_operating_point(request_, LAKSARI_2020)
    assert request_.criterion in str(raised.value)


@pytest.mark.parametrize("incidence", [None, 0.02])
def test_a_threshold_that_is_asked_for_is_kept_as_it_is(incidence):
    request = OperatingPointRequest("hic15", threshold=0.1)
    point = resolve_operating_point(request, LAKSARI_2020, incidence)
    assert (point.threshold, point.basis) == (0.1, "requested")
    assert (point.sensitivity, point.specificity, point.threshold_interval) == (None, None, None)


def test_the_points_shown_unless_others_are_asked_for_are_published_ones():
    for request in DEFAULT_OPERATING_POINTS:
        assert resolve_operating_point(request, LAKSARI_2020).basis == "published"
        assert len(request.requested) == 1


def test_the_models_arrays_are_its_curves_in_the_order_of_the_criteria():
    b0, b = LAKSARI_2020.coefficients
    for row, key in enumerate(CRITERION_KEYS):
        curve = LAKSARI_2020.curves[key]
        assert b0[row] == curve.b0
        np.testing.assert_array_equal(b[row], np.pad(curve.b, (0, 3 - len(curve.b))))
