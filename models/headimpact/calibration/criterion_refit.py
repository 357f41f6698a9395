"""The refit of one criterion: fit, corrections, discrimination, validation, thresholds, calibration, update."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from headimpact.calibration.agreement import Agreement, agreement
from headimpact.calibration.discrimination import Auc, Curve, Resampled, auc, curve, resampled
from headimpact.calibration.firth import FirthFit, fit_firth
from headimpact.calibration.logistic import (
    FloatArray,
    LogisticFit,
    Refits,
    Sample,
    fit,
    fit_resamples,
    require_fittable,
)
from headimpact.calibration.options import RefitOptions
from headimpact.calibration.rare_events import (
    BiasForm,
    CorrectedRisk,
    bias_corrected,
    case_weights,
    corrected_risk,
    prior_corrected,
    prior_offset,
    shrunk_covariance,
)
from headimpact.calibration.resampling import too_few_clusters
from headimpact.calibration.robust import ClusteredCovariance, cluster_robust
from headimpact.calibration.sample_size import SampleSize, cox_snell, max_cox_snell, riley_sample_size
from headimpact.calibration.separation import separation
from headimpact.calibration.thresholds import (
    Bounds,
    Confusion,
    clopper_pearson,
    confusion,
    order_statistic_interval,
    resampled_thresholds,
    threshold_at,
)
from headimpact.calibration.update import ChiSquareTest, ClosedTest, closed_test, likelihood_ratio_test
from headimpact.calibration.validation import Optimism, OutOfFold, optimism, out_of_fold
from headimpact.errors import CalibrationError, SeparationError

IntArray = NDArray[np.intp]
Counts = NDArray[np.uint16]
Result = TypeVar("Result")


@dataclass(frozen=True)
class Resamples:
    """Bootstrap resamples of the cohort, n x B each: by impact, and by athlete."""

    by_impact: Counts
    by_athlete: Counts

    def of(self, rows: NDArray[np.bool_]) -> Resamples:
        """Those of some of the impacts."""
        return Resamples(self.by_impact[rows], self.by_athlete[rows])

    def without_athletes(self) -> Resamples:
        """Those by impact alone."""
        return Resamples(self.by_impact, self.by_athlete[:, :0])


@dataclass(frozen=True)
class Bootstrap:
    """One way to resample: the refits, and the areas of the score that was fitted on the whole sample.

    Parameters
    ----------
    refits
        Coefficients of each resample's own fit, k x B.
    areas
        Of the sample's score in each resample, B.
    failed
        Resamples whose fit did not settle, or that lack events.
    reason
        Why there are no resamples of this kind, though they were asked for.
    """

    refits: Refits
    areas: Resampled
    failed: int
    reason: str | None = None


@dataclass(frozen=True)
class Threshold:
    """A threshold on a score for a sensitivity target, what it achieves, and how sure it is."""

    target: float
    value: float
    achieved: Confusion
    sensitivity_interval: tuple[float, float]
    specificity_interval: tuple[float, float]
    precision_at_incidence: float | None
    bounds: Bounds
    by_impact: FloatArray
    by_athlete: FloatArray


@dataclass(frozen=True)
class CriterionRefit:
    """Everything that a refit finds out about one criterion.

    `ml` is the maximum-likelihood fit, None where the outcome is separated and Firth's correction was asked for.
    `coefficients` and `covariance` are the served ones: corrected for bias, and at the incidence. Discrimination,
    curves and thresholds are those of the score, `score`: the linear predictor of the ML fit (of Firth's, where there
    is none); `served` is the linear predictor at the served coefficients.
    """

    name: str
    sample: Sample
    rows: NDArray[np.bool_]
    ml: LogisticFit | None
    firth: FirthFit | None
    separated: str | None
    coefficients: FloatArray
    covariance: FloatArray
    robust: ClusteredCovariance | None
    intercept_range: tuple[float, float] | None
    condition_number: float
    lr_test: ChiSquareTest | None
    score: FloatArray
    served: FloatArray
    auc: Auc
    curve: Curve
    by_impact: Bootstrap
    by_athlete: Bootstrap
    out_of_fold: OutOfFold | str
    optimism: Optimism | str
    thresholds: tuple[Threshold, ...]
    served_thresholds: tuple[Threshold, ...]
    weights: FloatArray | None
    risk: CorrectedRisk
    calibration: Agreement
    out_of_fold_calibration: Agreement | None
    sample_size: SampleSize | None
    closed_test: ClosedTest | str | None
    active_calibration: Agreement | None

    @property
    def lowering(self) -> tuple[int, ...]:
        """Components whose served coefficient lowers the risk."""
        return tuple(np.flatnonzero(self.coefficients[1:] < 0.0).tolist())


@dataclass(frozen=True)
class Setting:
    """What the criteria of one refit have in common."""

    options: RefitOptions
    clusters: IntArray
    folds: IntArray
    resamples: Resamples


def refit_criterion(
    name: str, sample: Sample, rows: NDArray[np.bool_], setting: Setting, active: FloatArray | None = None
) -> CriterionRefit:
    """Refit one criterion.

    Parameters
    ----------
    name
        Of the criterion.
    sample
        Its impacts.
    rows
        Which of the cohort's impacts these are.
    setting
        Options, and the athlete, the fold and the resamples of the cohort's impacts.
    active
        The linear predictor that the model in service gives to each impact of the sample, in the usual sign, at the
        incidence of this refit; None where it has none.

    Raises
    ------
    CalibrationError
        The sample allows no fit, with what it lacks.
    """
    options = setting.options
    require_fittable(sample)
    kind = separation(sample)
    if kind is not None and options.bias_correction != "firth":
        raise SeparationError(kind)
    ml = fit(sample) if kind is None else None
    if ml is not None and not ml.converged:
        raise CalibrationError("not-converged", "Newton's method did not settle.")
    firth = fit_firth(sample) if options.bias_correction == "firth" else None
    coefficients, covariance = _served(ml, firth, options)
    score = ml.linear_predictor if ml is not None else _linear(sample, firth)
    served = sample.design @ coefficients
    clusters, resamples = _renumbered(setting.clusters[rows]), setting.resamples.of(rows)
    too_few = too_few_clusters(sample.y, clusters)
    if too_few is not None:
        resamples = resamples.without_athletes()
    weights = _population_weights(sample, options)
    by_impact = _bootstrap(sample, score, resamples.by_impact, ml)
    by_athlete = replace(_bootstrap(sample, score, resamples.by_athlete, ml), reason=too_few)
    folded = tried(lambda: out_of_fold(sample, setting.folds[rows]))
    return CriterionRefit(
        name=name,
        sample=sample,
        rows=rows,
        ml=ml,
        firth=firth,
        separated=kind,
        coefficients=coefficients,
        covariance=covariance,
        robust=None if ml is None or clusters.max() < 1 else cluster_robust(ml, clusters),
        intercept_range=_intercept_range(sample, coefficients, options),
        condition_number=_condition_number(sample),
        lr_test=None if ml is None else likelihood_ratio_test(ml),
        score=score,
        served=served,
        auc=auc(sample.y, score),
        curve=curve(sample.y, score),
        by_impact=by_impact,
        by_athlete=by_athlete,
        out_of_fold=folded,
        optimism=tried(
            lambda: optimism(sample, resamples.by_impact, by_impact.refits.coefficients, by_impact.refits.converged)
        ),
        thresholds=_thresholds(sample.y, score, resamples, options),
        served_thresholds=_thresholds(sample.y, served, resamples, options),
        weights=weights,
        risk=corrected_risk(sample.design, coefficients, covariance),
        calibration=agreement(sample.y, _inside(expit(served)), weights),
        out_of_fold_calibration=_out_of_fold_calibration(sample, folded, options, weights),
        sample_size=_sample_size(ml),
        closed_test=None if active is None else _closed_test(sample, active, options),
        active_calibration=None if active is None else agreement(sample.y, _inside(expit(active)), weights),
    )


def _in_sample(active: FloatArray, sample: Sample, options: RefitOptions) -> FloatArray:
    """A linear predictor at the incidence, as it would be at the sample's own share of events."""
    return active if options.tau is None else active + prior_offset(sample.events / sample.n, options.tau)


