"""Brain strain from finite-element models against the brain angle: the paper's linear regressions, on a cohort's own.

Laksari et al. 2020, Results: peak principal strain and CSDM15 on the resultant angle; corpus-callosum strain on the
angle's components, then without the sagittal one where that is not significant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import statsmodels.api as sm

from headimpact.calibration.logistic import FloatArray
from headimpact.errors import CalibrationError

ALPHA = 0.05


@dataclass(frozen=True)
class StrainRegression:
    """An ordinary least-squares regression.

    Parameters
    ----------
    predictors
        Their names, behind the intercept.
    coefficients, standard_errors, p
        k of each, the intercept's first.
    r_squared
        Share of the variance that is explained.
    n
        Impacts.
    dropped
        Predictors that were left out for not being significant, with the p value that each had.
    """

    predictors: tuple[str, ...]
    coefficients: FloatArray
    standard_errors: FloatArray
    p: FloatArray
    r_squared: float
    n: int
    dropped: dict[str, float]


def regress_strain(
    strain: FloatArray,
    predictors: FloatArray,
    names: Sequence[str],
    droppable: Sequence[str] = (),
    alpha: float = ALPHA,
) -> StrainRegression:
    """Regress a strain on predictors.

    Parameters
    ----------
    strain
        Peak strain or CSDM of each impact, n.
    predictors
        n x p.
    names
        Of the predictors, p.
    droppable
        Those that are left out if they are not significant: the paper's is the sagittal angle, ``"y"``.
    alpha
        Level of significance.

    Raises
    ------
    CalibrationError
        There are fewer impacts than coefficients and one, or a value is no number.
    """
    if predictors.shape != (strain.size, len(names)) or strain.size < len(names) + 2:
        raise CalibrationError("shape", f"At least {len(names) + 2} impacts with {len(names)} predictors are needed.")
    if not (np.isfinite(predictors).all() and np.isfinite(strain).all()):
        raise CalibrationError("not-finite", "A strain or a predictor is no number.")
    kept, dropped = list(names), {}
    found = _least_squares(strain, predictors, names, kept)
    for name in droppable:
        p = float(found.pvalues[1 + kept.index(name)])
        if p > alpha:
            dropped[name] = p
            kept.remove(name)
            found = _least_squares(strain, predictors, names, kept)
    return StrainRegression(
        tuple(kept), found.params, found.bse, found.pvalues, float(found.rsquared), strain.size, dropped
    )


def _least_squares(strain: FloatArray, predictors: FloatArray, names: Sequence[str], kept: Sequence[str]) -> sm.OLS:
    columns = [list(names).index(name) for name in kept]
    return sm.OLS(strain, sm.add_constant(predictors[:, columns], has_constant="add")).fit()
