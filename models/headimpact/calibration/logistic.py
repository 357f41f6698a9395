"""Logistic regression by maximum likelihood: one fit, or thousands of resamples of one sample at once.

Newton's method on columns scaled by their standard deviation, with step-halving: without it 8 % of the resamples of a
rare outcome diverge. A resample is a weight per row (how often the row was drawn), so that all of them share the same
rows and one matrix product does the work of a thousand. The sign is the usual one, p = 1/(1 + exp(-(b0 + b.x))).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from headimpact.errors import CalibrationError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Counts = NDArray[np.float64] | NDArray[np.uint16]
"""How often each of n impacts is in each of B resamples, n x B."""

LAST_STEP, LAST_STEP_OF_RESAMPLE = 1e-10, 1e-8
"""Newton stops after a step that moves no scaled coefficient by more: the next would be of the order of its square."""
MAX_CONDITION = 1e14
"""Beyond this the information says nothing of some direction: one in which a separated resample is on its way."""
MAX_ITERATIONS = 60
MAX_HALVINGS = 30
SAFE_CHANGE = 1.79
"""Where (exp(S) - S - 1)/S^2 = 1: up to there a Newton step gains more than it risks (Bach 2010, Proposition 1)."""
# A linear predictor beyond this, at a fit that has not settled, is on its way to infinity.
RUNAWAY = 1e4
# Resamples fitted at once: their probabilities, n x block, stay in the processor's cache.
BLOCK = 32


@dataclass(frozen=True)
class Sample:
    """Outcomes and predictors of n impacts.

    Parameters
    ----------
    y
        Outcome of each impact: 1 for a concussion, 0 for none; n.
    x
        Predictors, n x p: the components of one criterion.

    Raises
    ------
    CalibrationError
        The shapes do not fit, a value is no number, or the outcome is not 0 or 1.
    """

    y: FloatArray
    x: FloatArray

    def __post_init__(self) -> None:
        if self.x.ndim != 2 or self.y.shape != self.x.shape[:1]:
            raise CalibrationError("shape", "Outcomes are n, predictors n x p.")
        if not np.isfinite(self.x).all():
            raise CalibrationError("not-finite", "A predictor is no number.")
        if not np.isin(self.y, (0.0, 1.0)).all():
            raise CalibrationError("outcome", "An outcome is 0 or 1.")

    @property
    def n(self) -> int:
        """Number of impacts."""
        return int(self.y.size)

    @property
    def events(self) -> int:
        """Number of concussions."""
        return int(self.y.sum())

    @cached_property
    def design(self) -> FloatArray:
        """The predictors behind a column of ones, n x k."""
        return np.column_stack((np.ones(self.n), self.x))

    @cached_property
    def scale(self) -> FloatArray:
        """What the design's columns are divided by: 1, and the predictors' standard deviations."""
        deviation = self.x.std(axis=0)
        return np.concatenate(([1.0], np.where(deviation > 0, deviation, 1.0)))


@dataclass(frozen=True)
class LogisticFit:
    """A maximum-likelihood fit.

    Parameters
    ----------
    sample
        What was fitted.
    coefficients
        Intercept and slopes, k.
    covariance
        Inverse of the information at the coefficients, k x k.
    converged
        Whether Newton's method settled.
    iterations
        How many steps it took.
    """

    sample: Sample
    coefficients: FloatArray
    covariance: FloatArray
    converged: bool
    iterations: int

    @cached_property
    def linear_predictor(self) -> FloatArray:
        """b0 + b.x of every impact."""
        found: FloatArray = self.sample.design @ self.coefficients
        return found

    @cached_property
    def probability(self) -> FloatArray:
        """Fitted probability of every impact."""
        return np.asarray(expit(self.linear_predictor))

    @property
    def standard_errors(self) -> FloatArray:
        """Square roots of the covariance's diagonal."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def deviance(self) -> float:
        """-2 ln(L / L_saturated); the saturated likelihood of 0/1 data is 1."""
        return deviance(self.sample.y, self.linear_predictor)

    @property
    def null_deviance(self) -> float:
        """The deviance of the model without predictors."""
        return null_deviance(self.sample.y)


def fit(sample: Sample, weights: FloatArray | None = None) -> LogisticFit:
    """Fit one sample.

    Parameters
    ----------
    sample
        Outcomes and predictors.
    weights
        A weight of each row, n; one each unless given.

    Raises
    ------
    CalibrationError
        There are no events, nothing but events, fewer of either than coefficients, or predictors that are constant or
        repeat each other.
    """
    require_fittable(sample)
    w = np.ones((sample.n, 1)) if weights is None else weights[:, None]
    scaled_design = sample.design / sample.scale
    scaled = _newton(scaled_design, sample.y, w, LAST_STEP)
    beta = scaled.coefficients[:, 0]
    p = risk_of(scaled_design @ beta[:, None])
    information = _Problem(scaled_design, sample.y).information(w * p * (1.0 - p))[0]
    try:
        inverse, settled = np.linalg.inv(information), bool(scaled.converged[0])
    except np.linalg.LinAlgError:  # every probability has run to 0 or 1: the sample is separated
        inverse, settled = np.full_like(information, np.nan), False
    covariance = inverse / np.outer(sample.scale, sample.scale)
    return LogisticFit(sample, beta / sample.scale, covariance, settled, int(scaled.iterations))