def _closed_test(sample: Sample, active: FloatArray, options: RefitOptions) -> ClosedTest | str:
    return tried(lambda: closed_test(sample, _in_sample(active, sample, options), options.alpha))


def _linear(sample: Sample, firth: FirthFit | None) -> FloatArray:
    assert firth is not None
    found: FloatArray = sample.design @ firth.coefficients
    return found


def _served(ml: LogisticFit | None, firth: FirthFit | None, options: RefitOptions) -> tuple[FloatArray, FloatArray]:
    """Served coefficients and their covariance."""
    if firth is not None:
        share = firth.sample.events / firth.sample.n
        found = firth.coefficients if options.tau is None else prior_corrected(firth.coefficients, share, options.tau)
        return found, firth.information_covariance
    assert ml is not None
    if options.bias_correction == "none":
        share = ml.sample.events / ml.sample.n
        found = ml.coefficients if options.tau is None else prior_corrected(ml.coefficients, share, options.tau)
        return found, ml.covariance
    form: BiasForm = "zelig" if options.bias_correction == "zelig" else "king_zeng"
    return bias_corrected(ml, form, options.tau), shrunk_covariance(ml)


def _intercept_range(sample: Sample, coefficients: FloatArray, options: RefitOptions) -> tuple[float, float] | None:
    """The intercept at the ends of the range of incidences."""
    if options.incidence_range is None or options.tau is None:
        return None
    share, here = sample.events / sample.n, float(coefficients[0])
    base = here + prior_offset(share, options.tau)
    low, high = (base - prior_offset(share, tau) for tau in options.incidence_range)
    return low, high


