"""Logistic regression of rare events (King & Zeng 2001): prior correction, case weighting, bias, corrected risks.

In the usual sign p = 1/(1 + exp(-(b0 + b.x))). tau is the population's incidence, ybar the share of events in the
sample. Implementations of the bias correction differ, and both are here under their names:

* ``king_zeng``, the authors' own Stata programme: all weights 1, so w = 1 and w1 = 1, whatever is done about the prior.
* ``zelig``, the R package from 5.1-4 on: under a correction to tau the weights of case weighting enter the bias. It is
  the one whose shrinkage the coefficients of Laksari et al. 2020 show.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.integrate import quad
from scipy.special import expit
from scipy.stats import norm

from headimpact.calibration.logistic import FloatArray, LogisticFit, Sample, fit
from headimpact.calibration.robust import sandwich
from headimpact.errors import CalibrationError

BiasForm = Literal["king_zeng", "zelig"]


def require_incidence(tau: float) -> None:
    """Refuse an incidence that is none."""
    if not 0.0 < tau < 1.0:
        raise CalibrationError("incidence", "An incidence must be above 0 and below 1.")


def prior_offset(share: float, tau: float) -> float:
    """What prior correction takes off the intercept: ln[ ((1 - tau)/tau) (ybar/(1 - ybar)) ].

    Parameters
    ----------
    share
        ybar, the share of events in the sample.
    tau
        Events per impact in the population.
    """
    require_incidence(tau)
    return float(np.log((1.0 - tau) / tau * share / (1.0 - share)))


def prior_corrected(coefficients: FloatArray, share: float, tau: float) -> FloatArray:
    """Coefficients at the population's incidence: only the intercept moves."""
    moved = coefficients.copy()
    moved[0] -= prior_offset(share, tau)
    return moved


def case_weights(sample: Sample, tau: float) -> tuple[float, float]:
    """Weights of case weighting: w1 = tau/ybar of an event, w0 = (1 - tau)/(1 - ybar) of another impact."""
    require_incidence(tau)
    share = sample.events / sample.n
    return tau / share, (1.0 - tau) / (1.0 - share)


def bias(
    sample: Sample, probability: FloatArray, weights: FloatArray | None = None, event_weight: float = 1.0
) -> FloatArray:
    """The small-sample bias of the coefficients, k: (X'WX)^-1 X'W xi.

    W = diag(pi (1 - pi) w), Q = X (X'WX)^-1 X', xi_i = 0.5 Q_ii ((1 + w1) pi_i - w1).

    Parameters
    ----------
    sample
        Outcomes and predictors.
    probability
        pi of each impact, from the fit whose bias is asked for, before any prior correction.
    weights
        w of each impact; 1 unless given.
    event_weight
        w1, one number for all impacts.
    """
    x = sample.design / sample.scale
    w = probability * (1.0 - probability) * (1.0 if weights is None else weights)
    inverse = np.linalg.inv((x.T * w) @ x)
    q = np.einsum("ij,jk,ik->i", x, inverse, x)
    xi = 0.5 * q * ((1.0 + event_weight) * probability - event_weight)
    found: FloatArray = inverse @ (x.T @ (w * xi)) / sample.scale
    return found


def bias_corrected(ml: LogisticFit, form: BiasForm, tau: float | None = None) -> FloatArray:
    """Coefficients without their bias, and at the population's incidence where that is given.

    Bias first, then prior, as both implementations have it.

    Parameters
    ----------
    ml
        The maximum-likelihood fit.
    form
        Which form of the bias.
    tau
        Events per impact in the population; None where the sample is the population.
    """
    sample = ml.sample
    weights, event_weight = None, 1.0
    if form == "zelig" and tau is not None:
        event_weight, other_weight = case_weights(sample, tau)
        weights = np.where(sample.y == 1.0, event_weight, other_weight)
    unbiased: FloatArray = ml.coefficients - bias(sample, ml.probability, weights, event_weight)
    return unbiased if tau is None else prior_corrected(unbiased, sample.events / sample.n, tau)


def shrunk_covariance(ml: LogisticFit) -> FloatArray:
    """King and Zeng's covariance of corrected coefficients: (n/(n + k))^2 V, with k counting the intercept."""
    n, k = ml.sample.design.shape
    found: FloatArray = ml.covariance * (n / (n + k)) ** 2
    return found


@dataclass(frozen=True)
class WeightedFit:
    """A fit by case weighting, and its covariances.

    Parameters
    ----------
    ml
        The weighted maximum-likelihood fit.
    weights
        (w1, w0).
    hc0, hc1, stata
        Sandwich covariances: White's; times n/(n - k), as Zelig reports; times (n/(n + k))^2 n/(n - 1), as the Stata
        programme does.
    """

    ml: LogisticFit
    weights: tuple[float, float]
    hc0: FloatArray
    hc1: FloatArray
    stata: FloatArray

    @property
    def bias_corrected(self) -> FloatArray:
        """The coefficients without their bias, which is that of this fit's own probabilities."""
        w1, w0 = self.weights
        w = np.where(self.ml.sample.y == 1.0, w1, w0)
        return self.ml.coefficients - bias(self.ml.sample, self.ml.probability, w, w1)


def fit_by_weighting(sample: Sample, tau: float) -> WeightedFit:
    """Weight events and others so that their shares are those of the population."""
    w1, w0 = case_weights(sample, tau)
    w = np.where(sample.y == 1.0, w1, w0)
    ml = fit(sample, w)
    n, k = sample.design.shape
    hc0 = sandwich(ml, w)
    stata = (n / (n + k)) ** 2 * n / (n - 1)
    return WeightedFit(ml, (w1, w0), hc0, hc0 * n / (n - k), hc0 * stata)


@dataclass(frozen=True)
class CorrectedRisk:
    """Risks of impacts, with the uncertainty of the coefficients taken into account.

    Parameters
    ----------
    plugin
        pi, the risk at the coefficients themselves.
    correction
        C = (0.5 - pi) pi (1 - pi) x V x'.
    """

    plugin: FloatArray
    correction: FloatArray

    @property
    def bayes(self) -> FloatArray:
        """pi + C, the approximate posterior mean."""
        return np.clip(self.plugin + self.correction, 0.0, 1.0)

    @property
    def unbiased(self) -> FloatArray:
        """pi - C, the approximately unbiased estimate."""
        return np.clip(self.plugin - self.correction, 0.0, 1.0)


def corrected_risk(design: FloatArray, coefficients: FloatArray, covariance: FloatArray) -> CorrectedRisk:
    """Risks of impacts at corrected coefficients.

    Parameters
    ----------
    design
        Impacts, m x k, with a column of ones.
    coefficients
        Corrected coefficients, k.
    covariance
        V, the shrunk covariance of the fit before prior correction, without weights, k x k.
    """
    p = np.asarray(expit(design @ coefficients))
    return CorrectedRisk(p, (0.5 - p) * p * (1.0 - p) * predictor_variance(design, covariance))


def predictor_variance(design: FloatArray, covariance: FloatArray) -> FloatArray:
    """Variance of the linear predictor, x V x', m."""
    found: FloatArray = np.einsum("ij,jk,ik->i", design, covariance, design)
    return found


def posterior_mean(linear_predictor: float, variance: float) -> float:
    """The mean of the risk over a normal linear predictor, by integration: what `bayes` approximates."""
    spread = float(np.sqrt(variance))
    value, _ = quad(
        lambda z: expit(linear_predictor + spread * z) * norm.pdf(z), -np.inf, np.inf, epsabs=1e-13, epsrel=1e-11
    )
    return float(value)
