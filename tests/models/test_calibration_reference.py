"""Every row of the reference from R, within its own tolerance; a failure shows the call that made the row."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.special import logit
from stats_reference import (
    ROWS,
    cluster_counts,
    clusters,
    column,
    fitted,
    folds,
    formula_of,
    row_counts,
    sample,
    score,
    table,
)

from headimpact.calibration.agreement import agreement, hosmer_lemeshow, spiegelhalter
from headimpact.calibration.discrimination import auc, curve, delong_test, resampled
from headimpact.calibration.firth import fit_firth
from headimpact.calibration.logistic import Sample, deviance, fit, fit_resamples
from headimpact.calibration.rare_events import (
    bias,
    bias_corrected,
    case_weights,
    corrected_risk,
    fit_by_weighting,
    posterior_mean,
    predictor_variance,
    prior_corrected,
    prior_offset,
    shrunk_covariance,
)
from headimpact.calibration.resampling import percentile_interval
from headimpact.calibration.robust import cluster_robust
from headimpact.calibration.sample_size import riley_sample_size
from headimpact.calibration.separation import separation
from headimpact.calibration.thresholds import (
    clopper_pearson,
    confusion,
    order_statistic_interval,
    resampled_thresholds,
    threshold_at,
)
from headimpact.calibration.update import closed_test, likelihood_ratio_test
from headimpact.calibration.validation import optimism, out_of_fold
from headimpact.risk import LAKSARI_2020, linear_predictor_of, probability_of

Value = dict[str, Any]
# R evaluates covariances one IRLS step before it stops: recalibration.md gives 1e-6 for them.
COVARIANCE = 1e-6


def close(found: Any, expected: Any, relative: float, what: str = "") -> None:
    """Within a share of the largest expected value; for coefficients and the like."""
    expected = np.asarray(expected, dtype=float)
    scale = np.abs(expected).max() or 1.0
    np.testing.assert_allclose(np.asarray(found, dtype=float), expected, rtol=0, atol=relative * scale, err_msg=what)


def close_covariance(found: Any, expected: Any, relative: float = COVARIANCE) -> None:
    """Relative to the variances' roots."""
    expected = np.asarray(expected, dtype=float)
    roots = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / np.outer(roots, roots), expected / np.outer(roots, roots), rtol=0, atol=relative)


def formula(row: dict[str, Any]) -> str:
    return row["id"].split("/", 2)[2]


def ml(row: dict[str, Any], value: Value) -> None:
    found = fitted(row["dataset"], formula(row))
    close(found.coefficients, value["coef"], 1e-8)
    close(found.standard_errors, value["se"], COVARIANCE)
    close_covariance(found.covariance, value["vcov"])
    assert found.deviance == pytest.approx(value["deviance"], rel=1e-10)
    assert found.null_deviance == pytest.approx(value["null_deviance"], rel=1e-10)
    assert (found.sample.n, found.sample.events) == (value["n"], value["events"])
    assert separation(found.sample) is None


def lr(row: dict[str, Any], value: Value) -> None:
    found = likelihood_ratio_test(fitted(row["dataset"], formula(row)))
    assert found.statistic == pytest.approx(value["lr"], rel=1e-9)
    assert found.df == value["df"]
    assert found.p == pytest.approx(value["p"], rel=1e-7)
    assert found.log10_p == pytest.approx(value["log10p"], rel=1e-9)


def share(data: Sample) -> float:
    return data.events / data.n


def prior_only(row: dict[str, Any], value: Value) -> None:
    found = fitted(row["dataset"], formula(row))
    assert prior_offset(share(found.sample), value["tau"]) == pytest.approx(value["offset"], rel=1e-9)
    close(prior_corrected(found.coefficients, share(found.sample), value["tau"]), value["coef"], 1e-9)