def _condition_number(sample: Sample) -> float:
    """Of the scaled information without weights: how near the predictors are to repeating each other."""
    scaled = sample.design / sample.scale
    return float(np.linalg.cond(scaled.T @ scaled))


def _renumbered(clusters: IntArray) -> IntArray:
    return np.unique(clusters, return_inverse=True)[1].astype(np.intp)


def _population_weights(sample: Sample, options: RefitOptions) -> FloatArray | None:
    """Weights that make a case-control sample speak of the population."""
    if options.tau is None:
        return None
    w1, w0 = case_weights(sample, options.tau)
    return np.where(sample.y == 1.0, w1, w0)


def _bootstrap(sample: Sample, score: FloatArray, counts: Counts, ml: LogisticFit | None) -> Bootstrap:
    k = sample.design.shape[1]
    if counts.shape[1] == 0:
        empty = np.zeros(0)
        return Bootstrap(Refits(np.zeros((k, 0)), np.zeros(0, dtype=bool)), Resampled(empty, empty), 0)
    refits = fit_resamples(sample, counts, None if ml is None else ml.coefficients)
    return Bootstrap(refits, resampled(sample.y, score, counts), int((~refits.converged).sum()))


def _thresholds(y: FloatArray, score: FloatArray, resamples: Resamples, options: RefitOptions) -> tuple[Threshold, ...]:
    found = []
    for target in options.sensitivity_targets:
        value = threshold_at(y, score, target)
        achieved = confusion(y, score, value)
        found.append(
            Threshold(
                target,
                value,
                achieved,
                clopper_pearson(achieved.true_positives, achieved.events, options.level),
                clopper_pearson(achieved.true_negatives, achieved.others, options.level),
                achieved.precision_at(options.tau if options.tau is not None else float(y.mean())),
                order_statistic_interval(y, score, target, options.level),
                resampled_thresholds(y, score, target, resamples.by_impact),
                resampled_thresholds(y, score, target, resamples.by_athlete),
            )
        )
    return tuple(found)


def _out_of_fold_calibration(
    sample: Sample, folded: OutOfFold | str, options: RefitOptions, weights: FloatArray | None
) -> Agreement | None:
    """Of what the other folds' models say, at the incidence."""
    if isinstance(folded, str):
        return None
    eta = folded.linear_predictor
    known = np.isfinite(eta)
    if options.tau is not None:
        eta = eta - prior_offset(sample.events / sample.n, options.tau)
    return agreement(sample.y[known], _inside(expit(eta[known])), None if weights is None else weights[known])


def _inside(p: FloatArray) -> FloatArray:
    """Probabilities that rounding has put on 0 or 1, just inside."""
    tiny = float(np.finfo(np.float64).tiny)
    return np.clip(p, tiny, 1.0 - float(np.finfo(np.float64).epsneg))


def _sample_size(ml: LogisticFit | None) -> SampleSize | None:
    """What a model like this one would need; None where it explains nothing, or too much."""
    if ml is None:
        return None
    share = ml.sample.events / ml.sample.n
    r_squared = 0.9 * cox_snell(ml.null_deviance - ml.deviance, ml.sample.n)
    if not 0.0 < r_squared < max_cox_snell(share):
        return None
    return riley_sample_size(r_squared, ml.sample.x.shape[1], share)


def tried(work: Callable[[], Result]) -> Result | str:
    """What the work gives, or why it cannot be had."""
    try:
        return work()
    except CalibrationError as error:
        return str(error)
