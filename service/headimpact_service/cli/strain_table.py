"""Strain regressions of a table with finite-element results: the paper's, on the table's own impacts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from headimpact.calibration.strain import StrainRegression, regress_strain
from headimpact.errors import CalibrationError

BY_RESULTANT = ("peak_principal_strain", "csdm15")
BY_AXIS = ("corpus_callosum_strain",)
COLUMNS = (*BY_RESULTANT, *BY_AXIS)
"""What finite-element results are called in a table."""
SAGITTAL = "y"

FloatArray = np.ndarray[Any, np.dtype[np.float64]]


def strain_document(strains: Mapping[str, FloatArray], bam: FloatArray | None) -> dict[str, Any] | None:
    """The regressions of the strains that a table has; None where it has none.

    Parameters
    ----------
    strains
        By column, a value for each impact or NaN; n.
    bam
        Peak brain angles by axis [rad], n x 3; None where the table lacks them. Their resultant stands for the peak of
        the resultant, which no table of criteria has.
    """
    if not strains:
        return None
    if bam is None:
        return {name: {"reason": "The table has no brain angles: bam_x, bam_y, bam_z."} for name in strains}
    return {name: _regressed(name, strain, bam) for name, strain in strains.items()}


def _regressed(name: str, strain: FloatArray, bam: FloatArray) -> dict[str, Any]:
    known = np.isfinite(strain) & np.isfinite(bam).all(axis=1)
    x = bam[known]
    try:
        if name in BY_RESULTANT:
            found = regress_strain(strain[known], np.linalg.norm(x, axis=1, keepdims=True), ["resultant"])
        else:
            found = regress_strain(strain[known], x, ["x", "y", "z"], droppable=[SAGITTAL])
    except CalibrationError as error:
        return {"reason": str(error)}
    return _document(found)


def _document(found: StrainRegression) -> dict[str, Any]:
    names = ["intercept", *found.predictors]
    return {
        "n": found.n,
        "coefficients": dict(zip(names, found.coefficients.tolist(), strict=True)),
        "standard_errors": dict(zip(names, found.standard_errors.tolist(), strict=True)),
        "p": dict(zip(names, found.p.tolist(), strict=True)),
        "r_squared": found.r_squared,
        "dropped": found.dropped,
    }
