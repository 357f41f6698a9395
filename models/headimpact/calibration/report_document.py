"""A refit as a document of JSON's own types: what `report.json` holds, and what pages and figures are made from."""

from __future__ import annotations

from functools import partial
from math import isfinite
from typing import Any

import numpy as np
from scipy.special import expit

from headimpact.calibration.agreement import Agreement, hosmer_lemeshow, spiegelhalter
from headimpact.calibration.criterion_refit import Bootstrap, CriterionRefit, Threshold, tried
from headimpact.calibration.firth import Profile
from headimpact.calibration.logistic import FloatArray
from headimpact.calibration.rare_events import prior_offset
from headimpact.calibration.refit import Comparison, Refit, coefficient_names
from headimpact.calibration.resampling import percentile_interval
from headimpact.calibration.sample_size import events_for_expected_over_observed, expected_over_observed_half_width
from headimpact.calibration.thresholds import Confusion
from headimpact.calibration.update import ChiSquareTest, ClosedTest
from headimpact.calibration.validation import Optimism, OutOfFold
from headimpact.criteria import BY_KEY

FORMAT = "headimpact-refit/1"


def report_document(found: Refit) -> dict[str, Any]:
    """Everything that a refit found out. The same refit gives the same document; no number in it is NaN or infinite."""
    options, cohort = found.options, found.cohort
    m = found.reference_tests
    document = {
        "format": FORMAT,
        "cohort": {
            "n": cohort.n,
            "events": cohort.events,
            "athletes": cohort.athlete_count,
            "athletes_with_events": cohort.athletes_with_events,
            "share": cohort.events / cohort.n,
            "incidence": options.tau if options.tau is not None else cohort.events / cohort.n,
            "sampling": options.sampling,
            "digest": cohort.digest,
        },
        "options": {
            "bias_correction": options.bias_correction,
            "incidence_range": _pair(options.incidence_range),
            "ignored": list(options.ignored),
            "replicas": options.replicas,
            "resamples": "given" if options.resamples is not None else "drawn",
            "folds": options.folds if isinstance(options.folds, int) else "given",
            "seed": options.seed,
            "sensitivity_targets": list(options.sensitivity_targets),
            "level": options.level,
            "alpha": options.alpha,
        },
        "criteria": {name: _criterion(one, found) for name, one in found.criteria.items()},
        "failed": {name: {"code": error.code, "detail": str(error)} for name, error in found.failed.items()},
        "delong": {f"{one.first}_vs_{one.second}": _comparison(one) for one in found.comparisons},
        "bonferroni": {"m": m, "alpha": options.alpha / max(m, 1)},
        "lr_bonferroni": {"m": len(found.criteria), "alpha": options.alpha / len(found.criteria)},
        "active": found.active,
        "sample_size": {
            "events_for_expected_over_observed_within_20_percent": events_for_expected_over_observed(1.2),
            "expected_over_observed_factor": expected_over_observed_half_width(cohort.events),
        },
    }
    finite: dict[str, Any] = _finite(document)
    return finite


