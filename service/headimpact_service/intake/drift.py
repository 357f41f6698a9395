"""Whether the active model still holds on a cohort, in the order of time: for the report of a fit."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import expit

from headimpact.calibration.drift import group_shifts, risk_adjusted_cusum
from headimpact.calibration.rare_events import prior_offset
from headimpact.risk import RiskModel
from headimpact_service.intake.cohorts import Selected
from headimpact_service.store.cohorts import LabelledImpact
from headimpact_service.store.columns import EPOCH
from headimpact_service.store.tables import CRITERION_COLUMNS, VALUE_COLUMNS

REFERENCE = "bam"
_FIRST = VALUE_COLUMNS.index(CRITERION_COLUMNS[REFERENCE][0])


def _in_order_of_time(selected: Selected) -> list[tuple[LabelledImpact, float]]:
    """As the impacts happened, whenever they were sent; those of no known time last, in the order of their ids."""
    pairs = list(zip(selected.impacts, selected.outcomes, strict=True))
    return sorted(pairs, key=lambda pair: (pair[0].occurred_at is None, pair[0].occurred_at or EPOCH, pair[0].id))


def drift_document(selected: Selected, active: RiskModel, tau: float | None) -> dict[str, Any] | None:
    """Observed against expected, a chart of the odds, and shifts between devices; None where nothing can be said.

    The level of a case-control sample is its own share of concussions: the chart then looks for changes within it.
    A full follow-up is held against what the model says as it is, at the model's own incidence.
    """
    if REFERENCE not in active.curves:
        return None
    rows = [
        (impact.values[_FIRST : _FIRST + 3], outcome, impact.device or "")
        for impact, outcome in _in_order_of_time(selected)
        if None not in impact.values[_FIRST : _FIRST + 3]
    ]
    y = np.array([outcome for _, outcome, _ in rows])
    if not rows or not 0 < y.sum() < y.size:
        return None
    curve = active.curves[REFERENCE]
    x = np.array([values for values, _, _ in rows], dtype=np.float64)
    eta = -(curve.b0 + active.incidence_shift(tau) + x @ np.array(curve.b))
    share = float(y.mean())
    if tau is not None:
        eta = eta + prior_offset(share, tau)
    p = expit(eta)
    chart = risk_adjusted_cusum(y, p)
    shifts = group_shifts(eta, [device.strip() or "unknown" for _, _, device in rows])
    return {
        "model": active.version,
        "criterion": REFERENCE,
        "observed": float(y.sum()),
        "expected": float(p.sum()),
        "expected_at": {"level": "model", "incidence": active.incidence}
        if tau is None
        else {"level": "cohort", "incidence": share},
        "cusum": {
            "odds_ratio": chart.odds_ratio,
            "limit": chart.limit,
            "largest": float(chart.values.max()),
            "last": float(chart.values[-1]),
            "signals_after": None if chart.first_signal is None else chart.first_signal + 1,
        },
        "devices": [
            {"device": one.group, "n": one.n, "mean": one.mean, "difference": one.difference} for one in shifts
        ],
    }
