"""What refits must hold on data that no reference knows: laws, properties, and a clear answer to what allows no fit."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import statsmodels.api as sm
from scipy.special import expit

from headimpact.calibration import RefitOptions, fitted_model, make_cohort, refit, report_document
from headimpact.calibration.agreement import agreement, recalibration, shift, slopes_on
from headimpact.calibration.cohort import Cohort
from headimpact.calibration.discrimination import auc, curve, delong_test, resampled
from headimpact.calibration.drift import group_shifts, risk_adjusted_cusum
from headimpact.calibration.firth import fit_firth
from headimpact.calibration.logistic import Sample, fit, fit_resamples
from headimpact.calibration.rare_events import prior_corrected, prior_offset
from headimpact.calibration.resampling import counts_of_rows
from headimpact.calibration.sample_size import events_for_expected_over_observed
from headimpact.calibration.separation import separation
from headimpact.calibration.strain import regress_strain
from headimpact.calibration.thresholds import clopper_pearson, confusion, order_statistic_interval, threshold_at
from headimpact.calibration.update import closed_test
from headimpact.calibration.validation import folds_by_athlete
from headimpact.errors import CalibrationError, ModelDocumentError
from headimpact.model_document import model_from_document, model_from_text, model_to_document
from headimpact.risk import LAKSARI_2020, OperatingPointRequest, RiskModel, resolve_operating_point

SEEDS = range(6)


def drawn(seed: int, n: int = 300, p: int = 3) -> Sample:
    """A sample of about one event in ten."""
    generator = np.random.default_rng(seed)
    x = generator.gamma(2.0, 1.0, (n, p))
    eta = -4.0 + x @ generator.uniform(0.2, 0.6, p)
    return Sample((generator.random(n) < expit(eta)).astype(float), x)


def with_outlier() -> Sample:
    """A predictor of small values but for one event's, which is a hundred standard deviations away."""
    generator = np.random.default_rng(3)
    x = generator.gamma(2.0, 0.001, 600)
    y = (generator.random(600) < expit(-4.5 + 1200.0 * x)).astype(float)
    x[0], y[0] = 1.0, 1.0
    return Sample(y, x[:, None])