def _finite(value: Any) -> Any:  # noqa: ANN401 - JSON's own types
    """The same with null for what is no finite number."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def _pair(interval: tuple[float | None, float | None] | None) -> list[float | None] | None:
    return None if interval is None else list(interval)


def _criterion(one: CriterionRefit, found: Refit) -> dict[str, Any]:
    options, names = found.options, coefficient_names(one.name)
    sample = one.sample
    entry: dict[str, Any] = {
        "n": sample.n,
        "events": sample.events,
        "missing": found.cohort.n - sample.n,
        "unit": BY_KEY[one.name].unit if one.name in BY_KEY else None,
        "separation": one.separated,
        "condition_number": one.condition_number,
        "coefficients": _named(names, one.coefficients),
        "covariance": one.covariance.tolist(),
        "standard_errors": _named(names, np.sqrt(np.diag(one.covariance))),
        "intercept_range": _pair(one.intercept_range),
        "prior_offset": None if options.tau is None else prior_offset(sample.events / sample.n, options.tau),
        "lowers_risk": [names[1 + i] for i in one.lowering],
        **_maximum_likelihood(one, names),
        **_firth(one, names),
        "auc": _auc(one, options.level, found),
        "average_precision": one.curve.average_precision(),
        "average_precision_at_incidence": None if options.tau is None else one.curve.average_precision(options.tau),
        "auc_pr_trapezoid": one.curve.precision_recall_trapezoid(),
        "auc_pr_integral": one.curve.precision_recall_integral(),
        "bootstrap": {
            "by_impact": _bootstrap(one.by_impact, names, options.level),
            "by_athlete": _bootstrap(one.by_athlete, names, options.level),
        },
        "out_of_fold": _out_of_fold(one.out_of_fold),
        **_optimism(one.optimism),
        "thresholds": [_threshold(point, one.by_athlete, options.level) for point in one.thresholds],
        "served_thresholds": [
            _served_threshold(point, one.by_athlete, options.level) for point in one.served_thresholds
        ],
        "calibration": {
            **_agreement(one.calibration, options.level),
            "weighted_to_incidence": one.weights is not None,
            "out_of_fold": (
                None if one.out_of_fold_calibration is None else _agreement(one.out_of_fold_calibration, options.level)
            ),
            **_groups(one),
        },
        "corrected_risk": _corrected_risk(one),
        "sample_size": _sample_size(one),
        "update": _update(one.closed_test),
        "active": None if one.active_calibration is None else _agreement(one.active_calibration, options.level),
    }
    return entry


def _named(names: list[str], values: FloatArray) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))


def _maximum_likelihood(one: CriterionRefit, names: list[str]) -> dict[str, Any]:
    """What the maximum-likelihood fit says; null where the outcome is separated."""
    ml = one.ml
    if ml is None or one.lr_test is None:
        nothing = ("ml_coefficients", "ml_covariance", "ml_standard_errors", "robust_covariance", "deviance", "lr_test")
        return dict.fromkeys(nothing) | {"null_deviance": None, "converged": False}
    return {
        "ml_coefficients": _named(names, ml.coefficients),
        "ml_covariance": ml.covariance.tolist(),
        "ml_standard_errors": _named(names, ml.standard_errors),
        "robust_covariance": None if one.robust is None else one.robust.adjusted.tolist(),
        "robust_standard_errors": (
            None if one.robust is None else _named(names, np.sqrt(np.diag(one.robust.adjusted)))
        ),
        "converged": ml.converged,
        "iterations": ml.iterations,
        "deviance": ml.deviance,
        "null_deviance": ml.null_deviance,
        "lr_test": _test(one.lr_test),
    }


def _test(test: ChiSquareTest) -> dict[str, Any]:
    return {"statistic": test.statistic, "df": test.df, "p": test.p, "log10_p": test.log10_p}


def _firth(one: CriterionRefit, names: list[str]) -> dict[str, Any]:
    if one.firth is None:
        return {}
    profiles: dict[str, Profile | str] = {name: tried(partial(one.firth.profile, i)) for i, name in enumerate(names)}
    return {
        "firth": {
            "coefficients": _named(names, one.firth.coefficients),
            "covariance": one.firth.covariance.tolist(),
            "information_covariance": one.firth.information_covariance.tolist(),
            "penalised_log_likelihood": one.firth.penalised_log_likelihood,
            "profile_intervals": {
                name: None if isinstance(found, str) else [found.low, found.high] for name, found in profiles.items()
            },
            "profile_p": {name: None if isinstance(found, str) else found.p for name, found in profiles.items()},
            "profile_reasons": {name: found for name, found in profiles.items() if isinstance(found, str)},
            "calibrated_intercept": float(one.firth.with_calibrated_intercept[0]),
        }
    }


def _auc(one: CriterionRefit, level: float, found: Refit) -> dict[str, Any]:
    return {
        "value": one.auc.value,
        "interval": list(one.auc.interval(level)),
        "delong_variance": one.auc.variance,
        "clustered_variance": one.auc.clustered_variance(one.sample.y, _clusters(one, found)),
        "bootstrap_interval": _pair(percentile_interval(one.by_impact.areas.auc, level)),
        "bootstrap_interval_by_athlete": _pair(percentile_interval(one.by_athlete.areas.auc, level)),
        "bootstrap_interval_by_athlete_reason": one.by_athlete.reason,
    }


def _clusters(one: CriterionRefit, found: Refit) -> Any:  # noqa: ANN401 - an array of whole numbers
    return np.unique(found.cohort.clusters[one.rows], return_inverse=True)[1]


def _bootstrap(done: Bootstrap, names: list[str], level: float) -> dict[str, Any]:
    usable = done.refits.coefficients[:, done.refits.converged]
    coefficients = {
        name: {
            "median": float(np.median(values)) if values.size else None,
            "sd": float(values.std(ddof=1)) if values.size > 1 else None,
            "interval": _pair(percentile_interval(values, level)),
        }
        for name, values in zip(names, usable, strict=True)
    }
    return {
        "replicas": int(done.refits.converged.size),
        "failed": done.failed,
        "reason": done.reason,
        "coefficients": coefficients,
        "auc": _spread(done.areas.auc, level),
        "average_precision": _spread(done.areas.average_precision, level),
    }


def _spread(values: FloatArray, level: float) -> dict[str, Any]:
    known = values[np.isfinite(values)]
    return {
        "mean": float(known.mean()) if known.size else None,
        "sd": float(known.std(ddof=1)) if known.size > 1 else None,
        "interval": _pair(percentile_interval(values, level)),
    }


def _out_of_fold(done: OutOfFold | str) -> dict[str, Any]:
    if isinstance(done, str):
        return {"auc": None, "reason": done}
    return {
        "auc": done.auc,
        "auc_per_fold": list(done.auc_per_fold),
        "deviance": done.deviance,
        "calibration_intercept": None if done.calibration is None else done.calibration[0],
        "calibration_slope": None if done.calibration is None else done.calibration[1],
        "brier": done.brier,
        "fold_coefficients": done.coefficients.tolist(),
        "failed_folds": list(done.failed),
    }


def _optimism(done: Optimism | str) -> dict[str, Any]:
    if isinstance(done, str):
        return {"optimism_corrected_auc": None, "optimism": {"reason": done}}
    return {
        "optimism_corrected_auc": done.corrected_auc,
        "optimism": {
            "auc": done.optimism,
            "calibration_slope": done.calibration_slope,
            "failed": done.failed,
            "without_slope": done.without_slope,
        },
    }


def _confusion(achieved: Confusion) -> dict[str, int]:
    return {
        "true_positives": achieved.true_positives,
        "false_positives": achieved.false_positives,
        "false_negatives": achieved.false_negatives,
        "true_negatives": achieved.true_negatives,
    }


def _threshold(point: Threshold, by_athlete: Bootstrap, level: float) -> dict[str, Any]:
    achieved, bounds = point.achieved, point.bounds
    return {
        "sensitivity_target": point.target,
        "threshold": point.value,
        "sensitivity": achieved.sensitivity,
        "specificity": achieved.specificity,
        "sensitivity_interval": list(point.sensitivity_interval),
        "specificity_interval": list(point.specificity_interval),
        "precision": achieved.precision,
        "precision_at_incidence": point.precision_at_incidence,
        "negative_predictive_value": achieved.negative_predictive_value,
        "accuracy": achieved.accuracy,
        "threshold_interval": [bounds.low, bounds.high],
        "threshold_interval_reason": bounds.reason,
        "threshold_interval_bootstrap": _pair(percentile_interval(point.by_impact, level)),
        "threshold_interval_bootstrap_by_athlete": _pair(percentile_interval(point.by_athlete, level)),
        "threshold_interval_bootstrap_by_athlete_reason": by_athlete.reason,
        **_confusion(achieved),
    }


def _served_threshold(point: Threshold, by_athlete: Bootstrap, level: float) -> dict[str, Any]:
    """The same on the served linear predictor, and as the probability that scores are compared with."""
    bounds = point.bounds
    return _threshold(point, by_athlete, level) | {
        "probability": float(expit(point.value)),
        "probability_interval": [None if end is None else float(expit(end)) for end in (bounds.low, bounds.high)],
    }


def _agreement(done: Agreement, level: float) -> dict[str, Any]:
    return {
        "expected_over_observed": done.expected_over_observed,
        "expected_over_observed_interval": list(done.expected_over_observed_interval(level)),
        "observed": done.observed,
        "expected": done.expected,
        "intercept": done.intercept,
        "slope": done.slope,
        "covariance": None if done.covariance is None else done.covariance.tolist(),
        "in_the_large": done.in_the_large[0],
        "in_the_large_standard_error": done.in_the_large[1],
        "brier": done.brier,
        "brier_scaled": done.brier_scaled,
    }


def _groups(one: CriterionRefit) -> dict[str, Any]:
    """Tests of the score's own probabilities, in the sample as it is."""
    p = np.asarray(expit(one.score))
    if not ((p > 0) & (p < 1)).all():
        return {"hosmer_lemeshow": None, "spiegelhalter_z": None}
    groups = hosmer_lemeshow(one.sample.y, p)
    return {
        "hosmer_lemeshow": {
            "chi_square": groups.chi_square,
            "df": groups.degrees_of_freedom,
            "p": groups.p if groups.degrees_of_freedom > 0 else None,
            "observed": groups.observed.tolist(),
            "expected": groups.expected.tolist(),
        },
        "spiegelhalter_z": spiegelhalter(one.sample.y, p),
    }