def bias_only(row: dict[str, Any], value: Value) -> None:
    found = fitted(row["dataset"], formula(row))
    close(bias_corrected(found, "king_zeng"), value["coef"], 1e-8)
    close(bias_corrected(found, "zelig"), value["coef"], 1e-8)
    close(bias(found.sample, found.probability), value["bias"], 1e-7)
    close_covariance(shrunk_covariance(found), value["vcov_kz"])
    close_covariance(found.covariance, value["vcov_zelig"])


def prior_bias_zelig(row: dict[str, Any], value: Value) -> None:
    close(bias_corrected(fitted(row["dataset"], formula(row)), "zelig", value["tau"]), value["coef"], 1e-8)


def prior_bias_unweighted(row: dict[str, Any], value: Value) -> None:
    close(bias_corrected(fitted(row["dataset"], formula(row)), "king_zeng", value["tau"]), value["coef"], 1e-8)


def weighting_only(row: dict[str, Any], value: Value) -> None:
    data = sample(row["dataset"], formula(row))
    found = fit_by_weighting(data, value["tau"])
    assert case_weights(data, value["tau"]) == pytest.approx((value["w1"], value["w0"]), rel=1e-12)
    close(found.ml.coefficients, value["coef"], 1e-8)
    close_covariance(found.hc0, value["vcov_HC0"])
    close_covariance(found.hc1, value["vcov_HC1"])


def weighting_bias(row: dict[str, Any], value: Value) -> None:
    found = fit_by_weighting(sample(row["dataset"], formula(row)), value["tau"])
    close(found.bias_corrected, value["coef"], 1e-8)
    close_covariance(found.hc1, value["vcov_HC1_zelig"])
    close_covariance(found.stata, value["vcov_stata"])


def predictions(row: dict[str, Any], value: Value) -> None:
    found = fitted(row["dataset"], formula(row))
    form = "zelig" if "/pred_zelig/" in row["id"] else "king_zeng"
    coefficients, v = bias_corrected(found, form, value["tau"]), shrunk_covariance(found)
    design = np.array(value["x0"])
    risk = corrected_risk(design, coefficients, v)
    variance = predictor_variance(design, v)
    for name in ("plugin", "bayes", "unbiased"):
        np.testing.assert_allclose(getattr(risk, name), value[name], rtol=1e-6, err_msg=name)
    np.testing.assert_allclose(risk.correction, value["C"], rtol=1e-6)
    np.testing.assert_allclose(design @ coefficients, value["eta"], rtol=1e-7)
    np.testing.assert_allclose(variance, value["xVx"], rtol=1e-6)
    exact = [posterior_mean(e, q) for e, q in zip(design @ coefficients, variance, strict=True)]
    np.testing.assert_allclose(exact, value["exact_posterior_mean"], rtol=1e-6)


def firth(row: dict[str, Any], value: Value) -> None:
    found = fit_firth(sample(row["dataset"], formula(row)))
    for name in ("coef", "coef_brglm2"):
        close(found.coefficients, value[name], 1e-7, name)
    close_covariance(found.covariance, value["vcov"])
    close(np.sqrt(np.diag(found.information_covariance)), value["se_brglm2"], COVARIANCE)
    assert found.penalised_log_likelihood == pytest.approx(value["penalized_loglik"], rel=1e-9)
    assert found.null == pytest.approx(value["penalized_loglik_null"], rel=1e-9)
    assert deviance(found.sample.y, found.linear_predictor) == pytest.approx(value["deviance_at_firth"], rel=1e-9)
    close(found.with_calibrated_intercept, value["flic_coef"], 1e-7)
    profiles = [found.profile(i) for i in range(found.coefficients.size)]
    np.testing.assert_allclose([p.low for p in profiles], value["ci_lower_profile"], rtol=1e-5)
    np.testing.assert_allclose([p.high for p in profiles], value["ci_upper_profile"], rtol=1e-5)
    # R takes 1 - pchisq(), which has no digits left below 1e-12
    np.testing.assert_allclose([p.p for p in profiles], value["p_profile"], rtol=1e-5, atol=1e-12)


