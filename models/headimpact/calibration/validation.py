"""Figures that are not flattered by having been fitted: out of fold by athlete, and corrected for optimism."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from headimpact.calibration.agreement import recalibration, slopes_on
from headimpact.calibration.discrimination import auc, is_usable, resampled
from headimpact.calibration.logistic import Counts, FloatArray, Sample, deviance, fit, fit_resamples
from headimpact.errors import CalibrationError

IntArray = NDArray[np.intp]


def folds_by_athlete(clusters: IntArray, y: FloatArray, folds: int, generator: np.random.Generator) -> IntArray:
    """A fold for each impact: athletes dealt at random, those with events first, so that every fold gets some.

    Parameters
    ----------
    clusters
        The number of each impact's athlete, n.
    y
        Outcomes, n.
    folds
        How many.
    """
    count = int(clusters.max()) + 1
    if count < folds:
        raise CalibrationError("folds", f"{folds} folds by athlete need as many athletes; there are {count}.")
    with_events = np.bincount(clusters, y, count) > 0
    shuffled = generator.permutation(count)
    order = np.concatenate([shuffled[with_events[shuffled]], shuffled[~with_events[shuffled]]])
    fold_of = np.empty(count, dtype=np.intp)
    fold_of[order] = np.arange(count) % folds
    found: IntArray = fold_of[clusters]
    return found


@dataclass(frozen=True)
class OutOfFold:
    """What models say of impacts that they were not fitted on.

    Parameters
    ----------
    linear_predictor
        Of each impact by the model of the other folds, n; NaN where that could not be fitted.
    coefficients
        Of each fold's model, folds x k.
    auc, auc_per_fold
        Of all impacts together, and within each fold (None where it has one outcome only).
    deviance
        Of these linear predictors.
    calibration
        Intercept and slope of the outcome on them; None where they cannot be had.
    brier
        Mean squared difference of probability and outcome.
    failed
        Folds whose model could not be fitted.
    """

    linear_predictor: FloatArray
    coefficients: FloatArray
    auc: float
    auc_per_fold: tuple[float | None, ...]
    deviance: float
    calibration: tuple[float, float] | None
    brier: float
    failed: tuple[int, ...]


def out_of_fold(sample: Sample, folds: IntArray) -> OutOfFold:
    """Fit on all folds but one, and judge that one; each in turn.

    Parameters
    ----------
    sample
        Outcomes and predictors.
    folds
        The fold of each impact, n: impacts of one athlete share theirs.
    """
    numbers = np.unique(folds)
    if numbers.size < 2:
        raise CalibrationError("folds", "At least two folds are needed.")
    counts = (folds[:, None] != numbers).astype(np.float64)
    refits = fit_resamples(sample, counts, fit(sample).coefficients)
    eta = np.full(sample.n, np.nan)
    for column, number in enumerate(numbers):
        if refits.converged[column]:
            inside = folds == number
            eta[inside] = sample.design[inside] @ refits.coefficients[:, column]
    known = np.isfinite(eta)
    y, judged = sample.y[known], eta[known]
    if not 0 < y.sum() < y.size:
        raise CalibrationError("folds", "No fold could be judged by a model of the others.")
    recalibrated = recalibration(y, judged)
    pair = None if recalibrated is None else tuple(recalibrated.coefficients.tolist())
    return OutOfFold(
        eta,
        refits.coefficients.T,
        auc(y, judged).value,
        tuple(_auc_or_none(sample.y[folds == number], eta[folds == number]) for number in numbers),
        deviance(y, judged),
        None if pair is None else (pair[0], pair[1]),
        float(((1.0 / (1.0 + np.exp(-judged)) - y) ** 2).mean()),
        tuple(int(number) for number, settled in zip(numbers, refits.converged, strict=True) if not settled),
    )


def _auc_or_none(y: FloatArray, eta: FloatArray) -> float | None:
    if not 0 < y.sum() < y.size or not np.isfinite(eta).all():
        return None
    return auc(y, eta).value


@dataclass(frozen=True)
class Optimism:
    """How much better a model looks on the data that it was fitted on than on others (Harrell, Lee & Mark 1996).

    Parameters
    ----------
    apparent_auc
        On the sample itself.
    optimism
        Mean over the resamples of the AUC on the resample less that on the sample.
    calibration_slope
        Mean over the resamples of the slope that the resample's model has on the sample.
    auc_in_resample, auc_on_sample, slopes
        One by one, B; NaN where a resample could not be fitted.
    failed
        How many could not.
    without_slope
        How many of the others have no calibration slope.
    """

    apparent_auc: float
    optimism: float
    calibration_slope: float
    auc_in_resample: FloatArray
    auc_on_sample: FloatArray
    slopes: FloatArray
    failed: int
    without_slope: int

    @property
    def corrected_auc(self) -> float:
        """The apparent AUC less its optimism."""
        return self.apparent_auc - self.optimism


def optimism(sample: Sample, counts: Counts, coefficients: FloatArray, usable: NDArray[np.bool_]) -> Optimism:
    """Judge each resample's model on the resample and on the sample.

    Parameters
    ----------
    sample
        Outcomes and predictors.
    counts
        How often each impact is in each resample, n x B.
    coefficients, usable
        Of the resamples' fits, k x B, and which of them settled.
    """
    eta = sample.design @ coefficients
    replicas = counts.shape[1]
    inside, outside, slopes = (np.full(replicas, np.nan) for _ in range(3))
    judged = np.flatnonzero(usable & is_usable(sample.y, counts))
    once = np.ones(sample.n, dtype=counts.dtype)
    for b in judged.tolist():
        inside[b], outside[b] = resampled(sample.y, eta[:, b], np.stack((counts[:, b], once), axis=1)).auc
    slopes[judged] = slopes_on(sample.y, eta[:, judged])
    known = np.isfinite(inside)
    if not known.any():
        raise CalibrationError("resamples", "No resample could be fitted.")
    return Optimism(
        auc(sample.y, fit(sample).linear_predictor).value,
        float((inside - outside)[known].mean()),
        float(np.nanmean(slopes)) if np.isfinite(slopes).any() else float("nan"),
        inside,
        outside,
        slopes,
        int((~known).sum()),
        int((known & ~np.isfinite(slopes)).sum()),
    )
