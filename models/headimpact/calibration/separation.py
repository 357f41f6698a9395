"""Separation, by a linear programme (Konis 2007): whether a likelihood has a maximum at all.

Iterative fits cannot be trusted to say: they stop at large coefficients and report that they converged. With
s_i = +1 for events and -1 for others, a direction b with s_i x_i.b >= 0 for every impact, and more for one, lets the
likelihood rise for ever.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.optimize import linprog

from headimpact.calibration.logistic import Sample
from headimpact.errors import SeparationError

Kind = Literal["complete", "quasi-complete"]

# The programme's own tolerance is 1e-7; columns are scaled, so that what it calls positive is far above that.
POSITIVE = 1e-6


def separation(sample: Sample) -> Kind | None:
    """Whether the outcome is separated by the predictors, and how; None where it is not.

    Parameters
    ----------
    sample
        Outcomes and predictors.
    """
    centred = sample.design / sample.scale
    centred[:, 1:] -= centred[:, 1:].mean(axis=0)
    signed = np.where(sample.y == 1.0, 1.0, -1.0)[:, None] * centred
    k = signed.shape[1]
    found = linprog(-signed.sum(axis=0), A_ub=-signed, b_ub=np.zeros(sample.n), bounds=[(-1.0, 1.0)] * k)
    margins = signed @ np.asarray(found.x)
    if margins.max() <= POSITIVE:
        return None
    strict = linprog(np.zeros(k), A_ub=-signed, b_ub=-np.ones(sample.n), bounds=[(None, None)] * k)
    return "complete" if strict.success else "quasi-complete"


def require_overlap(sample: Sample) -> None:
    """Refuse a sample that is separated.

    Raises
    ------
    SeparationError
        Its kind says how.
    """
    kind = separation(sample)
    if kind is not None:
        raise SeparationError(kind)
