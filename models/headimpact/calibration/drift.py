"""Whether a model in service still holds: observed against expected, a risk-adjusted CUSUM, shifts between devices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from headimpact.calibration.logistic import FloatArray
from headimpact.errors import CalibrationError


@dataclass(frozen=True)
class Cusum:
    """A risk-adjusted CUSUM chart (Steiner et al. 2000), in the order of time.

    Parameters
    ----------
    values
        The chart after each impact, n; it never falls below 0.
    limit
        Where it signals.
    odds_ratio
        The change of the odds that it looks for.
    first_signal
        The impact at which it first reaches the limit; None where it does not.
    """

    values: FloatArray
    limit: float
    odds_ratio: float
    first_signal: int | None


def risk_adjusted_cusum(y: FloatArray, p: FloatArray, odds_ratio: float = 2.0, limit: float = 4.5) -> Cusum:
    """Evidence that the odds of the outcome have changed by a factor from what the model says.

    Each impact adds ln[ R^y / (1 - p + R p) ].

    Parameters
    ----------
    y
        Outcomes in the order of time, n.
    p
        What the model says of each, n.
    odds_ratio
        R: above 1 looks for more events than expected, below 1 for fewer.
    limit
        Where to signal; higher means fewer false signals and later ones.
    """
    if odds_ratio <= 0.0 or odds_ratio == 1.0:
        raise CalibrationError("odds-ratio", "An odds ratio is above 0 and not 1.")
    gains = y * np.log(odds_ratio) - np.log1p(p * (odds_ratio - 1.0))
    # max(0, S + W) step by step is the running sum less its lowest value so far
    sums = np.cumsum(gains)
    values = sums - np.minimum(np.minimum.accumulate(sums), 0.0)
    reached = np.flatnonzero(values >= limit)
    return Cusum(values, limit, odds_ratio, int(reached[0]) if reached.size else None)


@dataclass(frozen=True)
class GroupShift:
    """How the linear predictor of a group differs from that of all other impacts.

    Parameters
    ----------
    group
        Its name.
    n
        Impacts in it.
    mean
        Of the linear predictor.
    difference
        Of the means, in standard deviations of all impacts.
    """

    group: str
    n: int
    mean: float
    difference: float


def group_shifts(linear_predictor: FloatArray, groups: Sequence[str]) -> list[GroupShift]:
    """The shift of each group, such as a device's model and firmware; none where there is one group only.

    Parameters
    ----------
    linear_predictor
        Of each impact, n.
    groups
        The group of each impact, n.
    """
    names, member = np.unique(np.asarray(groups, dtype=object).astype(str), return_inverse=True)
    deviation = float(linear_predictor.std())
    if names.size < 2 or deviation == 0.0:
        return []
    shifts = []
    for number, name in enumerate(names.tolist()):
        inside = member == number
        mean, rest = float(linear_predictor[inside].mean()), float(linear_predictor[~inside].mean())
        shifts.append(GroupShift(name, int(inside.sum()), mean, (mean - rest) / deviation))
    return shifts
