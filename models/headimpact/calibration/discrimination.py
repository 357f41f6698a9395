"""How well scores tell events from other impacts: the ROC and precision-recall curves and their areas.

A score is any number that is higher where the risk is; an impact counts as alarmed where score >= threshold. AUC is the
share of pairs of an event and another impact in which the event scores higher, ties counting one half.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, rankdata

from headimpact.calibration.logistic import BoolArray, Counts, FloatArray
from headimpact.errors import CalibrationError

# Resamples judged at once.
BLOCK = 128


def require_both(y: FloatArray) -> None:
    """Refuse outcomes of one kind: there is nothing to tell apart."""
    if not 0 < y.sum() < y.size:
        raise CalibrationError("one-outcome", "Impacts with and without concussion are needed.")


@dataclass(frozen=True)
class Auc:
    """Area under the ROC curve, with DeLong's structural components (DeLong, DeLong & Clarke-Pearson 1988).

    Parameters
    ----------
    value
        The area.
    of_events, of_others
        For each event the share of others that it beats, and for each other impact the share of events that beat it.
    """

    value: float
    of_events: FloatArray
    of_others: FloatArray

    @property
    def variance(self) -> float:
        """DeLong's variance of the area; NaN where there is a single event or other impact."""
        return _delong(self, self)

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """The normal interval, cut to 0 and 1."""
        half = float(norm.ppf(0.5 + level / 2)) * float(np.sqrt(self.variance))
        return max(self.value - half, 0.0), min(self.value + half, 1.0)

    def clustered_variance(self, y: FloatArray, clusters: NDArray[np.intp]) -> float:
        """Variance where impacts of one athlete are alike (Obuchowski 1997).

        NaN where fewer than two athletes have events, or fewer than two have others.

        Parameters
        ----------
        y
            Outcomes, n.
        clusters
            A number from 0 for the athlete of each impact, n.
        """
        count = int(clusters.max()) + 1
        events, others = clusters[y == 1.0], clusters[y == 0.0]
        n1, n0 = np.bincount(events, minlength=count), np.bincount(others, minlength=count)
        sum1 = np.bincount(events, self.of_events, count) - n1 * self.value
        sum0 = np.bincount(others, self.of_others, count) - n0 * self.value
        with1, with0 = np.count_nonzero(n1), np.count_nonzero(n0)
        if min(with1, with0) < 2:
            return float("nan")
        m1, m0 = n1.sum(), n0.sum()
        s11 = with1 / (with1 - 1) * float(sum1 @ sum1) / m1**2
        s00 = with0 / (with0 - 1) * float(sum0 @ sum0) / m0**2
        s10 = count / (count - 1) * float(sum1 @ sum0) / (m1 * m0)
        return float(s11 + s00 + 2.0 * s10)


def auc(y: FloatArray, score: FloatArray) -> Auc:
    """The area under the ROC curve.

    Parameters
    ----------
    y
        Outcomes, n.
    score
        Scores, n.
    """
    require_both(y)
    event = y == 1.0
    n1, n0 = int(event.sum()), int((~event).sum())
    ranks = rankdata(score)
    of_events = (ranks[event] - rankdata(score[event])) / n0
    of_others = 1.0 - (ranks[~event] - rankdata(score[~event])) / n1
    value = (float(ranks[event].sum()) - n1 * (n1 + 1) / 2) / (n1 * n0)
    return Auc(value, of_events, of_others)


def _delong(first: Auc, second: Auc) -> float:
    """DeLong's covariance of two areas on the same impacts."""
    n1, n0 = first.of_events.size, first.of_others.size
    if n1 < 2 or n0 < 2:
        return float("nan")
    s1 = float((first.of_events - first.value) @ (second.of_events - second.value)) / (n1 - 1)
    s0 = float((first.of_others - first.value) @ (second.of_others - second.value)) / (n0 - 1)
    return s1 / n1 + s0 / n0