def _corrected_risk(one: CriterionRefit) -> dict[str, float]:
    """Mean risks of the cohort at the served coefficients: as they are, and with the coefficients' uncertainty."""
    return {
        "plugin_mean": float(one.risk.plugin.mean()),
        "bayes_mean": float(one.risk.bayes.mean()),
        "unbiased_mean": float(one.risk.unbiased.mean()),
    }


def _sample_size(one: CriterionRefit) -> dict[str, Any] | None:
    needed = one.sample_size
    if needed is None:
        return None
    return {
        "impacts": needed.impacts,
        "events": needed.events,
        "by_shrinkage": needed.by_shrinkage,
        "by_r_squared": needed.by_r_squared,
        "by_intercept": needed.by_intercept,
    }


def _update(done: ClosedTest | str | None) -> dict[str, Any] | None:
    if done is None:
        return None
    if isinstance(done, str):
        return {"chosen": None, "reason": done}
    return {
        "chosen": done.chosen,
        "log_likelihoods": dict(done.log_likelihoods),
        "tests": {name: _test(test) for name, test in done.tests.items()},
        "intercept": done.intercept,
        "recalibration": None if done.recalibration is None else done.recalibration.tolist(),
    }


def _comparison(one: Comparison) -> dict[str, Any]:
    low, high = one.apparent.interval()
    entry: dict[str, Any] = {
        "z": one.apparent.z,
        "p": one.apparent.p,
        "difference": one.apparent.difference,
        "difference_interval": [low, high],
        "covariance": one.apparent.covariance,
        "out_of_fold": None,
    }
    if one.out_of_fold is not None:
        entry["out_of_fold"] = {
            "z": one.out_of_fold.z,
            "p": one.out_of_fold.p,
            "difference": one.out_of_fold.difference,
        }
    return entry