def auc_row(row: dict[str, Any], value: Value) -> None:
    found = auc(*score(row["dataset"], row["id"].split("/")[2]))
    assert found.value == pytest.approx(value["auc"], abs=1e-12)
    assert found.variance == pytest.approx(value["delong_var"], rel=1e-10)
    low, _, high = value["ci95"]
    assert found.interval() == pytest.approx((low, high), abs=1e-9)


def auc_clustered(row: dict[str, Any], value: Value) -> None:
    y, s = score(row["dataset"], "bam")
    found = auc(y, s)
    assert found.value == pytest.approx(value["auc"], abs=1e-12)
    assert found.clustered_variance(y, clusters(row["dataset"])) == pytest.approx(value["var_obuchowski"], rel=1e-10)


def ap_at_tau(row: dict[str, Any], value: Value) -> None:
    found = curve(*score(row["dataset"], "bam"))
    assert found.average_precision() == pytest.approx(value["ap_sample"], abs=1e-10)
    assert found.average_precision(value["tau"]) == pytest.approx(value["ap_at_tau"], abs=1e-10)


def interpolated_area(found: Any, recalls: np.ndarray) -> float:
    """The interpolated curve as other packages draw it: at some recalls and at both ends of every vertical fall."""
    points = [*zip(recalls, found.precision_at(recalls), strict=True)]
    points += [*zip(found.sensitivity, found.precision(), strict=True)]
    recall, precision = np.array(sorted(set(points), key=lambda point: (point[0], -point[1]))).T
    return float(np.trapezoid(precision, recall))


def prauc(row: dict[str, Any], value: Value) -> None:
    if row["dataset"] == "matlab_doc":
        return matlab(value)
    found = curve(*score(row["dataset"], row["id"].split("/")[2]))
    assert found.average_precision() == pytest.approx(value["average_precision"], abs=1e-10)
    dropped = found.precision_recall_trapezoid()
    assert dropped == pytest.approx(value["trapezoid_drop_undefined_first"], abs=1e-10)
    assert dropped == pytest.approx(value["mlmetrics_prauc"], abs=1e-10)
    assert found.precision_recall_trapezoid(1.0) == pytest.approx(value["trapezoid_first_precision_1"], abs=1e-10)
    first = float(found.precision()[0])
    filled = found.precision_recall_trapezoid(first)
    assert filled == pytest.approx(value["trapezoid_first_precision_backfilled"], abs=1e-10)
    assert found.precision_recall_integral() == pytest.approx(value["integral_keilwagen"], abs=1e-8)
    # Davis and Goadrich stop at whole hits, precrec at a thousandth of recall. (ROCR's own area is another definition,
    # which we do not offer.)
    whole_hits = np.arange(found.events + 1) / found.events
    assert interpolated_area(found, whole_hits) == pytest.approx(value["davis_goadrich"], abs=1e-8)
    assert interpolated_area(found, np.linspace(0, 1, 1001)) == pytest.approx(value["precrec_interp"], abs=1e-6)
    return None


def matlab(value: Value) -> None:
    """MATLAB's perfcurve, as a public answer prints it."""
    y = np.zeros(1000)
    y[:10] = 1
    first, second = np.zeros(1000), np.zeros(1000)
    first[-1], second[0] = 1.0, 1.0
    found = [curve(y, s).precision_recall_trapezoid() for s in (first, second)]
    assert found == pytest.approx(value["trapezoid_drop"], abs=5e-5)  # four decimals are printed
    assert found == pytest.approx(value["matlab"], abs=5e-5)


def delong(row: dict[str, Any], value: Value) -> None:
    first, second = row["id"].split("/")[2].split("_vs_")
    found = delong_test(auc(*score(row["dataset"], first)), auc(*score(row["dataset"], second)))
    assert found.z == pytest.approx(value["z"], rel=1e-9)
    assert found.p == pytest.approx(value["p"], rel=1e-9)
    assert found.covariance == pytest.approx(value["cov"], rel=1e-9)
    assert found.difference == pytest.approx(value["diff"], abs=1e-12)
    assert found.interval() == pytest.approx(tuple(value["ci95_diff"]), rel=1e-8, abs=1e-12)


