"""Resamples of a cohort, by impact or by athlete, as counts of each impact: drawn from a seed, or fixed beforehand."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from headimpact.calibration.logistic import FloatArray
from headimpact.errors import CalibrationError

IntArray = NDArray[np.intp]


def counts_of_rows(rows: Iterable[Sequence[int] | IntArray], n: int) -> NDArray[np.uint16]:
    """How often each of n impacts is in each resample, n x B, from the row numbers that were drawn.

    Raises
    ------
    CalibrationError
        A row number is not one of the n.
    """
    columns = []
    for drawn in rows:
        numbers = np.asarray(drawn, dtype=np.intp)
        if numbers.size and not 0 <= numbers.min() <= numbers.max() < n:
            raise CalibrationError("resample", f"Row numbers of resamples are 0 to {n - 1}.")
        columns.append(np.bincount(numbers, minlength=n).astype(np.uint16))
    return np.stack(columns, axis=1) if columns else np.zeros((n, 0), dtype=np.uint16)


def counts_of_clusters(drawn: Iterable[Sequence[int] | IntArray], clusters: IntArray) -> NDArray[np.uint16]:
    """The same where whole athletes were drawn, each with all impacts.

    Parameters
    ----------
    drawn
        Numbers of the athletes in each resample.
    clusters
        The number of each impact's athlete, n.
    """
    found: NDArray[np.uint16] = counts_of_rows(drawn, int(clusters.max()) + 1)[clusters]
    return found


def too_few_clusters(y: FloatArray, clusters: IntArray) -> str | None:
    """Why resamples by athlete say nothing of a cohort; None where they do.

    With all events of one athlete, every resample has those events or none: what they have in common looks certain.

    Parameters
    ----------
    y
        Outcomes, n.
    clusters
        The number of each impact's athlete, n.
    """
    injured, others = np.unique(clusters[y == 1.0]).size, np.unique(clusters[y == 0.0]).size
    if min(injured, others) >= 2:
        return None
    return (
        "Resampling athletes needs at least two with a concussion, and two with another impact; there are "
        f"{injured} and {others}."
    )


def drawn_with_replacement(count: int, replicas: int, generator: np.random.Generator) -> Iterator[IntArray]:
    """Numbers below `count`, as many of them in each bootstrap resample: of impacts, or of athletes."""
    for _ in range(replicas):
        yield generator.integers(0, count, size=count, dtype=np.intp)


def percentile_interval(values: FloatArray, level: float = 0.95) -> tuple[float, float] | None:
    """Percentiles of the replicas that have a value (R's type 7); None where fewer than two do."""
    known = values[np.isfinite(values)]
    if known.size < 2:
        return None
    low, high = np.quantile(known, [(1.0 - level) / 2, (1.0 + level) / 2])
    return float(low), float(high)