def require_fittable(sample: Sample) -> None:
    """Refuse a sample that no slope can be had from, saying what it lacks."""
    if sample.events == 0:
        raise CalibrationError("no-events", "No impact has the outcome concussion.")
    if sample.events == sample.n:
        raise CalibrationError("no-non-events", "Every impact has the outcome concussion.")
    needed, others = sample.design.shape[1], sample.n - sample.events
    if min(sample.events, others) < needed:
        raise CalibrationError(
            "too-few-events",
            f"Concussions: {sample.events}, other impacts: {others}; to fit {needed} coefficients, {needed} of each "
            "are needed at least.",
        )
    constant = np.flatnonzero((sample.x == sample.x[0]).all(axis=0)).tolist()
    if constant:
        of_which = "" if sample.x.shape[1] == 1 else f" number {constant[0] + 1}"
        raise CalibrationError("constant-predictor", f"The predictor{of_which} has one value in every impact.")
    if np.linalg.matrix_rank(sample.design / sample.scale) < sample.design.shape[1]:
        raise CalibrationError("collinear", "The predictors are linear combinations of each other.")


@dataclass(frozen=True)
class Refits:
    """Coefficients of B resamples, k x B, and which of the fits settled."""

    coefficients: FloatArray
    converged: BoolArray


def fit_resamples(sample: Sample, counts: Counts, start: FloatArray | None = None) -> Refits:
    """Fit many resamples of one sample.

    Parameters
    ----------
    sample
        Outcomes and predictors, n of them.
    counts
        How often each row is in each resample, n x B.
    start
        Coefficients to begin from, k: those of the sample itself are near those of its resamples.
    """
    first_guess = None if start is None else start * sample.scale
    design = sample.design / sample.scale
    blocks = [
        _newton(design, sample.y, _floats(counts[:, first : first + BLOCK]), LAST_STEP_OF_RESAMPLE, first_guess)
        for first in range(0, counts.shape[1], BLOCK)
    ]
    coefficients = np.concatenate([block.coefficients for block in blocks], axis=1) / sample.scale[:, None]
    return Refits(coefficients, np.concatenate([block.converged for block in blocks]))


def _floats(counts: Counts) -> FloatArray:
    return np.asarray(counts, dtype=np.float64)


@dataclass(frozen=True)
class _Settled:
    coefficients: FloatArray
    converged: BoolArray
    iterations: int


def _newton(
    design: FloatArray, y: FloatArray, weights: FloatArray, last_step: float, start: FloatArray | None = None
) -> _Settled:
    """Newton's method with step-halving, for every column of weights (n x B) at once."""
    problem = _Problem(design, y)
    beta = _null_coefficients(y, weights, design.shape[1])
    working = np.flatnonzero(np.isfinite(beta[0]))
    if start is not None:
        beta[:, working] = start[:, None]
    converged = np.zeros(weights.shape[1], dtype=bool)
    b, w = beta[:, working], weights[:, working]
    margin = problem.signed @ b
    iterations = 0
    while working.size and iterations < MAX_ITERATIONS:
        iterations += 1
        step, solved, information = problem.step(w, margin)
        settled = solved & (np.abs(step).max(axis=0) <= last_step)
        settled[settled] = np.linalg.cond(information[settled]) < MAX_CONDITION
        change = problem.signed @ step
        _halve(problem, w, margin, step, change)
        b = b + step
        margin += change
        beta[:, working] = b
        converged[working[settled]] = True
        going_on = ~settled & solved & (step != 0.0).any(axis=0) & ~problem.exceeds(b, margin, RUNAWAY)
        if not going_on.all():
            working, b, w, margin = working[going_on], b[:, going_on], w[:, going_on], margin[:, going_on]
    return _Settled(beta, converged, iterations)


def _null_coefficients(y: FloatArray, weights: FloatArray, k: int) -> FloatArray:
    """The fit without predictors; not finite where a resample has no events or nothing else."""
    events, total = y @ weights, weights.sum(axis=0)
    beta = np.zeros((k, weights.shape[1]))
    with np.errstate(divide="ignore"):
        beta[0] = np.log(events / (total - events))
    return beta


def risk_of(eta: FloatArray) -> FloatArray:
    """1/(1 + exp(-eta)), three times as fast as SciPy's `expit`; a linear predictor of -710 and less gives 0."""
    p = np.negative(eta)
    with np.errstate(over="ignore"):
        np.exp(p, out=p)
    p += 1.0
    return np.divide(1.0, p, out=p)