def boot(row: dict[str, Any], value: Value) -> None:
    y, s = score(row["dataset"], row["id"].split("/")[2])
    areas = resampled(y, s, row_counts(row["dataset"]))
    found = areas.auc if "/boot_auc/" in row["id"] else areas.average_precision
    np.testing.assert_allclose(found[:5], value["first5"], rtol=0, atol=1e-10)
    assert percentile_interval(found) == pytest.approx(tuple(value["ci95_percentile"]), abs=1e-10)
    assert float(found.std(ddof=1)) == pytest.approx(value["sd"], abs=1e-10)
    if "n_valid" in value:
        assert np.isfinite(found).sum() == value["n_valid"]
        assert float(found.mean()) == pytest.approx(value["mean"], abs=1e-12)


def clusterboot(row: dict[str, Any], value: Value) -> None:
    data = row["dataset"]
    one = fitted(data, formula_of(data, row["id"].split("/")[2]))
    counts = cluster_counts(data)
    found = fit_resamples(one.sample, counts, one.coefficients)
    assert int(found.converged.sum()) == value["n_valid"]
    close(found.coefficients.std(axis=1, ddof=1), value["coef_sd"], 1e-7)
    close(np.quantile(found.coefficients, [0.025, 0.975], axis=1), value["coef_ci"], 1e-7)
    close(np.median(found.coefficients, axis=1), value["coef_median"], 1e-7)
    close(found.coefficients[:, :3].T, value["coef_first3"], 1e-7)
    scores = one.sample.design @ found.coefficients
    areas = [resampled(one.sample.y, scores[:, b], counts[:, b : b + 1]).auc[0] for b in range(counts.shape[1])]
    assert percentile_interval(np.array(areas)) == pytest.approx(tuple(value["auc_ci"]), abs=1e-10)


def probabilities(data: str) -> tuple[np.ndarray, np.ndarray]:
    if data == "calib300":
        return column(data, "y"), column(data, "p")
    one = fitted("impacts914", formula_of("impacts914", "bam"))
    return one.sample.y, one.probability


def calibration(row: dict[str, Any], value: Value) -> None:
    y, p = probabilities(row["dataset"])
    found, groups = agreement(y, p), hosmer_lemeshow(y, p)
    for ours, theirs in {
        "observed": found.observed,
        "expected": found.expected,
        "e_over_o": found.expected_over_observed,
        "o_over_e": 1 / found.expected_over_observed,
        "brier": found.brier,
        "brier_scaled": found.brier_scaled,
        "slope": found.slope,
        "hl_chisq": groups.chi_square,
        "hl_df": groups.degrees_of_freedom,
        "hl_p": groups.p,
        "spiegelhalter_z": spiegelhalter(y, p),
    }.items():
        assert theirs == pytest.approx(value[ours], rel=1e-8), ours
    assert found.intercept == pytest.approx(value["intercept"], abs=1e-8)
    moved, error = found.in_the_large
    assert moved == pytest.approx(value["calibration_in_the_large"], abs=1e-8)
    assert error == pytest.approx(value["citl_se"], rel=COVARIANCE)
    close_covariance(found.covariance, value["vcov_int_slope"])
    close(groups.observed, value["hl_observed_y0_y1"], 1e-12)
    close(groups.expected, value["hl_expected_y0_y1"], 1e-8)
    # rms rounds probabilities to three or four digits before it ranks them
    assert auc(y, p).value == pytest.approx(value["c_index"], abs=1e-4)


