"""A cohort: impacts with an adjudicated outcome, their athletes, and the values of their criteria."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from headimpact.calibration.logistic import FloatArray, Sample
from headimpact.criteria import BY_KEY, CRITERION_KEYS
from headimpact.errors import CalibrationError

IntArray = NDArray[np.intp]
VECTOR_SIGN = "+"
"""Joins criteria whose components are fitted together."""


@dataclass(frozen=True)
class Cohort:
    """Impacts in an order of their own: whatever order they came in, the same cohort gives the same numbers.

    Parameters
    ----------
    outcome
        1 for a concussion, 0 for none; n.
    athletes
        The athlete of each impact; n.
    criteria
        By key, the values of each impact: n x 1 or n x 3. NaN where an impact lacks the criterion.
    position
        Where each impact stood when it came in; n.
    digest
        SHA-256 of what the cohort holds: athletes, outcomes, values, and ids with revisions where they are known.
    """

    outcome: FloatArray
    athletes: tuple[str, ...]
    criteria: Mapping[str, FloatArray]
    position: IntArray
    digest: str

    @property
    def n(self) -> int:
        """Number of impacts."""
        return int(self.outcome.size)

    @property
    def events(self) -> int:
        """Number of concussions."""
        return int(self.outcome.sum())

    @cached_property
    def clusters(self) -> IntArray:
        """A number from 0 for the athlete of each impact, in the order of the athletes' names; n."""
        return np.unique(np.array(self.athletes, dtype=object).astype(str), return_inverse=True)[1].astype(np.intp)

    @property
    def athlete_count(self) -> int:
        """Number of athletes."""
        return int(self.clusters.max()) + 1 if self.n else 0

    @property
    def athletes_with_events(self) -> int:
        """Number of athletes with a concussion."""
        return int(np.unique(self.clusters[self.outcome == 1.0]).size)

    def predictors(self, name: str) -> FloatArray:
        """The components of a criterion, or of several that are joined by a plus sign, side by side; n x p."""
        return np.concatenate([self.criteria[key] for key in parts_of(name)], axis=1)

    def complete(self, name: str) -> NDArray[np.bool_]:
        """Which impacts have a criterion's value; n."""
        return np.asarray(np.isfinite(self.predictors(name)).all(axis=1))

    def sample(self, name: str) -> Sample:
        """Outcomes and predictors of the impacts that have a criterion's value."""
        rows = self.complete(name)
        return Sample(self.outcome[rows], self.predictors(name)[rows])


def parts_of(name: str) -> list[str]:
    """The keys in a name such as ``"bam"`` or ``"hic15+bric"``."""
    return name.split(VECTOR_SIGN)


def component_names(name: str) -> list[str]:
    """What the coefficients of a criterion are called: value, or x, y, z; of several, by their keys."""
    keys = parts_of(name)
    if len(keys) == 1:
        return ["value"] if BY_KEY[name].components == 1 else ["x", "y", "z"]
    names = []
    for key in keys:
        names += [key] if BY_KEY[key].components == 1 else [f"{key}_{axis}" for axis in "xyz"]
    return names


def make_cohort(
    outcome: FloatArray,
    athletes: Sequence[str],
    criteria: Mapping[str, FloatArray],
    *,
    identities: Sequence[str] = (),
) -> Cohort:
    """Put impacts into the cohort's own order.

    Parameters
    ----------
    outcome
        1 for a concussion, 0 for none; n.
    athletes
        The athlete of each impact; n.
    criteria
        By key, n x 1 or n x 3, NaN where an impact lacks the criterion. An infinite value counts as lacking.
    identities
        What each impact is known by, with its revision, where its source knows that: it enters the digest; n.

    Raises
    ------
    CalibrationError
        There are no impacts, or the parts do not fit together.
    """
    n = len(athletes)
    if n == 0 or outcome.shape != (n,):
        raise CalibrationError("no-impacts", "The cohort has no impacts.")
    if not np.isin(outcome, (0.0, 1.0)).all():
        raise CalibrationError("outcome", "An outcome is 0 or 1.")
    values = {}
    for key in CRITERION_KEYS:
        if key in criteria:
            if criteria[key].shape != (n, BY_KEY[key].components):
                raise CalibrationError("shape", f"{key} has {BY_KEY[key].components} values for each impact.")
            values[key] = np.where(np.isfinite(criteria[key]), criteria[key] + 0.0, np.nan)
    names = np.array(list(athletes), dtype=object).astype(str)
    columns = [values[key][:, i] for key in values for i in range(values[key].shape[1])]
    # np.lexsort sorts by its last key first
    order = np.lexsort((*reversed(columns), outcome, names)).astype(np.intp)
    ordered = {key: np.ascontiguousarray(found[order]) for key, found in values.items()}
    names, sorted_outcome = names[order], np.asarray(outcome, dtype=np.float64)[order]
    return Cohort(
        sorted_outcome,
        tuple(names.tolist()),
        ordered,
        order,
        _digest(names.tolist(), sorted_outcome, ordered, sorted(identities)),
    )


def _digest(
    athletes: Sequence[str], outcome: FloatArray, criteria: Mapping[str, FloatArray], identities: Sequence[str]
) -> str:
    found = hashlib.sha256()
    texts = ("\n".join(athletes).encode(), "\n".join(identities).encode())
    for part in (*texts, outcome.astype("<f8").tobytes()):
        found.update(b"%d:" % len(part) + part)
    for key, values in criteria.items():
        found.update(key.encode() + b":" + values.astype("<f8").tobytes())
    return f"sha256:{found.hexdigest()}"
