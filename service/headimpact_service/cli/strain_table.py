"""Strain regressions of a table with finite-element results: the paper's, on the table's own impacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from headimpact.calibration.strain import StrainRegression, regress_strain
from headimpact.errors import CalibrationError

BY_RESULTANT = ("peak_principal_strain", "csdm15")
BY_AXIS = ("corpus_callosum_strain",)
COLUMNS = (*BY_RESULTANT, *BY_AXIS)
"""What finite-element results are called in a table."""
SAGITTAL = "y"
RESULTANT = "brain_angle_resultant"
"""What the export of impacts calls the largest resultant of the brain angle: not the norm of the axes' own maxima."""

FloatArray = np.ndarray[Any, np.dtype[np.float64]]


def strain_document(
    strains: Mapping[str, FloatArray], bam: FloatArray | None, resultant: FloatArray | None
) -> dict[str, Any] | None:
    """The regressions of the strains that a table has; None where it has none.

    Parameters
    ----------
    strains
        By column, a value for each impact or NaN; n.
    bam
        Peak brain angles by axis [rad], n x 3; None where the table lacks them.
    resultant
        Peak of the resultant brain angle [rad], n x 1; None where the table lacks it.
    """
    if not strains:
        return None
    return {
        name: _regressed(strain, resultant, ["resultant"], RESULTANT)
        if name in BY_RESULTANT
        else _regressed(strain, bam, ["x", "y", "z"], "bam_x, bam_y, bam_z", droppable=[SAGITTAL])
        for name, strain in strains.items()
    }


def _regressed(
    strain: FloatArray, angles: FloatArray | None, names: Sequence[str], columns: str, droppable: Sequence[str] = ()
) -> dict[str, Any]:
    if angles is None:
        return {"reason": f"The table has no brain angles of this kind: {columns}."}
    known = np.isfinite(strain) & np.isfinite(angles).all(axis=1)
    try:
        return _document(regress_strain(strain[known], angles[known], names, droppable=droppable))
    except CalibrationError as error:
        return {"reason": str(error)}


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
