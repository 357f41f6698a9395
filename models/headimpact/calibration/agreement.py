"""Calibration in the narrow sense: whether probabilities agree with what was observed.

All figures may be weighted by impact. A case-control sample holds far more events than the population; weighted by
tau/ybar and (1 - tau)/(1 - ybar) it speaks of the population.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit, logit
from scipy.stats import chi2, norm

from headimpact.calibration.logistic import BLOCK, SAFE_CHANGE, FloatArray, LogisticFit, Sample, fit, risk_of
from headimpact.calibration.robust import sandwich
from headimpact.errors import CalibrationError


@dataclass(frozen=True)
class Agreement:
    """How probabilities p agree with outcomes y.

    Parameters
    ----------
    observed, expected
        Weighted sums of y and of p.
    brier
        Mean squared difference of p and y.
    brier_scaled
        1 - Brier / that of the share of events for everybody.
    intercept, slope
        Of logit P(y = 1) on logit p: 0 and 1 where all is well. None where they cannot be had.
    covariance
        Of these two, 2 x 2.
    in_the_large
        The intercept with the slope held at 1, and its standard error.
    expected_gain
        By how much the logarithm of `expected` grows with that intercept: near 1 while events are rare.
    """

    observed: float
    expected: float
    brier: float
    brier_scaled: float
    intercept: float | None
    slope: float | None
    covariance: FloatArray | None
    in_the_large: tuple[float, float]
    expected_gain: float

    @property
    def expected_over_observed(self) -> float:
        """E:O."""
        return self.expected / self.observed

    def expected_over_observed_interval(self, level: float = 0.95) -> tuple[float, float]:
        """Of E:O, log-normal by the standard error of the calibration in the large, taken to the logarithm of E."""
        half = float(norm.ppf(0.5 + level / 2)) * self.in_the_large[1] * self.expected_gain
        return self.expected_over_observed * float(np.exp(-half)), self.expected_over_observed * float(np.exp(half))


def agreement(y: FloatArray, p: FloatArray, weights: FloatArray | None = None) -> Agreement:
    """Compare probabilities with outcomes.

    Parameters
    ----------
    y
        Outcomes, n.
    p
        Probabilities above 0 and below 1, n.
    weights
        How much each impact counts; once unless given.
    """
    if not ((p > 0.0) & (p < 1.0)).all():
        raise CalibrationError("probability", "Probabilities must be above 0 and below 1.")
    w = np.ones_like(y) if weights is None else weights
    eta = np.asarray(logit(p))
    share = float((w * y).sum() / w.sum())
    brier = float((w * (p - y) ** 2).sum() / w.sum())
    scaled = 1.0 - brier / (share * (1.0 - share)) if 0.0 < share < 1.0 else float("nan")
    recalibrated = recalibration(y, eta, weights)
    intercept, slope, covariance = (None, None, None)
    if recalibrated is not None:
        intercept, slope = recalibrated.coefficients.tolist()
        covariance = recalibrated.covariance if weights is None else sandwich(recalibrated, weights)
    return Agreement(
        float((w * y).sum()),
        float((w * p).sum()),
        brier,
        scaled,
        intercept,
        slope,
        covariance,
        shift(y, eta, weights),
        float((w * p * (1.0 - p)).sum() / (w * p).sum()),
    )


def recalibration(y: FloatArray, linear_predictor: FloatArray, weights: FloatArray | None = None) -> LogisticFit | None:
    """Logistic regression of the outcome on a linear predictor; None where it has no finite answer."""
    try:
        found = fit(Sample(y, linear_predictor[:, None]), weights)
    except CalibrationError:
        return None
    return found if found.converged else None


def slopes_on(y: FloatArray, linear_predictors: FloatArray) -> FloatArray:
    """The slope of :func:`recalibration` on each of B linear predictors, n x B; NaN where it has no finite answer."""
    blocks = [
        _slopes(y[:, None], linear_predictors[:, first : first + BLOCK])
        for first in range(0, linear_predictors.shape[1], BLOCK)
    ]
    slopes = np.concatenate(blocks) if blocks else np.zeros(0)
    for b in np.flatnonzero(np.isnan(slopes)).tolist():  # an outlier needs longer steps than many take together
        alone = recalibration(y, linear_predictors[:, b])
        if alone is not None:
            slopes[b] = alone.coefficients[1]
    return slopes


def _slopes(outcome: FloatArray, eta: FloatArray) -> FloatArray:
    b = np.stack((np.zeros(eta.shape[1]), np.ones(eta.shape[1])))
    step = np.full_like(b, np.inf)
    for _ in range(100):
        p = risk_of(b[0] + b[1] * eta)
        w, residual = p * (1.0 - p), outcome - p
        weighted = w * eta
        s0, s1, s2 = w.sum(axis=0), weighted.sum(axis=0), (weighted * eta).sum(axis=0)
        g0, g1 = residual.sum(axis=0), (residual * eta).sum(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.stack((s2 * g0 - s1 * g1, s0 * g1 - s1 * g0)) / (s0 * s2 - s1 * s1)
        # a step that moves a linear predictor far is cut, where others are halved
        step *= SAFE_CHANGE / np.maximum(np.abs(step[0] + step[1] * eta).max(axis=0), SAFE_CHANGE)
        b += step
        if np.nanmax(np.abs(step), initial=0.0) <= 1e-12:
            break
    return np.where(np.abs(step).max(axis=0) <= 1e-9, b[1], np.nan)


def shift(y: FloatArray, linear_predictor: FloatArray, weights: FloatArray | None = None) -> tuple[float, float]:
    """What added to every linear predictor makes expected equal observed, and its standard error.

    Raises
    ------
    CalibrationError
        There are no events, or nothing but events: no shift is large enough.
    """
    w = np.ones_like(y) if weights is None else weights
    if not 0 < y.sum() < y.size:
        raise CalibrationError("one-outcome", "Impacts with and without concussion are needed.")
    moved = 0.0
    for _ in range(200):
        p = expit(linear_predictor + moved)
        information = float((w * p * (1.0 - p)).sum())
        step = float(np.clip((w * (y - p)).sum() / information, -2.0, 2.0))
        moved += step
        if abs(step) <= 1e-13:
            break
    p = expit(linear_predictor + moved)
    information = float((w * p * (1.0 - p)).sum())
    # weights are no counts: a weighted event is one event still
    spread = information if weights is None else float((w**2 * (y - p) ** 2).sum())
    return moved, float(np.sqrt(spread)) / information


@dataclass(frozen=True)
class HosmerLemeshow:
    """Observed and expected counts (without, with event) in groups of rising probability, and the chi-square test."""

    observed: FloatArray
    expected: FloatArray
    chi_square: float
    degrees_of_freedom: int

    @property
    def p(self) -> float:
        """Of the hypothesis that probabilities agree."""
        return float(chi2.sf(self.chi_square, self.degrees_of_freedom))


def hosmer_lemeshow(y: FloatArray, p: FloatArray, groups: int = 10) -> HosmerLemeshow:
    """Groups between quantiles of p, those that coincide taken as one."""
    cuts = np.unique(np.quantile(p, np.linspace(0.0, 1.0, groups + 1)))
    group = np.clip(np.searchsorted(cuts, p, side="left") - 1, 0, cuts.size - 2)
    sums = [np.bincount(group, part, cuts.size - 1) for part in (1.0 - y, y, 1.0 - p, p)]
    observed, expected = (np.stack(pair, axis=1).astype(np.float64) for pair in (sums[:2], sums[2:]))
    return HosmerLemeshow(observed, expected, float(((observed - expected) ** 2 / expected).sum()), cuts.size - 3)


def spiegelhalter(y: FloatArray, p: FloatArray) -> float:
    """Spiegelhalter's z of the hypothesis that probabilities agree (Spiegelhalter 1986)."""
    return float(((y - p) * (1 - 2 * p)).sum() / np.sqrt(((1 - 2 * p) ** 2 * p * (1 - p)).sum()))
