"""Firth's penalised likelihood (Firth 1993): finite slopes whatever the data, and less bias.

The likelihood is multiplied by the root of the information's determinant. Its scores are those of a likelihood in which
every impact counts 1/2 h_i more for each outcome, h_i being its leverage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import expit
from scipy.stats import chi2

from headimpact.calibration.logistic import BoolArray, FloatArray, Sample, fit, require_fittable
from headimpact.errors import CalibrationError

TOLERANCE = 1e-11
MAX_ITERATIONS = 500
MAX_HALVINGS = 40
MAX_STEPS = 400
# Of a scaled coefficient in one step, so that the likelihood is never asked far from where it was.
LONGEST_STEP = 5.0


class Profile(NamedTuple):
    """Ends of a coefficient's profile interval, and the p value of the hypothesis that it is 0."""

    low: float
    high: float
    p: float


@dataclass(frozen=True)
class FirthFit:
    """A fit by Firth's penalised likelihood.

    Parameters
    ----------
    sample
        What was fitted.
    coefficients
        Intercept and slopes, k.
    penalised_log_likelihood, null
        Its value at the coefficients, and with the intercept alone.
    """

    sample: Sample
    coefficients: FloatArray
    penalised_log_likelihood: float
    null: float

    @cached_property
    def linear_predictor(self) -> FloatArray:
        """b0 + b.x of every impact."""
        found: FloatArray = self.sample.design @ self.coefficients
        return found

    @cached_property
    def covariance(self) -> FloatArray:
        """Inverse of the information of the augmented data, in which an impact counts 1 + h_i, k x k."""
        state = _State.at(self.sample.design / self.sample.scale, self.sample.y, self._scaled)
        inverse = np.linalg.inv(state.information(1.0 + state.leverage))
        return inverse / np.outer(self.sample.scale, self.sample.scale)

    @cached_property
    def information_covariance(self) -> FloatArray:
        """Inverse of the information of the data themselves, k x k."""
        state = _State.at(self.sample.design / self.sample.scale, self.sample.y, self._scaled)
        return np.linalg.inv(state.information()) / np.outer(self.sample.scale, self.sample.scale)

    @property
    def _scaled(self) -> FloatArray:
        return self.coefficients * self.sample.scale

    def profile(self, which: int, level: float = 0.95) -> Profile:
        """A coefficient's profile interval, and the test of the hypothesis that it is 0.

        Parameters
        ----------
        which
            0 for the intercept, then the slopes.
        level
            Of the interval.
        """
        walk = _Walk(_State.at(self.sample.design / self.sample.scale, self.sample.y, self._scaled), which)
        bound = float(chi2.ppf(level, 1))
        low, high = (walk.crossing(bound, side) / float(self.sample.scale[which]) for side in (-1.0, 1.0))
        return Profile(low, high, float(chi2.sf(walk.excess(0.0), 1)))

    @property
    def with_calibrated_intercept(self) -> FloatArray:
        """FLIC: the slopes kept, the intercept such that the mean risk is the sample's share of events."""
        slopes = self.sample.design[:, 1:] @ self.coefficients[1:]
        share = self.sample.events / self.sample.n
        intercept = brentq(
            lambda b0: float(expit(b0 + slopes).mean()) - share, -700.0 - slopes.max(), 700.0 - slopes.min(), xtol=1e-13
        )
        return np.concatenate(([intercept], self.coefficients[1:]))


def fit_firth(sample: Sample) -> FirthFit:
    """Maximise Firth's penalised likelihood.

    An outlier gives it a second, lower hill near 0, so the search begins there and, where there is one, at the maximum
    of the likelihood itself; the higher of what they find is the answer.

    Raises
    ------
    CalibrationError
        There are no events, nothing but events, or predictors that are constant or repeat each other.
    """
    require_fittable(sample)
    design, k = sample.design / sample.scale, sample.design.shape[1]
    found = _highest(design, sample.y, [np.zeros(k), *_without_penalty(sample)])
    # without slopes, the penalty still being that of the whole design
    null = _maximised(design, sample.y, np.zeros(k), np.arange(k) == 0)
    # the information of scaled columns has a determinant smaller by the square of each scale
    unscaled = float(np.log(sample.scale).sum())
    return FirthFit(
        sample,
        found.beta / sample.scale,
        found.penalised_log_likelihood + unscaled,
        null.penalised_log_likelihood + unscaled,
    )


def _without_penalty(sample: Sample) -> list[FloatArray]:
    """The scaled coefficients of maximum likelihood, if there are any."""
    found = fit(sample)
    return [found.coefficients * sample.scale] if found.converged else []