class _Problem:
    """Rows that all replicas share, with what is computed from them once.

    A row counts by its margin: its linear predictor, with the opposite sign where there was no event. The chance of the
    outcome that was not seen is 1/(1 + exp(margin)), and has all its digits however small it is: a separated resample
    sends every margin to infinity, and must not seem to arrive.
    """

    def __init__(self, design: FloatArray, y: FloatArray) -> None:
        self.signed = design * np.where(y == 1.0, 1.0, -1.0)[:, None]
        self.largest = np.abs(design).max(axis=0)
        self.k = design.shape[1]
        self.pairs = rows, columns = np.triu_indices(self.k)
        # the products of each pair of columns: their weighted sums are the information
        self.products = np.ascontiguousarray((design[:, rows] * design[:, columns]).T)

    def step(self, w: FloatArray, margin: FloatArray) -> tuple[FloatArray, BoolArray, FloatArray]:
        """Newton's step of every replica, k x B, whether its equations had a solution, and their matrix, B x k x k."""
        missed = risk_of(-margin)
        spread = w * missed
        gradient = self.signed.T @ spread
        missed *= spread
        spread -= missed
        information = self.information(spread)
        try:
            solved = np.linalg.solve(information, gradient.T[..., None])
        except np.linalg.LinAlgError:
            return *_steps_one_by_one(information, gradient), information
        return np.asarray(solved[..., 0].T, dtype=np.float64), np.ones(solved.shape[0], dtype=bool), information

    def information(self, spread: FloatArray) -> FloatArray:
        """X' W X of every replica, B x k x k, from the weights times the variances of the outcomes."""
        sums = self.products @ spread
        rows, columns = self.pairs
        full = np.empty((sums.shape[1], self.k, self.k))
        full[:, rows, columns] = sums.T
        full[:, columns, rows] = sums.T
        return full

    def exceeds(self, coefficients: FloatArray, margin: FloatArray, limit: float) -> BoolArray:
        """Whether some |margin| = |X b| of a replica is beyond a limit; looked at only where its bound is."""
        found = np.asarray(self.largest @ np.abs(coefficients) > limit)
        for column in np.flatnonzero(found):
            found[column] = np.abs(margin[:, column]).max() > limit
        return found

    @staticmethod
    def log_likelihood(w: FloatArray, margin: FloatArray) -> FloatArray:
        """Of every replica: the sum of -w log(1 + exp(-margin))."""
        lost = np.abs(margin)
        np.negative(lost, out=lost)
        np.exp(lost, out=lost)
        np.log1p(lost, out=lost)
        lost -= np.minimum(margin, 0.0)
        found: FloatArray = -np.einsum("nb,nb->b", w, lost)
        return found


def _steps_one_by_one(information: FloatArray, gradient: FloatArray) -> tuple[FloatArray, BoolArray]:
    """The same where some replica's information is singular."""
    step, solved = np.zeros_like(gradient), np.ones(gradient.shape[1], dtype=bool)
    for column in range(gradient.shape[1]):
        try:
            step[:, column] = np.linalg.solve(information[column], gradient[:, column])
        except np.linalg.LinAlgError:
            solved[column] = False
    return step, solved


def _halve(problem: _Problem, w: FloatArray, margin: FloatArray, step: FloatArray, change: FloatArray) -> None:
    """Halve steps, and the changes of margins that they make, until no likelihood falls; in place.

    A full step that moves no linear predictor by more than :data:`SAFE_CHANGE` cannot lower a logistic likelihood.
    """
    doubtful = np.flatnonzero(problem.exceeds(step, change, SAFE_CHANGE))
    if not doubtful.size:
        return
    before = problem.log_likelihood(w[:, doubtful], margin[:, doubtful])
    before -= 1e-12 * np.abs(before)
    for _ in range(MAX_HALVINGS):
        after = problem.log_likelihood(w[:, doubtful], margin[:, doubtful] + change[:, doubtful])
        falling = ~(after >= before)
        doubtful, before = doubtful[falling], before[falling]
        if not doubtful.size:
            return
        step[:, doubtful] *= 0.5
        change[:, doubtful] *= 0.5


def deviance(y: FloatArray, linear_predictor: FloatArray) -> float:
    """-2 ln(L / L_saturated) of linear predictors for 0/1 outcomes."""
    return float(2.0 * (np.logaddexp(0.0, linear_predictor) - y * linear_predictor).sum())


def null_deviance(y: FloatArray) -> float:
    """The deviance of the model that gives every impact the sample's share of events."""
    n, events = y.size, float(y.sum())
    others = n - events
    return float(-2.0 * sum(count * np.log(count / n) for count in (events, others) if count > 0))