@dataclass(frozen=True)
class DeLongTest:
    """DeLong's paired test of two areas: their difference, its variance, and the test that it is 0."""

    difference: float
    covariance: float
    variance: float

    @property
    def z(self) -> float:
        """The difference over its standard error; 0 for scores that order the impacts alike."""
        if self.variance <= 0.0:
            return 0.0
        return self.difference / float(np.sqrt(self.variance))

    @property
    def p(self) -> float:
        """Two-sided."""
        return float(2.0 * norm.sf(abs(self.z)))

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Of the difference."""
        half = float(norm.ppf(0.5 + level / 2)) * float(np.sqrt(max(self.variance, 0.0)))
        return self.difference - half, self.difference + half


def delong_test(first: Auc, second: Auc) -> DeLongTest:
    """Compare two areas on the same impacts."""
    covariance = _delong(first, second)
    variance = first.variance + second.variance - 2.0 * covariance
    same = np.array_equal(first.of_events, second.of_events) and np.array_equal(first.of_others, second.of_others)
    return DeLongTest(first.value - second.value, covariance, 0.0 if same else variance)


@dataclass(frozen=True)
class Curve:
    """Counts at every threshold, the highest score first: what both curves are drawn from.

    Parameters
    ----------
    thresholds
        The different scores, falling.
    hits, false_alarms
        Events and other impacts that score at least each threshold.
    events, others
        How many there are in all.
    """

    thresholds: FloatArray
    hits: FloatArray
    false_alarms: FloatArray
    events: float
    others: float

    @cached_property
    def sensitivity(self) -> FloatArray:
        """Share of events that are alarmed: recall."""
        return self.hits / self.events

    @cached_property
    def false_alarm_rate(self) -> FloatArray:
        """Share of other impacts that are alarmed: 1 - specificity."""
        return self.false_alarms / self.others

    def precision(self, tau: float | None = None) -> FloatArray:
        """Share of alarms that are events: in the sample, or at an incidence tau."""
        if tau is None:
            return self.hits / (self.hits + self.false_alarms)
        true, false = self.sensitivity * tau, self.false_alarm_rate * (1.0 - tau)
        found: FloatArray = true / (true + false)
        return found

    def average_precision(self, tau: float | None = None) -> float:
        """The sum of precision times the gain in recall, over the thresholds; at an incidence tau if given."""
        gains = np.diff(self.sensitivity, prepend=0.0)
        return float((gains * self.precision(tau)).sum())

    def precision_recall_trapezoid(self, first: float | None = None) -> float:
        """Area under the precision-recall curve by trapezoids.

        Precision is not defined where nothing is alarmed. Without `first` that point is left out, as MATLAB's perfcurve
        does and so the paper; otherwise the curve begins at recall 0 with that precision.
        """
        recall, precision = self.sensitivity, self.precision()
        if first is not None:
            recall, precision = np.append(0.0, recall), np.append(first, precision)
        return float(np.trapezoid(precision, recall))

    def precision_recall_integral(self) -> float:
        """Area with hits and false alarms interpolated between the thresholds, in closed form.

        (Davis & Goadrich 2006; Keilwagen, Grosse & Grau 2014.) On the way from one threshold to the next, impacts of
        both kinds are alarmed in the proportion in which they lie between them.
        """
        gain, slope, at_start, hits_before = self._segments
        rest = hits_before - at_start / slope
        with np.errstate(divide="ignore", invalid="ignore"):
            bent = np.where(at_start > 0, rest / slope * np.log1p(slope * gain / at_start), 0.0)
        return float((gain / slope + bent).sum() / self.events)

    def precision_at(self, recall: FloatArray) -> FloatArray:
        """Precision on the interpolated curve at recalls of 0 to 1; the highest where it falls straight down."""
        gain, slope, at_start, hits_before = self._segments
        hits = np.asarray(recall) * self.events
        segment = np.clip(np.searchsorted(hits_before, hits * (1 - 1e-15), side="left") - 1, 0, gain.size - 1)
        alarms = at_start[segment] + slope[segment] * (hits - hits_before[segment])
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(alarms > 0, hits / alarms, 1.0 / slope[0])

    @cached_property
    def _segments(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Where hits are gained: how many, alarms per hit, and alarms and hits at the start."""
        hits, alarms = np.append(0.0, self.hits), np.append(0.0, self.hits + self.false_alarms)
        moving = np.diff(hits) > 0
        gain = np.diff(hits)[moving]
        return gain, np.diff(alarms)[moving] / gain, alarms[:-1][moving], hits[:-1][moving]


def curve(y: FloatArray, score: FloatArray, weights: FloatArray | None = None) -> Curve:
    """The counts at every threshold.

    Parameters
    ----------
    y
        Outcomes, n.
    score
        Scores, n.
    weights
        How often each impact counts; once unless given.
    """
    require_both(y)
    order = np.argsort(-score, kind="stable")
    ranked, counts = score[order], np.ones(y.size) if weights is None else weights[order]
    last = np.append(ranked[1:] != ranked[:-1], True)
    hits = np.cumsum(counts * y[order])
    false_alarms = np.cumsum(counts * (1.0 - y[order]))
    return Curve(ranked[last], hits[last], false_alarms[last], float(hits[-1]), float(false_alarms[-1]))


@dataclass(frozen=True)
class Resampled:
    """AUC and average precision of one score in B resamples; NaN where a resample lacks events or other impacts."""

    auc: FloatArray
    average_precision: FloatArray


def resampled(y: FloatArray, score: FloatArray, counts: Counts) -> Resampled:
    """Both areas in many resamples at once: the impacts are ordered once, and counted B times.

    Parameters
    ----------
    y
        Outcomes, n.
    score
        Scores, n.
    counts
        How often each impact is in each resample, n x B.
    """
    order = np.argsort(-score, kind="stable")
    last = np.flatnonzero(np.append(np.diff(score[order]) != 0.0, True))
    event = y[order][:, None] == 1.0
    blocks = [
        _areas(event, last, np.asarray(counts[order, first : first + BLOCK], dtype=np.float64))
        for first in range(0, counts.shape[1], BLOCK)
    ]
    return Resampled(*(np.concatenate(part) for part in zip(*blocks, strict=True)))


def _areas(event: BoolArray, last: NDArray[np.intp], drawn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both areas of impacts in falling order of score, drawn so often each; `last` of each score."""
    hits = np.cumsum(np.where(event, drawn, 0.0), axis=0)[last]
    alarms = np.cumsum(drawn, axis=0)[last]
    gained = np.diff(hits, axis=0, prepend=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        average = (gained * np.where(alarms > 0, hits / alarms, 0.0)).sum(axis=0) / hits[-1]
        false = alarms - hits
        # an event beats the others below it, and half of those that tie with it
        below = false[-1] - 0.5 * (false + np.vstack((np.zeros((1, false.shape[1])), false[:-1])))
        area = (gained * below).sum(axis=0) / (hits[-1] * false[-1])
    return area, np.where(np.isfinite(area), average, np.nan)


def is_usable(y: FloatArray, counts: Counts) -> BoolArray:
    """Which resamples hold events and other impacts, B."""
    events, total = y @ counts, counts.sum(axis=0)
    found: BoolArray = (events > 0) & (events < total)
    return found