def updating(row: dict[str, Any], value: Value) -> None:
    y, p = probabilities(row["dataset"])
    eta = np.asarray(logit(p))
    found = closed_test(Sample(y, eta[:, None]), eta)
    likelihoods = found.log_likelihoods
    assert likelihoods["original"] == pytest.approx(value["ll_original"], rel=1e-7)
    assert likelihoods["intercept"] == pytest.approx(value["ll_intercept"], rel=1e-7)
    assert likelihoods["recalibration"] == pytest.approx(value["ll_logistic_recal"], rel=1e-7)
    # with one predictor the recalibration is the refit
    assert found.tests["original"].statistic == pytest.approx(value["lr_orig_vs_recal"], abs=1e-7)
    assert found.tests["original"].p == pytest.approx(value["p_df2"], abs=1e-7)
    assert found.tests["intercept"].statistic == pytest.approx(value["lr_int_vs_recal"], abs=1e-7)
    assert "recalibration" not in found.tests
    assert found.intercept == pytest.approx(value["intercept_update"], abs=1e-7)
    close(found.recalibration, value["recal_coef"], 1e-7)


def closed(row: dict[str, Any], value: Value) -> None:
    data = sample(row["dataset"], formula_of(row["dataset"], "bam"))
    half = data.n // 2
    old = fit(Sample(data.y[:half], data.x[:half]))
    new = Sample(data.y[half:], data.x[half:])
    found = closed_test(new, new.design @ old.coefficients)
    close(old.coefficients, value["old_coef"], 1e-8)
    close(list(found.log_likelihoods.values()), value["loglik"], 1e-7)
    assert found.intercept == pytest.approx(value["intercept_update"], rel=1e-7)
    close(found.recalibration, value["recal_coef"], 1e-7)
    close(found.refit.coefficients, value["refit_coef"], 1e-7)
    close([test.statistic for test in found.tests.values()], value["T"], 1e-7)
    assert [test.df for test in found.tests.values()] == value["df"]
    close([test.p for test in found.tests.values()], value["p"], 1e-7)
    assert found.chosen == value["selected"]


def cluster(row: dict[str, Any], value: Value) -> None:
    one = fitted(row["dataset"], formula(row))
    found = cluster_robust(one, clusters(row["dataset"]))
    close(one.coefficients, value["coef"], 1e-8)
    assert (one.sample.n, found.clusters, one.coefficients.size) == (value["n"], value["clusters"], value["k"])
    close(one.standard_errors, value["se_model"], COVARIANCE)
    close_covariance(found.hc0, value["vcov_CL_HC0_nocadjust"])
    close_covariance(found.adjusted, value["vcov_CL_HC0_cadjust"])
    close_covariance(found.hc1, value["vcov_CL_HC1"])


def separated(row: dict[str, Any], value: Value) -> None:
    assert value.get("separated", True)
    assert separation(sample(row["dataset"], "y ~ x1 + x2")) == "complete"


def sample_size(row: dict[str, Any], value: Value) -> None:
    predictors = 3 if "vector" in row["id"] else 1
    found = riley_sample_size(0.9 * value["r2cs"], predictors, 27 / 914)
    assert found.impacts == value["required"]
    assert found.events == pytest.approx(value["events"])
    assert found.max_r_squared == pytest.approx(value["max_r2cs"])


def groupcv(row: dict[str, Any], value: Value) -> None:
    data = row["dataset"]
    one = sample(data, formula_of(data, row["id"].split("/")[2]))
    found = out_of_fold(one, folds(data))
    close(found.coefficients, value["fold_coef"], 1e-8)
    assert found.auc == pytest.approx(value["oof_auc_pooled"], abs=1e-8)
    close(found.auc_per_fold, value["auc_per_fold"], 1e-8)
    assert found.deviance == pytest.approx(value["oof_deviance"], rel=1e-8)
    close(found.calibration, value["oof_calibration"], 1e-8)
    assert found.brier == pytest.approx(value["oof_brier"], rel=1e-8)
    close(found.linear_predictor[:5], value["oof_first5"], 1e-8)
    assert not found.failed


