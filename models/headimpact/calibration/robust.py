"""Covariances that allow for impacts of one athlete being alike: cluster-robust sandwiches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from headimpact.calibration.logistic import FloatArray, LogisticFit
from headimpact.errors import CalibrationError


@dataclass(frozen=True)
class ClusteredCovariance:
    """Sandwich covariances of a fit with clusters.

    Parameters
    ----------
    hc0
        Without any factor, k x k.
    clusters
        G, how many clusters there are.
    """

    hc0: FloatArray
    clusters: int
    n: int

    @property
    def adjusted(self) -> FloatArray:
        """Times G/(G - 1)."""
        found: FloatArray = self.hc0 * (self.clusters / (self.clusters - 1))
        return found

    @property
    def hc1(self) -> FloatArray:
        """Times G/(G - 1) (n - 1)/(n - k)."""
        found: FloatArray = self.adjusted * ((self.n - 1) / (self.n - self.hc0.shape[0]))
        return found


def sandwich(ml: LogisticFit, weights: FloatArray) -> FloatArray:
    """White's covariance of a weighted fit (HC0), k x k.

    Weights say how much an impact counts, not how often it was seen.

    Parameters
    ----------
    ml
        The weighted fit.
    weights
        Of its impacts, n.
    """
    scores = ml.sample.design * (weights * (ml.sample.y - ml.probability))[:, None]
    found: FloatArray = ml.covariance @ (scores.T @ scores) @ ml.covariance
    return found


def cluster_robust(ml: LogisticFit, clusters: NDArray[np.intp]) -> ClusteredCovariance:
    """The sandwich of a maximum-likelihood fit, scores summed by cluster.

    Parameters
    ----------
    ml
        The fit.
    clusters
        A number from 0 for the cluster of each impact, n.

    Raises
    ------
    CalibrationError
        There is one cluster only.
    """
    count = int(clusters.max()) + 1
    if count < 2:
        raise CalibrationError("one-cluster", "Impacts of at least two athletes are needed.")
    scores = ml.sample.design * (ml.sample.y - ml.probability)[:, None]
    sums = np.zeros((count, scores.shape[1]))
    np.add.at(sums, clusters, scores)
    return ClusteredCovariance(ml.covariance @ (sums.T @ sums) @ ml.covariance, count, ml.sample.n)
