"""Gates: what a fitted model must pass before it may be promoted by itself.

Each is judged on the criteria that alerts are raised from, BAM unless a schedule names others, and says what was
measured, what the bound is, and whether that holds. What cannot be measured does not pass.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import numpy as np
from scipy.special import expit

from headimpact.calibration import Refit
from headimpact.calibration.cohort import component_names
from headimpact.calibration.criterion_refit import CriterionRefit
from headimpact.calibration.discrimination import resampled
from headimpact.calibration.resampling import counts_of_clusters, drawn_with_replacement
from headimpact.errors import OperatingPointUnreachable
from headimpact.risk import OperatingPointRequest, RiskModel, resolve_operating_point

REPLICAS = 500
PANEL_ROWS = 200


@dataclass(frozen=True, slots=True)
class Judged:
    """One gate: what was measured, the bound, whether it holds, and in a sentence why."""

    gate: str
    criterion: str | None
    value: Any
    bound: Any
    passed: bool
    detail: str

    def as_dict(self) -> dict[str, Any]:
        """As reports hold it."""
        return asdict(self)


def judge(found: Refit, model: RiskModel, active: RiskModel, bounds: Mapping[str, Any]) -> list[Judged]:
    """All gates, in an order that a reader can follow; `bounds` are complete, as a schedule keeps them."""
    judged = [_events(found, bounds), _athletes(found, bounds)]
    for name in bounds["criteria"]:
        one = found.criteria.get(name)
        if one is None:
            reason = str(found.failed[name]) if name in found.failed else "It was not fitted."
            judged.append(Judged("fitted", name, None, None, passed=False, detail=reason))
        else:
            judged += _of_criterion(name, one, found, model, active, bounds)
    return judged


def _events(found: Refit, bounds: Mapping[str, Any]) -> Judged:
    events, least = found.cohort.events, bounds["min_events"]
    return Judged("events", None, events, least, events >= least, f"{events} concussions; at least {least} are needed.")


def _athletes(found: Refit, bounds: Mapping[str, Any]) -> Judged:
    athletes, least = found.cohort.athletes_with_events, bounds["min_athletes_with_events"]
    detail = f"{athletes} athletes had a concussion; at least {least} are needed."
    return Judged("athletes_with_events", None, athletes, least, athletes >= least, detail)


def _of_criterion(
    name: str,
    one: CriterionRefit,
    found: Refit,
    model: RiskModel,
    active: RiskModel,
    bounds: Mapping[str, Any],
) -> Iterator[Judged]:
    yield Judged(
        "separation", name, one.separated, None, one.separated is None, "No predictor may separate the outcomes."
    )
    number, most = one.condition_number, bounds["max_condition_number"]
    detail = f"Condition number {number:.3g}; below {most:.3g} is needed."
    yield Judged("condition_number", name, _finite(number), most, number < most, detail)
    yield _lowering(name, one, bounds)
    yield _auc(name, one, found, active, bounds)
    yield _expected(name, one, bounds)
    yield _slope(name, one, bounds)
    yield _panel(name, one, model, active, bounds)
    yield _sensitivity(name, one, model, active, bounds)


def _lowering(name: str, one: CriterionRefit, bounds: Mapping[str, Any]) -> Judged:
    axes = component_names(name)
    lowering = [axes[i] for i in one.lowering]
    waived = set(bounds["waive_lowering"])
    left = [axis for axis in lowering if f"{name}.{axis}" not in waived and name not in waived]
    detail = "No coefficient may lower the risk without a waiver"
    detail += f"; these do: {', '.join(left)}." if left else "."
    return Judged("direction", name, lowering, sorted(waived), not left, detail)


def _auc(name: str, one: CriterionRefit, found: Refit, active: RiskModel, bounds: Mapping[str, Any]) -> Judged:
    """Out of fold against the active model on the same impacts, by resampling athletes."""
    loss = bounds["max_auc_loss"]
    if isinstance(one.out_of_fold, str):
        return Judged("auc", name, None, loss, passed=False, detail=one.out_of_fold)
    if name not in active.curves:
        detail = f"{active.version} has no curve of it to compare with."
        return Judged("auc", name, one.out_of_fold.auc, None, passed=True, detail=detail)
    known = np.isfinite(one.out_of_fold.linear_predictor)
    y, x = one.sample.y[known], one.sample.x[known]
    clusters = np.unique(found.cohort.clusters[one.rows][known], return_inverse=True)[1].astype(np.intp)
    generator = np.random.default_rng(found.options.seed)
    drawn = drawn_with_replacement(int(clusters.max()) + 1, REPLICAS, generator)
    counts = counts_of_clusters(drawn, clusters)
    new = resampled(y, one.out_of_fold.linear_predictor[known], counts).auc
    old = resampled(y, -(x @ np.array(active.curves[name].b)), counts).auc
    differences = (new - old)[np.isfinite(new - old)]
    if differences.size < 2:
        return Judged("auc", name, None, loss, passed=False, detail="Too few athletes to compare.")
    bound = float(np.quantile(differences, 0.025))
    detail = f"Out of fold, the AUC may be lower than that of {active.version} by up to {-bound:.3f} (95 %)."
    return Judged("auc", name, bound, -loss, bound >= -loss, detail + f" {loss:g} is allowed.")


def _expected(name: str, one: CriterionRefit, bounds: Mapping[str, Any]) -> Judged:
    low, high = bounds["expected_over_observed"]
    judged = one.out_of_fold_calibration
    if judged is None:
        return Judged("expected_over_observed", name, None, [low, high], passed=False, detail="Not known out of fold.")
    ends = judged.expected_over_observed_interval()
    detail = f"E:O out of fold lies in {ends[0]:.2f} to {ends[1]:.2f} (95 %), and must meet {low:g} to {high:g}."
    return Judged("expected_over_observed", name, list(ends), [low, high], ends[0] <= high and ends[1] >= low, detail)


def _slope(name: str, one: CriterionRefit, bounds: Mapping[str, Any]) -> Judged:
    low, high = bounds["calibration_slope"]
    judged = one.out_of_fold_calibration
    slope = None if judged is None else judged.slope
    if slope is None:
        return Judged("calibration_slope", name, None, [low, high], passed=False, detail="Not known out of fold.")
    detail = f"The calibration slope out of fold is {slope:.2f}; {low:g} to {high:g} is needed."
    return Judged("calibration_slope", name, slope, [low, high], low <= slope <= high, detail)


def _panel(name: str, one: CriterionRefit, model: RiskModel, active: RiskModel, bounds: Mapping[str, Any]) -> Judged:
    """The largest change of a probability over a frozen grid: quantiles of the cohort's own values."""
    most = bounds["max_panel_change"]
    if name not in active.curves:
        detail = f"{active.version} has no curve of it to compare with."
        return Judged("panel", name, None, most, passed=True, detail=detail)
    panel = np.quantile(one.sample.x, np.linspace(0.0, 1.0, PANEL_ROWS), axis=0)
    change = np.abs(_probability(model, name, panel) - _probability(active, name, panel, model.incidence))
    largest = float(change.max())
    detail = f"Over the range of the cohort a probability changes by up to {largest:.3f}; {most:g} is allowed."
    return Judged("panel", name, largest, most, largest <= most, detail)