def optimism_row(row: dict[str, Any], value: Value) -> None:
    data = row["dataset"]
    one = fitted(data, formula_of(data, row["id"].split("/")[2]))
    counts = row_counts(data)
    refits = fit_resamples(one.sample, counts, one.coefficients)
    found = optimism(one.sample, counts, refits.coefficients, refits.converged)
    assert found.apparent_auc == pytest.approx(value["apparent_auc"], abs=1e-8)
    assert found.optimism == pytest.approx(value["optimism"], abs=1e-8)
    assert found.corrected_auc == pytest.approx(value["corrected_auc"], abs=1e-8)
    assert found.calibration_slope == pytest.approx(value["mean_calibration_slope"], abs=1e-8)
    assert counts.shape[1] - found.failed == value["n_valid"]
    close(found.auc_in_resample[:3], value["first3_auc_boot"], 1e-8)
    close(found.auc_on_sample[:3], value["first3_auc_orig"], 1e-8)
    close(found.slopes[:3], value["first3_slope"], 1e-8)
    close(refits.coefficients[:, :3].T, value["coef_first3"], 1e-8)


def threshold(row: dict[str, Any], value: Value) -> None:
    data = row["dataset"]
    one = fitted(data, formula_of(data, row["id"].split("/")[2]))
    y, eta = one.sample.y, one.linear_predictor
    for name, target in (("sens50", 0.5), ("sens90", 0.9)):
        expected = value[name]
        found = threshold_at(y, eta, target)
        achieved = confusion(y, eta, found)
        assert found == pytest.approx(expected["threshold"], rel=1e-8)
        counts = (achieved.true_positives, achieved.false_positives, achieved.false_negatives, achieved.true_negatives)
        assert counts == (expected["tp"], expected["fp"], expected["fn"], expected["tn"])
        shares = (achieved.sensitivity, achieved.specificity, achieved.accuracy)
        assert shares == pytest.approx(tuple(expected[key] for key in ("sensitivity", "specificity", "accuracy")))
        assert achieved.precision == pytest.approx(expected["ppv"])
        assert achieved.negative_predictive_value == pytest.approx(expected["npv"])
        for how, drawn in (("rows", row_counts(data)), ("cluster", cluster_counts(data))):
            interval = percentile_interval(resampled_thresholds(y, eta, target, drawn))
            assert interval == pytest.approx(tuple(value[f"ci_{how}_{name}"]), rel=1e-8)


def deviance_at_corrected(row: dict[str, Any], value: Value) -> None:
    one = fitted("impacts914", formula_of("impacts914", "bam"))
    tau, y, x = 0.0055, one.sample.y, one.sample.design
    for name, coefficients in {
        "ml": one.coefficients,
        "prior_only": prior_corrected(one.coefficients, share(one.sample), tau),
        "bias_only": bias_corrected(one, "king_zeng"),
        "prior_bias_zelig": bias_corrected(one, "zelig", tau),
        "prior_bias_unweighted": bias_corrected(one, "king_zeng", tau),
        "weighting_only": fit_by_weighting(one.sample, tau).ml.coefficients,
    }.items():
        assert deviance(y, x @ coefficients) == pytest.approx(value[name], rel=1e-9), name


def prior_offset_of_the_paper(row: dict[str, Any], value: Value) -> None:
    assert prior_offset(27 / 914, 0.0055) == pytest.approx(value["offset"], rel=1e-9)
    # BAM's intercept before correction, in the usual sign
    moved = prior_corrected(np.array([-value["beta0_ml"]]), 27 / 914, 0.0055)
    assert -moved[0] == pytest.approx(value["beta0_after_prior"], rel=1e-9)
    assert value["beta0_reported"] - value["beta0_after_prior"] == pytest.approx(value["bias_part"], rel=1e-9)
    assert LAKSARI_2020.curves["bam"].b0 == value["beta0_reported"]


def critical_values(row: dict[str, Any], value: Value) -> None:
    # the text's coefficients (misprint 5), in the sign of Table 3
    b0, slopes = 9.845, np.array([28.86, 10.23, 37.94])
    at = {"p50": 0.5, "axis_values_at_p_0_2029": 0.2029, "axis_values_at_p_0_00786": 0.00786}
    for name, p in at.items():
        close((b0 - linear_predictor_of(p)) / slopes, value[name], 1e-8)
    for name, intercepts in {
        "sens50_p_interval": (0.29, 0.83, 0.22),
        "sens90_p_interval": (0.17, 0.49, 0.13),
    }.items():
        # each printed intercept bounds the linear predictor by its rounding; the three together leave an interval
        low = max(b0 - slope * (printed + 0.005) for slope, printed in zip(slopes, intercepts, strict=True))
        high = min(b0 - slope * (printed - 0.005) for slope, printed in zip(slopes, intercepts, strict=True))
        close((probability_of(high), probability_of(low)), value[name], 1e-8)


