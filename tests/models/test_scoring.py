"""Scores: one impact and batches of them, missing signals, probabilities, incidence."""

from __future__ import annotations

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from waveforms import burst, impact, recording

from headimpact.criteria import CRITERIA, CRITERION_KEYS
from headimpact.criteria.extra import EXTRA_CRITERIA
from headimpact.kinematics import HeadKinematics
from headimpact.preparation import BLOCK, Preparation, prepare
from headimpact.recording import Recording, Signal
from headimpact.risk import LAKSARI_2020, RiskModel
from headimpact.scoring import CONVENTIONS, score, score_many

SIGNALS = ("linear_acceleration_g", "angular_velocity", "angular_acceleration")


def prepared(kinematics: HeadKinematics, pre_trigger_known: bool = False) -> Preparation:
    return Preparation.of(kinematics, pre_trigger_known=pre_trigger_known)


def made_up(seed: int, samples: int, rate_hz: float, missing: tuple[str, ...] = ()) -> Preparation:
    kinematics = replace(impact(seed, samples, rate_hz), start_time_ms=-float(seed % 50))
    return prepared(replace(kinematics, **dict.fromkeys(missing)), pre_trigger_known=bool(seed % 2))


impacts = st.builds(
    made_up,
    st.integers(0, 10_000),
    st.sampled_from([3, 5, 80, 100, 160]),
    st.sampled_from([500.0, 1000.0, 3200.0]),
    st.sampled_from([(), SIGNALS[:1], SIGNALS[1:], SIGNALS[:2], SIGNALS[1:2]]),
)


@given(st.lists(impacts, max_size=25))
@settings(deadline=None, max_examples=25)
def test_a_batch_of_mixed_impacts_equals_each_of_them_bit_for_bit(batch):
    together = score_many(batch, incidence=0.01, extra_criteria=("damage", "hic_d"))
    alone = [score(one, incidence=0.01, extra_criteria=("damage", "hic_d")) for one in batch]
    assert together == alone


@pytest.mark.parametrize(("samples", "rate_hz"), [(100, 1000.0), (160, 3200.0), (400, 10_000.0), (1500, 10_000.0)])
def test_a_batch_longer_than_a_block_equals_each_of_them_bit_for_bit(samples, rate_hz):
    count = BLOCK + 3 if samples <= 160 else 5
    batch = [made_up(seed, samples, rate_hz) for seed in range(count)]
    for found, one in zip(score_many(batch), batch, strict=True):
        assert found == score(one)


def test_a_batch_of_prepared_recordings_equals_each_of_them_bit_for_bit():
    batch = [prepare(recording(seed)) for seed in range(20)] + [
        prepare(recording(1, pre_trigger_ms=10.0, axes="sae_j211"))
    ]
    assert score_many(batch) == [score(one) for one in batch]


def test_an_empty_batch_has_no_scores():
    assert score_many([]) == []


@pytest.mark.parametrize("missing", [SIGNALS[:1], SIGNALS[1:], SIGNALS[1:2]])
def test_a_criterion_whose_signal_was_not_recorded_is_null_with_the_reason(missing):
    found = score(made_up(2, 100, 1000.0, missing))
    lacking = {name.removesuffix("_g") for name in missing}
    for criterion in CRITERIA:
        one = found.criteria[criterion.key]
        absent = lacking & set(criterion.needs)
        assert (one.value is None) == bool(absent)
        assert (one.probability is None) == bool(absent)
        assert (one.linear_predictor is None) == bool(absent)
        if absent:
            assert one.window_ms is None
            for name in absent:
                assert name.replace("_", " ") in one.reason
        else:
            assert one.reason is None
    assert (found.brain_angle is None) == ("angular_acceleration" in lacking)
    peaks = (
        found.peaks.linear_acceleration_g,
        found.peaks.angular_velocity_rad_s,
        found.peaks.angular_acceleration_rad_s2,
    )
    assert [peak is None for peak in peaks] == [name in missing for name in SIGNALS]


def test_the_thirteen_come_in_the_order_of_the_registry_with_their_components_and_units():
    found = score(made_up(2, 100, 1000.0)).criteria
    assert tuple(found) == CRITERION_KEYS
    for criterion in CRITERIA:
        one = found[criterion.key]
        assert one.unit == criterion.unit
        assert (len(one.value) if isinstance(one.value, tuple) else 1) == criterion.components


def test_scores_hold_plain_numbers_not_arrays():
    found = score(made_up(2, 100, 1000.0), extra_criteria=tuple(EXTRA_CRITERIA))
    for one in [*found.criteria.values(), *found.extra_criteria.values()]:
        parts = one.value if isinstance(one.value, tuple) else (one.value,)
        assert all(type(part) is float for part in parts)
        assert one.probability is None or type(one.probability) is float
        assert one.window_ms is None or all(type(t) is float for t in one.window_ms)
    assert all(type(t) is float for t in found.brain_angle.time_of_peak_ms)