def _probability(model: RiskModel, name: str, x: np.ndarray, incidence: float | None = None) -> np.ndarray:
    curve = model.curves[name]
    return np.asarray(expit(-(curve.b0 + model.incidence_shift(incidence) + x @ np.array(curve.b))))


def _sensitivity(
    name: str, one: CriterionRefit, model: RiskModel, active: RiskModel, bounds: Mapping[str, Any]
) -> Judged:
    """The threshold that will be served must alarm as many of the cohort's events as the one served now."""
    wanted = bounds["sensitivity"]
    request = OperatingPointRequest(name, sensitivity=wanted)
    try:
        new = resolve_operating_point(request, model)
    except OperatingPointUnreachable as error:
        return Judged("sensitivity", name, None, wanted, passed=False, detail=str(error))
    events = one.sample.x[one.sample.y == 1.0]
    reached = float((_probability(model, name, events) >= new.threshold * (1 - 1e-9)).mean())
    try:
        old = resolve_operating_point(request, active, model.incidence)
        before = float((_probability(active, name, events, model.incidence) >= old.threshold).mean())
    except OperatingPointUnreachable:
        before = wanted
    point = next((p for p in one.served_thresholds if p.target == wanted), None)
    lowest = before if point is None else min(before, point.sensitivity_interval[1])
    detail = f"At the threshold for {wanted:g}, {reached:.2f} of the cohort's concussions are alarmed; {active.version}"
    detail += f" alarms {before:.2f}."
    return Judged("sensitivity", name, reached, lowest, reached >= lowest - 1e-9, detail)


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None
