"""Recalibration: from a cohort with outcomes to a new version of the risk model, and everything one should know of it.

    >>> from headimpact.calibration import RefitOptions, fitted_model, make_cohort, refit, report_document

Nothing of this is loaded by scoring: the statistics behind it take longer to import than a thousand scores.
"""

from __future__ import annotations

from headimpact.calibration.cohort import Cohort, make_cohort
from headimpact.calibration.options import BIAS_CORRECTIONS, SAMPLINGS, RefitOptions
from headimpact.calibration.refit import Refit, fitted_model, refit
from headimpact.calibration.report_document import report_document

__all__ = [
    "BIAS_CORRECTIONS",
    "SAMPLINGS",
    "Cohort",
    "Refit",
    "RefitOptions",
    "fitted_model",
    "make_cohort",
    "refit",
    "report_document",
]
