"""How many impacts a refit needs (Riley et al. 2019), and an E:O of some precision."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, exp, log, sqrt

from scipy.stats import norm

from headimpact.errors import CalibrationError


@dataclass(frozen=True)
class SampleSize:
    """The impacts that a model of p predictors needs.

    Parameters
    ----------
    by_shrinkage, by_r_squared, by_intercept
        For a shrinkage of at least 0.9, for an apparent R^2 within 0.05 of the real one, and for the share of events
        within 0.05.
    max_r_squared
        The largest Cox-Snell R^2 that outcomes of this prevalence allow.
    """

    by_shrinkage: int
    by_r_squared: int
    by_intercept: int
    max_r_squared: float
    prevalence: float

    @property
    def impacts(self) -> int:
        """The largest of the three."""
        return max(self.by_shrinkage, self.by_r_squared, self.by_intercept)

    @property
    def events(self) -> float:
        """Events among them."""
        return self.impacts * self.prevalence


def max_cox_snell(prevalence: float) -> float:
    """The largest Cox-Snell R^2 for a share of events."""
    log_likelihood = prevalence * log(prevalence) + (1.0 - prevalence) * log(1.0 - prevalence)
    return 1.0 - exp(2.0 * log_likelihood)


def cox_snell(lr: float, n: int) -> float:
    """Cox-Snell R^2 of a likelihood-ratio statistic on n impacts."""
    return 1.0 - exp(-lr / n)


def riley_sample_size(
    r_squared: float, predictors: int, prevalence: float, shrinkage: float = 0.9, difference: float = 0.05
) -> SampleSize:
    """The impacts that are needed.

    Parameters
    ----------
    r_squared
        The Cox-Snell R^2 to expect.
    predictors
        How many coefficients beside the intercept.
    prevalence
        The share of events.
    shrinkage
        At least how much of the fitted effects should be real.
    difference
        Between apparent and real Nagelkerke R^2, and of the share of events.
    """
    largest = max_cox_snell(prevalence)
    if not 0.0 < r_squared < largest:
        raise CalibrationError("r-squared", f"Cox-Snell R^2 is above 0 and below {largest:.4g} at this prevalence.")
    by_shrinkage = ceil(predictors / ((shrinkage - 1.0) * log(1.0 - r_squared / shrinkage)))
    needed = r_squared / (r_squared + difference * largest)
    by_r_squared = ceil(predictors / ((needed - 1.0) * log(1.0 - r_squared / needed)))
    by_intercept = ceil((1.96 / difference) ** 2 * prevalence * (1.0 - prevalence))
    return SampleSize(by_shrinkage, by_r_squared, by_intercept, largest, prevalence)


def events_for_expected_over_observed(ratio: float = 1.2, level: float = 0.95) -> int:
    """Events until the interval of E:O reaches no further than a ratio: its log's standard error is 1/sqrt(events)."""
    half = log(ratio)
    return ceil((float(norm.ppf(0.5 + level / 2)) / half) ** 2)


def expected_over_observed_half_width(events: int, level: float = 0.95) -> float:
    """By what factor E:O may be off, with that many events."""
    return exp(float(norm.ppf(0.5 + level / 2)) / sqrt(events))
