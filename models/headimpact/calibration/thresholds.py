"""Thresholds on a score: the largest whose sensitivity is still at least what was asked for."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np
from scipy.stats import beta, binom

from headimpact.calibration.discrimination import require_both
from headimpact.calibration.logistic import Counts, FloatArray
from headimpact.errors import CalibrationError

Interval = tuple[float, float]


def clopper_pearson(successes: int, trials: int, level: float = 0.95) -> Interval:
    """The exact interval of a share."""
    rest = (1.0 - level) / 2
    low = 0.0 if successes == 0 else float(beta.ppf(rest, successes, trials - successes + 1))
    high = 1.0 if successes == trials else float(beta.ppf(1.0 - rest, successes + 1, trials - successes))
    return low, high


@dataclass(frozen=True)
class Confusion:
    """Impacts by outcome and alarm."""

    true_positives: int
    false_positives: int
    false_negatives: int
    true_negatives: int

    @property
    def events(self) -> int:
        """Impacts with a concussion."""
        return self.true_positives + self.false_negatives

    @property
    def others(self) -> int:
        """Impacts without one."""
        return self.false_positives + self.true_negatives

    @property
    def sensitivity(self) -> float:
        """Share of events that are alarmed."""
        return self.true_positives / self.events

    @property
    def specificity(self) -> float:
        """Share of others that are passed."""
        return self.true_negatives / self.others

    @property
    def accuracy(self) -> float:
        """Share of impacts that are judged rightly."""
        return (self.true_positives + self.true_negatives) / (self.events + self.others)

    @property
    def precision(self) -> float | None:
        """Share of alarms that are events, in this sample; None where nothing is alarmed."""
        alarms = self.true_positives + self.false_positives
        return self.true_positives / alarms if alarms else None

    @property
    def negative_predictive_value(self) -> float | None:
        """Share of passed impacts without an event, in this sample; None where none is passed."""
        passed = self.true_negatives + self.false_negatives
        return self.true_negatives / passed if passed else None

    def precision_at(self, tau: float) -> float | None:
        """Precision where events are as rare as tau."""
        true, false = self.sensitivity * tau, (1.0 - self.specificity) * (1.0 - tau)
        return true / (true + false) if true + false else None


def confusion(y: FloatArray, score: FloatArray, threshold: float) -> Confusion:
    """Impacts alarmed where score >= threshold."""
    alarmed, event = score >= threshold, y == 1.0
    return Confusion(
        int((alarmed & event).sum()),
        int((alarmed & ~event).sum()),
        int((~alarmed & event).sum()),
        int((~alarmed & ~event).sum()),
    )


def events_needed(sensitivity: float, events: int) -> int:
    """The fewest events that must be alarmed for a sensitivity; a share of 0.9 of 30 events is 27, not 28."""
    return max(1, ceil(sensitivity * events - 1e-9))


def threshold_at(y: FloatArray, score: FloatArray, sensitivity: float) -> float:
    """The largest threshold whose sensitivity is at least the one asked for: an event's score.

    Raises
    ------
    CalibrationError
        The sensitivity is not above 0 and at most 1, or there are no events.
    """
    if not 0.0 < sensitivity <= 1.0:
        raise CalibrationError("sensitivity", "A sensitivity is above 0 and at most 1.")
    require_both(y)
    ranked = np.sort(score[y == 1.0])[::-1]
    return float(ranked[events_needed(sensitivity, ranked.size) - 1])


def resampled_thresholds(y: FloatArray, score: FloatArray, sensitivity: float, counts: Counts) -> FloatArray:
    """The threshold in each resample, B; NaN where a resample has no events.

    Parameters
    ----------
    y, score
        Outcomes and scores, n.
    sensitivity
        What is asked for.
    counts
        How often each impact is in each resample, n x B.
    """
    event = y == 1.0
    order = np.argsort(-score[event], kind="stable")
    ranked, drawn = score[event][order], np.asarray(counts[event][order], dtype=np.float64)
    alarmed, events = np.cumsum(drawn, axis=0), drawn.sum(axis=0)
    needed = np.maximum(1.0, np.ceil(sensitivity * events - 1e-9))
    first = (alarmed >= needed).argmax(axis=0)
    return np.where(events > 0, ranked[first], np.nan)


@dataclass(frozen=True)
class Bounds:
    """A threshold's own interval; an end that the events cannot give is None, with the reason."""

    low: float | None
    high: float | None
    reason: str | None = None


def order_statistic_interval(y: FloatArray, score: FloatArray, sensitivity: float, level: float = 0.95) -> Bounds:
    """The interval of the population's threshold from the ranks of the events' scores, free of any distribution.

    The threshold for a sensitivity s is the (1 - s) quantile of the events' scores. With few events, the lower end
    would lie below all of them: then there is none.
    """
    ranked = np.sort(score[y == 1.0])
    n, share, rest = ranked.size, 1.0 - sensitivity, (1.0 - level) / 2
    # the largest rank r with P(X < r) <= rest, and the smallest with P(X >= r) <= rest, X ~ Bin(n, share)
    ranks = np.arange(1, n + 1)
    below = ranks[binom.cdf(ranks - 1, n, share) <= rest]
    above = ranks[binom.sf(ranks - 1, n, share) <= rest]
    low = float(ranked[below[-1] - 1]) if below.size else None
    high = float(ranked[above[0] - 1]) if above.size else None
    return Bounds(low, high, None if low is not None else _unbounded(sensitivity, n, rest))


def _unbounded(sensitivity: float, events: int, rest: float) -> str:
    """Why a threshold has no lower end."""
    if sensitivity == 1.0:
        return f"No number of events bounds a threshold of 100% sensitivity from below; there are {events}."
    needed = ceil(np.log(rest) / np.log(sensitivity))
    return (
        f"A lower bound of a threshold of {100 * sensitivity:g}% sensitivity needs {needed} events; there are {events}."
    )