def confusion_of_the_paper(row: dict[str, Any], value: Value) -> None:
    y = np.repeat([1.0, 0.0], [27, 887])
    alarmed = np.concatenate((np.arange(27) < value["tp"], np.arange(887) < value["fp"])).astype(float)
    found = confusion(y, alarmed, 1.0)
    assert (found.false_negatives, found.true_negatives) == (value["fn"], value["tn"])
    printed = (found.sensitivity, found.specificity, found.accuracy, found.precision)
    assert printed == pytest.approx((0.296, 0.999, 0.978, 0.889), abs=5e-4)
    assert found.precision_at(0.0055) == pytest.approx(value["ppv_at_tau"], rel=1e-8)


def clopper_pearson_rows(row: dict[str, Any], value: Value) -> None:
    for fraction, expected in value.items():
        assert clopper_pearson(*map(int, fraction.split("/"))) == pytest.approx(tuple(expected), abs=1e-8)


def fewest_events(row: dict[str, Any], value: Value) -> None:
    generator = np.random.default_rng(1)
    for events in (value["n1"] - 1, value["n1"]):
        y, s = np.repeat([1.0, 0.0], [events, 50]), generator.normal(size=events + 50)
        bounds = order_statistic_interval(y, s, 0.9)
        assert (bounds.low is None) == (events < value["n1"])
        assert bounds.low is not None or str(value["n1"]) in bounds.reason
    assert pytest.approx(value["p_at_27"], rel=1e-8) == 0.9**27


CHECKS: dict[str, Callable[[dict[str, Any], Value], None]] = {
    "ml": ml,
    "lr": lr,
    "prior_only": prior_only,
    "bias_only": bias_only,
    "prior_bias_zelig": prior_bias_zelig,
    "prior_bias_unweighted": prior_bias_unweighted,
    "weighting_only": weighting_only,
    "weighting_bias": weighting_bias,
    "pred_zelig": predictions,
    "pred_unweighted": predictions,
    "firth": firth,
    "auc": auc_row,
    "auc_clustered": auc_clustered,
    "ap_at_tau": ap_at_tau,
    "prauc": prauc,
    "perfcurve_pr": prauc,
    "delong": delong,
    "boot_auc": boot,
    "boot_ap": boot,
    "clusterboot": clusterboot,
    "calibration": calibration,
    "updating": updating,
    "closedtest": closed,
    "cluster": cluster,
    "seed_alpha_vector": sample_size,
    "seed_a_magnitude": sample_size,
    "groupcv": groupcv,
    "optimism": optimism_row,
    "threshold": threshold,
    "deviance_at_corrected": deviance_at_corrected,
    "prior_offset": prior_offset_of_the_paper,
    "critical_values": critical_values,
    "confusion50": confusion_of_the_paper,
    "clopper_pearson": clopper_pearson_rows,
    "min_events_for_finite_lower_bound_90sens": fewest_events,
    "relogit": separated,
}


@pytest.mark.parametrize("row", ROWS, ids=[row["id"] for row in ROWS])
def test_the_result_of_r_is_reproduced(row):
    kind = row["id"].split("/")[1]
    check = separated if row["id"] == "sep_complete/ml" else CHECKS[kind]
    try:
        check(row, row["value"])
    except AssertionError as failure:
        raise AssertionError(f"{failure}\n{row['call']}\ntolerance: {row['tolerance']}") from None


def test_the_reference_has_its_258_rows():
    assert len(ROWS) == len({row["id"] for row in ROWS}) == 258
    assert table("impacts914")["y"].count("1") == 27