def penalised(sample: Sample, coefficients: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    """Firth's penalised log-likelihood by its definition."""
    eta = sample.design @ coefficients
    p = expit(eta)
    sign, log_determinant = np.linalg.slogdet((sample.design.T * (p * (1 - p))) @ sample.design)
    return float((sample.y * eta - np.logaddexp(0, eta)).sum() + 0.5 * log_determinant) if sign > 0 else -np.inf


def cohort_of(seed: int = 1, n: int = 400) -> Cohort:
    """A cohort with two criteria and forty athletes."""
    generator = np.random.default_rng(seed)
    bam = generator.gamma(1.5, 0.04, (n, 3))
    bric = bam.sum(axis=1, keepdims=True) * generator.lognormal(0, 0.3, (n, 1))
    outcome = (generator.random(n) < expit(-5 + bam @ np.array([18.0, 12.0, 20.0]))).astype(float)
    return make_cohort(outcome, [f"a{i % 40:02}" for i in range(n)], {"bam": bam, "bric": bric})


@pytest.mark.parametrize("method", [fit, fit_firth])
@pytest.mark.parametrize(("events", "p", "fits"), [(1, 1, False), (2, 1, True), (3, 3, False), (4, 3, True)])
def test_a_fit_needs_as_many_of_each_outcome_as_it_has_coefficients(method, events: int, p: int, fits: bool) -> None:
    generator = np.random.default_rng(7)
    x = generator.normal(size=(80, p))
    for few in (events, 80 - events):
        y = np.zeros(80)
        y[generator.permutation(80)[:few]] = 1.0
        if fits:
            method(Sample(y, x))
            continue
        with pytest.raises(CalibrationError, match=f"to fit {p + 1} coefficients") as raised:
            method(Sample(y, x))
        assert raised.value.code == "too-few-events"


@pytest.mark.parametrize(("share", "n"), [(0.93, 300), (0.5, 400), (0.005, 20_000)])
def test_the_interval_of_expected_over_observed_is_that_of_a_binomial_count(share: float, n: int) -> None:
    """Of equal probabilities: the count's standard deviation over its mean, on the scale of logarithms."""
    events = round(share * n)
    y = np.repeat([1.0, 0.0], [events, n - events])
    found = agreement(y, np.full(n, share))
    low, high = found.expected_over_observed_interval()
    deviation = np.sqrt(n * share * (1.0 - share)) / events
    assert found.expected_over_observed == pytest.approx(1.0, abs=1e-12)
    assert (low, high) == pytest.approx((np.exp(-1.959964 * deviation), np.exp(1.959964 * deviation)), rel=1e-6)


def test_a_recalibration_that_is_separated_is_none_and_no_error() -> None:
    """Scores so far apart that every probability rounds to 0 or 1: the information is singular."""
    y = np.repeat([0.0, 1.0], 30)
    for spread in (1.0, 10.0, 1e3, 1e6):
        eta = np.where(y > 0, spread, -spread) + np.linspace(-0.1, 0.1, 60)
        assert recalibration(y, eta) is None
        assert recalibration(y, eta, np.full(60, 0.3)) is None
        found = agreement(y, np.clip(expit(eta), 1e-300, 1 - 1e-16))
        assert (found.intercept, found.slope, found.covariance) == (None, None, None)


class TestFits:
    @pytest.mark.parametrize("seed", SEEDS)
    def test_statsmodels_finds_the_same(self, seed: int) -> None:
        sample = drawn(seed)
        ours = fit(sample)
        theirs = sm.Logit(sample.y, sample.design).fit(disp=0, tol=1e-12, maxiter=100)
        assert ours.coefficients == pytest.approx(theirs.params, rel=1e-8)
        assert ours.covariance == pytest.approx(theirs.cov_params(), rel=1e-7)

    @pytest.mark.parametrize("seed", SEEDS)
    def test_the_unit_of_a_predictor_changes_its_coefficient_and_nothing_else(self, seed: int) -> None:
        sample = drawn(seed)
        scale = np.array([1e7, 1e-5, 1.0])
        scaled = fit(Sample(sample.y, sample.x * scale))
        assert scaled.coefficients[1:] * scale == pytest.approx(fit(sample).coefficients[1:], rel=1e-9)
        assert scaled.deviance == pytest.approx(fit(sample).deviance, rel=1e-12)

    @pytest.mark.parametrize("seed", SEEDS)
    def test_expected_equals_observed_at_the_optimum(self, seed: int) -> None:
        sample = drawn(seed)
        residual = sample.y - fit(sample).probability
        assert sample.design.T @ residual == pytest.approx(np.zeros(4), abs=1e-8)

    def test_every_resample_is_fitted_as_it_would_be_alone(self) -> None:
        sample = drawn(3)
        rows = np.random.default_rng(0).integers(0, sample.n, (20, sample.n))
        together = fit_resamples(sample, counts_of_rows(rows, sample.n), None)
        for column, one in enumerate(rows):
            alone = fit(Sample(sample.y[one], sample.x[one]))
            assert together.coefficients[:, column] == pytest.approx(alone.coefficients, rel=1e-9)

    @pytest.mark.parametrize(
        ("y", "x", "kind"),
        [
            ([0, 0, 0, 1, 1, 1], [1, 2, 3, 4, 5, 6], "complete"),
            ([0, 0, 0, 1, 1, 1], [1, 2, 3, 3, 5, 6], "quasi-complete"),
            ([0, 0, 1, 0, 1, 1], [1, 2, 3, 4, 5, 6], None),
        ],
    )
    def test_separation_is_seen_before_any_fit(self, y: list[float], x: list[float], kind: str | None) -> None:
        assert separation(Sample(np.array(y, dtype=float), np.array(x, dtype=float)[:, None])) == kind

    @pytest.mark.parametrize("seed", [0, 9, 16, 19, 22, 26])
    def test_no_separated_resample_is_called_settled(self, seed: int) -> None:
        """Small samples with a strong predictor: some resamples are separated, completely or in part, some are not."""
        generator = np.random.default_rng(seed)
        x = generator.normal(size=(24, 1)).round(1)
        y = (x[:, 0] + 0.4 * generator.normal(size=24) > 0.5).astype(float)
        rows = generator.integers(0, 24, (200, 24))
        rows = rows[[0 < y[one].sum() < 24 for one in rows]]
        found = fit_resamples(Sample(y, x), counts_of_rows(rows, 24))
        overlaps = [separation(Sample(y[one], x[one])) is None for one in rows]
        assert found.converged.tolist() == overlaps
        assert 0 < sum(overlaps) < len(overlaps)

    def test_firth_of_one_group_adds_half_an_event_to_each_outcome(self) -> None:
        """With the intercept alone, Jeffreys' prior is one half event and one half other."""
        y = np.array([1.0, *[0.0] * 9])
        found = fit_firth(Sample(y, np.zeros((10, 0))))
        assert expit(found.coefficients[0]) == pytest.approx(1.5 / 11, rel=1e-9)

    def test_firth_climbs_the_higher_hill_where_an_outlier_makes_two(self) -> None:
        sample = with_outlier()
        found = fit_firth(sample)
        slopes = np.linspace(-50.0, 3.0 * found.coefficients[1], 400)
        intercepts = np.linspace(-8.0, 2.0, 101)
        highest = max(penalised(sample, np.array([a, b])) for a in intercepts for b in slopes)
        assert found.penalised_log_likelihood >= highest
        assert found.penalised_log_likelihood == pytest.approx(penalised(sample, found.coefficients), rel=1e-9)
        low, high, _ = found.profile(1)
        assert low < found.coefficients[1] < high

    def test_prior_correction_to_the_samples_own_share_changes_nothing(self) -> None:
        b = np.array([-3.0, 2.0])
        assert prior_corrected(b, 0.03, 0.03) == pytest.approx(b)
        assert prior_offset(0.5, 0.01) == pytest.approx(np.log(99))


class TestDiscrimination:
    @pytest.mark.parametrize("seed", SEEDS)
    def test_auc_is_the_share_of_pairs(self, seed: int) -> None:
        generator = np.random.default_rng(seed)
        y, score = (generator.random(80) < 0.3).astype(float), generator.integers(0, 12, 80).astype(float)
        events, others = score[y == 1][:, None], score[y == 0][None, :]
        pairs = ((events > others) + 0.5 * (events == others)).mean()
        assert auc(y, score).value == pytest.approx(pairs, abs=1e-14)
        assert resampled(y, score, np.ones((80, 1))).auc[0] == pytest.approx(pairs, abs=1e-14)

    @pytest.mark.parametrize("seed", SEEDS)
    def test_only_the_order_of_scores_counts_and_their_opposite_mirrors(self, seed: int) -> None:
        sample = drawn(seed)
        score = sample.x[:, 0]
        same = auc(sample.y, np.exp(score))
        assert same.value == auc(sample.y, score).value
        assert same.variance == pytest.approx(auc(sample.y, score).variance)
        assert auc(sample.y, -score).value == pytest.approx(1 - same.value, abs=1e-12)

    def test_a_score_compared_with_itself_does_not_differ(self) -> None:
        sample = drawn(1)
        one = auc(sample.y, sample.x[:, 0])
        test = delong_test(one, one)
        assert (test.difference, test.z, test.p) == (0.0, 0.0, 1.0)

    def test_average_precision_of_a_perfect_score_is_one_and_of_a_constant_the_share(self) -> None:
        y = np.array([0.0, 0, 0, 1, 1])
        assert curve(y, y).average_precision() == 1.0
        assert curve(y, np.zeros(5)).average_precision() == pytest.approx(0.4)

    def test_clusters_of_one_impact_give_delongs_variance_up_to_its_factor(self) -> None:
        sample = drawn(2)
        one = auc(sample.y, sample.x[:, 0])
        alone = one.clustered_variance(sample.y, np.arange(sample.n))
        assert alone == pytest.approx(one.variance, rel=0.02)

    def test_one_athlete_has_no_clustered_variance(self) -> None:
        sample = drawn(2)
        assert np.isnan(auc(sample.y, sample.x[:, 0]).clustered_variance(sample.y, np.zeros(sample.n, dtype=np.intp)))


class TestThresholds:
    @pytest.mark.parametrize("target", [0.1, 0.5, 0.9, 1.0])
    @pytest.mark.parametrize("seed", SEEDS)
    def test_the_largest_threshold_that_reaches_the_target(self, seed: int, target: float) -> None:
        sample = drawn(seed)
        score = sample.x.sum(axis=1)
        found = threshold_at(sample.y, score, target)
        assert confusion(sample.y, score, found).sensitivity >= target - 1e-12
        assert confusion(sample.y, score, np.nextafter(found, np.inf)).sensitivity < target

    def test_27_events_bound_no_90_percent_threshold_from_below_and_36_do(self) -> None:
        def bounds(events: int) -> Any:
            y = np.array([1.0] * events + [0.0] * 100)
            return order_statistic_interval(y, np.arange(y.size, dtype=float), 0.9, 0.95)

        assert bounds(27).low is None
        assert bounds(36).low is not None

    @pytest.mark.parametrize(
        ("sensitivity", "told"),
        [
            (0.9, "A lower bound of a threshold of 90% sensitivity needs 36 events; there are 20."),
            (0.999, "A lower bound of a threshold of 99.9% sensitivity needs 3688 events; there are 20."),
            (1.0, "No number of events bounds a threshold of 100% sensitivity from below; there are 20."),
        ],
    )
    def test_why_a_threshold_has_no_lower_end_is_said(self, sensitivity: float, told: str) -> None:
        y = np.array([1.0] * 20 + [0.0] * 100)
        assert order_statistic_interval(y, np.arange(y.size, dtype=float), sensitivity).reason == told

    @pytest.mark.parametrize(("k", "n"), [(0, 10), (3, 10), (10, 10), (24, 27)])
    def test_clopper_pearson_covers_by_its_definition(self, k: int, n: int) -> None:
        from scipy.stats import binom

        low, high = clopper_pearson(k, n)
        if k > 0:
            assert binom.sf(k - 1, n, low) == pytest.approx(0.025, rel=1e-9)
        if k < n:
            assert binom.cdf(k, n, high) == pytest.approx(0.025, rel=1e-9)


class TestAgreement:
    def test_a_fit_agrees_with_its_own_sample(self) -> None:
        sample = drawn(4)
        found = agreement(sample.y, fit(sample).probability)
        assert found.expected_over_observed == pytest.approx(1.0, rel=1e-9)
        assert (found.intercept, found.slope) == pytest.approx((0.0, 1.0), abs=1e-7)

    def test_a_shifted_and_stretched_predictor_is_found_out(self) -> None:
        sample = drawn(4)
        eta = fit(sample).linear_predictor
        found = agreement(sample.y, expit(2.0 * eta + 1.0))
        assert found.slope == pytest.approx(0.5, abs=1e-7)
        assert found.intercept == pytest.approx(-0.5, abs=1e-7)
        assert shift(sample.y, eta + 0.7)[0] == pytest.approx(-0.7, abs=1e-8)

    def test_slopes_together_are_those_of_one_by_one(self) -> None:
        sample = drawn(5)
        etas = np.stack([fit(sample).linear_predictor * factor for factor in (0.5, 1.0, 3.0)], axis=1)
        assert slopes_on(sample.y, etas) == pytest.approx([2.0, 1.0, 1 / 3], rel=1e-8)

    def test_an_outlier_does_not_take_a_slope_away(self) -> None:
        """The slope of an outcome on a multiple of its own linear predictor is one over the factor, however far."""
        sample = with_outlier()
        eta = fit(sample).linear_predictor
        assert np.abs(eta).max() > 500
        assert slopes_on(sample.y, np.stack([2.0 * eta, 0.25 * eta], axis=1)) == pytest.approx([0.5, 4.0], rel=1e-8)

    def test_weights_to_the_incidence_agree_with_a_prior_corrected_model(self) -> None:
        sample = drawn(6, n=4000)
        tau, share = 0.005, sample.events / sample.n
        p = expit(fit(sample).linear_predictor - prior_offset(share, tau))
        weights = np.where(sample.y == 1, tau / share, (1 - tau) / (1 - share))
        assert agreement(sample.y, p, weights).expected_over_observed == pytest.approx(1.0, abs=0.15)


class TestUpdates:
    @pytest.mark.parametrize(
        ("change", "chosen"),
        [(lambda eta: eta, "original"), (lambda eta: eta + 2.0, "intercept"), (lambda eta: 3 * eta, "recalibration")],
    )
    def test_the_simplest_update_that_is_not_rejected_wins(self, change: Callable[[Any], Any], chosen: str) -> None:
        sample = drawn(7, n=1500)
        assert closed_test(sample, change(fit(sample).linear_predictor)).chosen == chosen

    def test_a_model_of_other_predictors_is_refitted(self) -> None:
        sample = drawn(7, n=1500)
        assert closed_test(sample, -2.0 - sample.x[:, 0] + sample.x[:, 1]).chosen == "refit"

    def test_a_good_level_needs_more_than_a_hundred_events(self) -> None:
        assert 100 < events_for_expected_over_observed(1.2) < 130


class TestDrift:
    def test_the_chart_stays_low_under_the_model_and_signals_when_odds_double(self) -> None:
        generator = np.random.default_rng(1)
        p = np.full(3000, 0.05)
        steady = risk_adjusted_cusum((generator.random(3000) < p).astype(float), p)
        doubled = risk_adjusted_cusum((generator.random(3000) < 0.095).astype(float), p)
        assert (steady.values >= 0).all()
        assert doubled.first_signal is not None
        assert steady.first_signal is None or steady.first_signal > doubled.first_signal

    def test_the_chart_is_the_recursion_that_defines_it(self) -> None:
        generator = np.random.default_rng(2)
        y, p = (generator.random(200) < 0.2).astype(float), generator.uniform(0.05, 0.3, 200)
        level, expected = 0.0, []
        for outcome, risk in zip(y, p, strict=True):
            level = max(0.0, level + outcome * np.log(2) - np.log(1 - risk + 2 * risk))
            expected.append(level)
        assert risk_adjusted_cusum(y, p).values == pytest.approx(expected)

    def test_a_device_that_reads_high_stands_out(self) -> None:
        eta = np.random.default_rng(0).normal(size=400)
        groups = ["new" if i % 4 == 0 else "old" for i in range(400)]
        eta[::4] += 2.0
        found = {one.group: one.difference for one in group_shifts(eta, groups)}
        assert found["new"] > 1.0 > found["old"]
        assert group_shifts(eta, ["one"] * 400) == []


class TestStrain:
    def test_known_coefficients_come_back_and_an_idle_predictor_is_dropped(self) -> None:
        generator = np.random.default_rng(11)
        angle = generator.gamma(2.0, 0.05, (400, 3))
        noise = generator.normal(scale=0.002, size=400)
        noise -= angle[:, 1] * (angle[:, 1] - angle[:, 1].mean()) @ noise / 400
        strain = 0.02 + angle @ np.array([0.8, 0.0, 1.1]) + noise
        found = regress_strain(strain, angle, ["x", "y", "z"], droppable=["y"])
        kept = sm.OLS(strain, sm.add_constant(angle[:, [0, 2]])).fit()
        full = sm.OLS(strain, sm.add_constant(angle)).fit()
        assert full.pvalues[2] > 0.05
        assert found.predictors == ("x", "z")
        assert found.dropped == {"y": pytest.approx(full.pvalues[2])}
        assert found.coefficients == pytest.approx(kept.params)
        assert found.r_squared == pytest.approx(kept.rsquared)

    @pytest.mark.parametrize(
        ("strain", "angle"), [(np.ones(3), np.ones((3, 3))), (np.array([np.nan] * 10), np.ones((10, 3)))]
    )
    def test_too_few_or_missing_strains_are_refused(self, strain: Any, angle: Any) -> None:
        with pytest.raises(CalibrationError):
            regress_strain(strain, angle, ["x", "y", "z"])


class TestCohorts:
    def test_the_order_of_impacts_changes_nothing(self) -> None:
        one = cohort_of()
        order = np.random.default_rng(9).permutation(one.n)
        other = make_cohort(
            one.outcome[order],
            [one.athletes[i] for i in order],
            {key: values[order] for key, values in one.criteria.items()},
        )
        assert other.digest == one.digest
        options = RefitOptions(replicas=20)
        assert report_document(refit(one, options)) == report_document(refit(other, options))

    def test_a_changed_label_or_revision_is_another_cohort(self) -> None:
        one = cohort_of()
        flipped = one.outcome.copy()
        flipped[0] = 1 - flipped[0]
        assert make_cohort(flipped, one.athletes, one.criteria).digest != one.digest
        names = [f"i{i} 1" for i in range(one.n)]
        revised = ["i0 2", *names[1:]]
        digests = {
            make_cohort(one.outcome, one.athletes, one.criteria, identities=ids).digest for ids in (names, revised)
        }
        assert len(digests | {one.digest}) == 3

    def test_folds_keep_athletes_whole_and_share_the_events(self) -> None:
        cohort = cohort_of()
        folds = folds_by_athlete(cohort.clusters, cohort.outcome, 5, np.random.default_rng(0))
        for athlete in np.unique(cohort.clusters):
            assert np.unique(folds[cohort.clusters == athlete]).size == 1
        assert all(cohort.outcome[folds == fold].sum() > 0 for fold in range(5))

    def test_impacts_without_a_criterion_are_left_out_of_its_fit_alone(self) -> None:
        one = cohort_of()
        bric = one.criteria["bric"].copy()
        bric[:30] = np.nan
        document = report_document(
            refit(
                make_cohort(one.outcome, one.athletes, {"bam": one.criteria["bam"], "bric": bric}),
                RefitOptions(replicas=10),
            )
        )
        assert document["criteria"]["bric"]["n"] == one.n - 30
        assert document["criteria"]["bam"]["n"] == one.n

    @pytest.mark.parametrize(
        ("options", "code"),
        [
            ({"criteria": ("bam", "bam")}, "criteria"),
            ({"criteria": ("nonsense",)}, "criteria"),
            ({"sampling": "random"}, "sampling"),
            ({"bias_correction": "much"}, "bias-correction"),
            ({"incidence": 1.0}, "incidence"),
            ({"incidence_range": (0.5, 0.1)}, "incidence-range"),
            ({"incidence": 0.1, "incidence_range": (0.001, 0.02)}, "incidence-range"),
            ({"incidence_range": (0.01, 0.02)}, "incidence-range"),
            ({"replicas": -1}, "replicas"),
            ({"sensitivity_targets": (0.0,)}, "sensitivity"),
            ({"level": 1.0}, "level"),
        ],
    )
    def test_options_out_of_bounds_are_refused(self, options: dict[str, Any], code: str) -> None:
        with pytest.raises(CalibrationError) as caught:
            RefitOptions(**options)
        assert caught.value.code == code

    @pytest.mark.parametrize(
        ("outcome", "athletes", "criteria", "code"),
        [
            ([], [], {}, "no-impacts"),
            ([0.5], ["a"], {}, "outcome"),
            ([1.0], ["a"], {"bam": np.ones((1, 2))}, "shape"),
        ],
    )
    def test_parts_that_do_not_fit_are_refused(self, outcome: Any, athletes: Any, criteria: Any, code: str) -> None:
        with pytest.raises(CalibrationError) as caught:
            make_cohort(np.array(outcome), athletes, criteria)
        assert caught.value.code == code


@pytest.fixture(scope="module")
def model() -> RiskModel:
    """A model fitted to the small cohort."""
    return fitted_model(refit(cohort_of(), RefitOptions(replicas=10)), "small-1")


class TestFittedModels:
    def test_a_document_gives_the_same_model_again(self, model: RiskModel) -> None:
        document = model_to_document(model)
        again = model_from_text(json.dumps(document))
        assert again == model
        assert model_to_document(again) == document

    def test_operating_points_are_those_that_the_cohort_reaches(self, model: RiskModel) -> None:
        cohort = cohort_of()
        b = np.array([-model.curves["bam"].b0, *(-part for part in model.curves["bam"].b)])
        p = expit(b[0] + cohort.criteria["bam"] @ b[1:])
        for sensitivity in (0.25, 0.5, 0.9, 1.0):
            point = resolve_operating_point(OperatingPointRequest("bam", sensitivity=sensitivity), model)
            achieved = confusion(cohort.outcome, p, point.threshold * (1 - 1e-12))
            assert achieved.sensitivity == pytest.approx(point.sensitivity)
            assert achieved.sensitivity >= sensitivity
            assert achieved.specificity == pytest.approx(point.specificity)
            assert point.basis == "cohort"

    def test_a_threshold_for_a_specificity_has_not_the_interval_of_a_sensitivity(self, model: RiskModel) -> None:
        point = resolve_operating_point(OperatingPointRequest("bam", specificity=0.95), model)
        assert (point.specificity or 0.0) >= 0.95
        assert point.threshold_interval is None
        same = resolve_operating_point(OperatingPointRequest("bam", sensitivity=point.sensitivity), model)
        assert same.threshold == point.threshold
        assert same.threshold_interval is not None

    def test_a_served_threshold_has_the_interval_of_its_report(self) -> None:
        done = refit(cohort_of(), RefitOptions(replicas=10, sensitivity_targets=(0.5, 0.8, 0.9)))
        model = fitted_model(done, "small-2")
        reported = report_document(done)["criteria"]["bam"]["served_thresholds"]
        for target, row in zip((0.5, 0.8, 0.9), reported, strict=True):
            point = resolve_operating_point(OperatingPointRequest("bam", sensitivity=target), model)
            assert point.threshold == pytest.approx(row["probability"], rel=1e-12)
            assert point.threshold_interval is not None
            for found, expected in zip(point.threshold_interval, row["probability_interval"], strict=True):
                assert found == (None if expected is None else pytest.approx(expected, rel=1e-12))

    @pytest.mark.parametrize(
        ("change", "pointer"),
        [
            (lambda d: d.update(format="other/1"), "/format"),
            (lambda d: d.pop("curves"), "/curves"),
            (lambda d: d.update(extra=1), ""),
            (lambda d: d.update(version=""), "/version"),
            (lambda d: d.update(incidence=1.0), "/incidence"),
            (lambda d: d.update(incidence=True), "/incidence"),
            (lambda d: d.update(curves={}), "/curves"),
            (lambda d: d["curves"].update(nonsense=d["curves"]["bam"]), "/curves"),
            (lambda d: d["curves"]["bam"].update(slopes=[1.0]), "/curves/bam/slopes"),
            (lambda d: d["curves"]["bam"].update(intercept=float("nan")), "/curves/bam/intercept"),
            (lambda d: d["curves"]["bric"].update(covariance=[[1.0]]), "/curves/bric/covariance"),
            (lambda d: d["curves"]["bric"].update(covariance=[[1.0, 2.0], [2.0, 1.0]]), "/curves/bric/covariance"),
            (lambda d: d["curves"]["bric"].update(covariance=[[1.0, 0.0], [0.1, 1.0]]), "/curves/bric/covariance"),
            (lambda d: d["operating_points"].update(hic15=[]), "/operating_points"),
            (lambda d: d["operating_points"]["bam"][0].update(sensitivity=2), "/operating_points/bam/0/sensitivity"),
            (lambda d: d["cohort"].update(n=[1]), "/cohort/n"),
        ],
    )
    def test_a_document_that_breaks_a_rule_is_told_where(
        self, model: RiskModel, change: Callable[[dict[str, Any]], Any], pointer: str
    ) -> None:
        document = json.loads(json.dumps(model_to_document(model)))
        change(document)
        with pytest.raises(ModelDocumentError) as caught:
            model_from_document(document)
        assert caught.value.pointer == pointer

    def test_a_refit_of_what_a_model_says_gives_that_model(self) -> None:
        """Outcomes drawn from the published curve: its coefficients lie within four standard errors."""
        generator = np.random.default_rng(8)
        curve_of = LAKSARI_2020.curves["bam"]
        bam = generator.gamma(2.0, 0.05, (60_000, 3))
        p = expit(-(curve_of.b0 + bam @ np.array(curve_of.b)))
        outcome = (generator.random(60_000) < p).astype(float)
        cohort = make_cohort(outcome, [f"a{i % 500}" for i in range(60_000)], {"bam": bam})
        options = RefitOptions(sampling="full_follow_up", replicas=0)
        one = refit(cohort, options, LAKSARI_2020).criteria["bam"]
        truth = -np.array([curve_of.b0, *curve_of.b])
        assert (np.abs(one.coefficients - truth) < 4 * np.sqrt(np.diag(one.covariance))).all()
        assert not isinstance(one.closed_test, str)
        assert one.closed_test is not None
        assert one.closed_test.chosen == "original"

    def test_a_profile_without_an_end_takes_nothing_else_from_the_report(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("headimpact.calibration.firth.MAX_STEPS", 1)
        options = RefitOptions(criteria=("bric",), bias_correction="firth", replicas=0)
        firth = report_document(refit(cohort_of(), options))["criteria"]["bric"]["firth"]
        assert firth["profile_intervals"] == firth["profile_p"] == {"intercept": None, "value": None}
        assert set(firth["profile_reasons"]) == {"intercept", "value"}
        assert firth["coefficients"]["value"] > 0

    def test_without_replicas_there_are_no_bootstrap_intervals(self) -> None:
        found = report_document(refit(cohort_of(), RefitOptions(replicas=0)))
        assert found["criteria"]["bam"]["auc"]["bootstrap_interval"] is None
        assert json.dumps(found, allow_nan=False)