def test_peaks_are_resultants():
    kinematics = impact(4)
    found = score(prepared(kinematics)).peaks
    expected = [np.linalg.norm(getattr(kinematics, name), axis=1).max() for name in SIGNALS]
    assert [
        found.linear_acceleration_g,
        found.angular_velocity_rad_s,
        found.angular_acceleration_rad_s2,
    ] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("incidence", [None, 0.0055, 1e-5, 0.001, 0.0295, 0.5])
def test_probabilities_equal_a_40_digit_solution(incidence):
    found = score(made_up(6, 100, 1000.0), incidence=incidence)
    with mpmath.workdps(40):
        for key, one in found.criteria.items():
            curve = LAKSARI_2020.curves[key]
            x = one.value if isinstance(one.value, tuple) else (one.value,)
            e = mpmath.mpf(curve.b0) + mpmath.fsum(
                mpmath.mpf(b) * mpmath.mpf(v) for b, v in zip(curve.b, x, strict=True)
            )
            tau, own = mpmath.mpf(incidence or 0.0055), mpmath.mpf(0.0055)
            e += mpmath.log((1 - tau) / tau) - mpmath.log((1 - own) / own)
            assert one.probability == pytest.approx(float(1 / (1 + mpmath.exp(e))), rel=1e-12)
            assert one.linear_predictor == pytest.approx(float(e), rel=1e-12, abs=1e-12)


def test_another_incidence_moves_every_probability_and_no_value():
    one = made_up(6, 100, 1000.0)
    low, own, high = (score(one, incidence=i) for i in (0.001, None, 0.02))
    assert (low.incidence, own.incidence, high.incidence) == (0.001, 0.0055, 0.02)
    for key in CRITERION_KEYS:
        assert low.criteria[key].probability < own.criteria[key].probability < high.criteria[key].probability
        assert low.criteria[key].value == own.criteria[key].value == high.criteria[key].value


def test_a_head_at_rest_has_the_risk_of_each_curves_intercept():
    still = np.zeros((100, 3))
    found = score(prepared(HeadKinematics(1000.0, still, still, still)))
    for key, curve in LAKSARI_2020.curves.items():
        rest = curve.b0 + (curve.b[0] / (1 + np.exp(10.2)) if key == "vtcp" else 0.0)
        assert found.criteria[key].linear_predictor == pytest.approx(rest, rel=1e-12)
        assert found.criteria[key].probability < 0.005
    assert found.criteria["hic15"].window_ms is None
    assert found.criteria["ric"].window_ms is None


@given(st.integers(0, 10_000), st.floats(1.01, 3.0))
@settings(deadline=None, max_examples=30)
def test_a_harder_impact_has_a_higher_risk_by_every_criterion_of_one_component(seed, factor):
    mild = impact(seed)
    hard = HeadKinematics(1000.0, *(getattr(mild, name) * factor for name in SIGNALS))
    low, high = score(prepared(mild)).criteria, score(prepared(hard)).criteria
    for criterion in CRITERIA:
        if criterion.components == 1 and criterion.key != "vtcp":
            assert_riskier(high[criterion.key], low[criterion.key])
    assert_riskier(high["bam"], low["bam"])  # all three of its coefficients are negative


def assert_riskier(high, low):
    # The paper's p = 1 / (1 + exp(e)) falls with e; beyond e = -37 it is 1 to the last bit.
    assert high.linear_predictor < low.linear_predictor
    assert high.probability > low.probability or high.probability == low.probability == 1.0


def test_motions_far_beyond_any_head_have_probabilities_not_overflows():
    huge = HeadKinematics(1000.0, *(getattr(impact(1), name) * 50 for name in SIGNALS))
    for one in score(prepared(huge)).criteria.values():
        assert 0.0 <= one.probability <= 1.0


def test_a_model_without_a_curve_gives_the_value_and_the_reason():
    partial = RiskModel("partial", "", "", "", 0.0055, {"bam": LAKSARI_2020.curves["bam"]})
    found = score(made_up(2, 100, 1000.0), partial)
    assert found.model == "partial"
    assert found.criteria["bam"].probability == score(made_up(2, 100, 1000.0)).criteria["bam"].probability
    hic = found.criteria["hic15"]
    assert (hic.value > 0, hic.probability, hic.linear_predictor) == (True, None, None)
    assert hic.window_ms is not None
    assert "partial" in hic.reason


def test_conventions_name_what_implementations_differ_in():
    found = score(made_up(2, 100, 1000.0)).conventions
    assert found == CONVENTIONS
    assert found["hic_window"] == "inclusive"
    assert found["maxima"] == "at_samples"


def test_filters_and_sources_travel_with_the_score():
    generator = np.random.default_rng(1)
    one = prepare(
        Recording(Signal(burst(generator, 100, 20.0), "g", 1e3), Signal(burst(generator, 100, 6.0), "rad/s", 1e3))
    )
    found = score(one)
    assert found.filters == one.filters
    assert found.angular_velocity_source == "supplied"
    assert found.angular_acceleration_source == "five_point_stencil"
