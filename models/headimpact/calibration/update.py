"""How far new data justify changing a model: the closed test of Vergouwe et al. 2017, and its parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import chi2

from headimpact.calibration.agreement import recalibration, shift
from headimpact.calibration.logistic import FloatArray, LogisticFit, Sample, deviance, fit
from headimpact.errors import CalibrationError

Update = Literal["original", "intercept", "recalibration", "refit"]
UPDATES: tuple[Update, ...] = ("original", "intercept", "recalibration", "refit")


@dataclass(frozen=True)
class ChiSquareTest:
    """A likelihood-ratio test."""

    statistic: float
    df: int

    @property
    def p(self) -> float:
        """Of the hypothesis that the simpler model holds."""
        return float(chi2.sf(self.statistic, self.df))

    @property
    def log10_p(self) -> float:
        """The same where it is too small for a number."""
        return float(chi2.logsf(self.statistic, self.df) / np.log(10.0))


def likelihood_ratio_test(ml: LogisticFit) -> ChiSquareTest:
    """A fit against the model without predictors."""
    return ChiSquareTest(max(ml.null_deviance - ml.deviance, 0.0), ml.sample.x.shape[1])


@dataclass(frozen=True)
class ClosedTest:
    """What of an existing model new data reject.

    Parameters
    ----------
    log_likelihoods
        Of the model as it is, with a new intercept, recalibrated by intercept and slope, refitted.
    tests
        Of the refit against the first three: the model as it is (df P + 1), a new intercept (P), a recalibration
        (P - 1; with one predictor the recalibration is the refit, and there is no such test).
    intercept
        What the new intercept adds to the linear predictor.
    recalibration
        Intercept and slope on the linear predictor; None where they cannot be had.
    refit
        The refit.
    chosen
        The simplest that is not rejected.
    """

    log_likelihoods: dict[Update, float]
    tests: dict[Update, ChiSquareTest]
    intercept: float
    recalibration: FloatArray | None
    refit: LogisticFit
    chosen: Update


def closed_test(sample: Sample, linear_predictor: FloatArray, alpha: float = 0.05) -> ClosedTest:
    """Test an existing model on new data.

    Parameters
    ----------
    sample
        The new data: outcomes, and the existing model's predictors.
    linear_predictor
        b0 + b.x of the existing model for each impact, in the usual sign, n.
    alpha
        Level of each test; a closed procedure keeps it over all of them.
    """
    refit = fit(sample)
    if not refit.converged:
        raise CalibrationError("not-converged", "The refit did not settle.")
    moved, _ = shift(sample.y, linear_predictor)
    recalibrated = recalibration(sample.y, linear_predictor)
    deviances: dict[Update, float] = {
        "original": deviance(sample.y, linear_predictor),
        "intercept": deviance(sample.y, linear_predictor + moved),
        "refit": refit.deviance,
    }
    if recalibrated is not None:
        deviances["recalibration"] = recalibrated.deviance
    p = sample.x.shape[1]
    freedoms: dict[Update, int] = {"original": p + 1, "intercept": p, "recalibration": p - 1}
    tests = {
        name: ChiSquareTest(max(deviances[name] - refit.deviance, 0.0), df)
        for name, df in freedoms.items()
        if name in deviances and df > 0
    }
    return ClosedTest(
        {name: -0.5 * deviances[name] for name in UPDATES if name in deviances},
        tests,
        moved,
        None if recalibrated is None else recalibrated.coefficients,
        refit,
        next((name for name in UPDATES if name not in tests or tests[name].p > alpha), "refit"),
    )