def _highest(design: FloatArray, y: FloatArray, starts: Sequence[FloatArray]) -> _State:
    """The highest of the maxima that searches from some starts find."""
    found: list[_State] = []
    for start in starts:
        try:
            found.append(_maximised(design, y, start, np.ones(start.size, dtype=bool)))
        except CalibrationError:
            if start is starts[-1] and not found:
                raise
    return max(found, key=lambda state: state.penalised_log_likelihood)


@dataclass(frozen=True)
class _State:
    """Everything that the penalised likelihood needs at one set of scaled coefficients."""

    design: FloatArray
    y: FloatArray
    beta: FloatArray
    probability: FloatArray
    weight: FloatArray
    leverage: FloatArray
    penalised_log_likelihood: float

    @classmethod
    def at(cls, design: FloatArray, y: FloatArray, beta: FloatArray) -> _State:
        eta = design @ beta
        p = np.asarray(expit(eta))
        w = p * (1.0 - p)
        information = (design.T * w) @ design
        sign, log_determinant = np.linalg.slogdet(information)
        if sign <= 0:
            return cls(design, y, beta, p, w, np.zeros_like(y), -np.inf)
        half = np.sqrt(w)[:, None] * design
        leverage = np.einsum("ij,ij->i", half, np.linalg.solve(information, half.T).T)
        value = float((y * eta - np.logaddexp(0.0, eta)).sum() + 0.5 * log_determinant)
        return cls(design, y, beta, p, w, leverage, value)

    def information(self, counts: FloatArray | float = 1.0) -> FloatArray:
        """X' W X, with a count for each impact."""
        found: FloatArray = (self.design.T * (self.weight * counts)) @ self.design
        return found

    @property
    def score(self) -> FloatArray:
        """The modified score, X' (y - p + h (1/2 - p))."""
        found: FloatArray = self.design.T @ (self.y - self.probability + self.leverage * (0.5 - self.probability))
        return found


def _maximised(design: FloatArray, y: FloatArray, start: FloatArray, free: BoolArray) -> _State:
    """The maximum over the free coefficients; the others keep their value at the start."""
    state = _State.at(design, y, start)
    for _ in range(MAX_ITERATIONS):
        step = np.zeros_like(start)
        if free.any():
            step[free] = np.linalg.solve(state.information()[np.ix_(free, free)], state.score[free])
        step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), LONGEST_STEP))
        state, moved = _uphill(state, step)
        if np.abs(moved).max() <= TOLERANCE:
            return state
    raise CalibrationError("not-converged", "Firth's likelihood was not maximised within its number of steps.")


def _uphill(state: _State, step: FloatArray) -> tuple[_State, FloatArray]:
    """A step, halved as often as it takes for the penalised likelihood not to fall."""
    slack = 1e-13 * abs(state.penalised_log_likelihood)
    for _ in range(MAX_HALVINGS):
        after = _State.at(state.design, state.y, state.beta + step)
        if after.penalised_log_likelihood >= state.penalised_log_likelihood - slack:
            return after, step
        step = 0.5 * step
    return state, np.zeros_like(step)


class _Walk:
    """The profile of one scaled coefficient, walked along from the maximum: each point is found from its neighbour.

    Far from the maximum the likelihood may have other, lower hills; a search that starts at the maximum itself would
    climb one of them.
    """

    def __init__(self, best: _State, which: int) -> None:
        self.best, self.which = best, which
        self.at = {float(best.beta[which]): best}
        self.step = 0.25 * float(np.sqrt(np.linalg.inv(best.information())[which, which]))

    def excess(self, value: float) -> float:
        """Twice what the penalised likelihood loses where the coefficient is held at a value."""
        nearest = min(self.at, key=lambda known: abs(known - value))
        while abs(nearest - value) > self.step:
            nearest += self.step if value > nearest else -self.step
            self._solve(nearest)
        self._solve(value)
        return max(2.0 * (self.best.penalised_log_likelihood - self.at[value].penalised_log_likelihood), 0.0)

    def _solve(self, value: float) -> None:
        if value not in self.at:
            nearest = min(self.at, key=lambda known: abs(known - value))
            start = self.at[nearest].beta.copy()
            start[self.which] = value
            self.at[value] = _maximised(self.best.design, self.best.y, start, np.arange(start.size) != self.which)

    def crossing(self, bound: float, side: float) -> float:
        """Where the excess reaches a bound, below the maximum (side -1) or above it (+1)."""
        inner = outer = float(self.best.beta[self.which])
        for _ in range(MAX_STEPS):
            outer += side * self.step
            if self.excess(outer) > bound:
                low, high = sorted((inner, outer))
                return float(brentq(lambda value: self.excess(value) - bound, low, high, xtol=1e-10))
            inner = outer
        raise CalibrationError("no-interval", "The profile of a coefficient has no end within reach.")
