"""Risk models as they are answered: curves with their intervals, operating points, and where both come from."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, Field

from headimpact.criteria import BY_KEY
from headimpact.risk import KnownPoint, RiskCurve, RiskModel, critical_values, probability_of
from headimpact.scoring import NORMAL_975
from headimpact_service.store.models import StoredModel


class CriticalValueView(BaseModel):
    """The value of one component that alone gives a probability of one half."""

    axis: str
    value: float | None
    reason: str | None


class CurveView(BaseModel):
    """The logistic curve of one criterion: p = 1/(1 + exp(b0 + b.x))."""

    criterion: str
    name: str
    unit: str
    source: str
    b0: float
    b: list[float]
    intervals: list[list[float]] | None = Field(
        description="95 % intervals of b0 and each of b, where the model was fitted; null of a published one."
    )
    significant: list[bool] = Field(
        description="Which coefficients the source marks as significant at p < 0.05; empty of a fitted one."
    )
    critical_values: list[CriticalValueView]


class ModelPointView(BaseModel):
    """An operating point that the model's source gives, or its cohort shows."""

    sensitivity: float
    specificity: float | None
    threshold: float = Field(description="The probability from which on it is exceeded, at the model's incidence.")
    threshold_interval: list[float | None] = Field(
        description="What the source's rounding leaves open, or the size of the cohort; null for an end that it cannot "
        "bound."
    )
    linear_predictor: float
    linear_predictor_interval: list[float | None]
    axis_intercepts: list[float]
    printed: str


class ModelSummary(BaseModel):
    """A model in the list."""

    version: str
    title: str
    source: str
    population: str
    incidence: float
    basis: Literal["published", "cohort"]
    aliases: list[Literal["active", "candidate"]]
    created_at: datetime | None = Field(description="Null of a published model.")


class MetricsView(BaseModel):
    """How well one criterion did, by the report of the fit."""

    auc: float | None
    auc_interval: list[float | None] | None
    auc_out_of_fold: float | None
    average_precision: float | None
    expected_over_observed: float | None
    calibration_slope_out_of_fold: float | None


class ModelView(ModelSummary):
    """A version of the risk model."""

    probability: str
    cohort: dict[str, Any] = Field(description="What it was fitted on; empty of a published model.")
    curves: list[CurveView]
    operating_points: dict[str, list[ModelPointView]]
    metrics: dict[str, MetricsView] | None = Field(description="By criterion; null where no report is kept here.")
    schedule: str | None = Field(description="The schedule that made it.")
    job: str | None = Field(description="The job that made it.")


class ModelList(BaseModel):
    """A page of the models that the caller can use."""

    data: list[ModelSummary]
    next_cursor: str | None


def summary(model: RiskModel, stored: StoredModel | None, aliases: Mapping[str, str | None]) -> dict[str, Any]:
    """A model in the list; `aliases` says which version each alias means."""
    names = ("version", "title", "source", "population", "incidence", "basis")
    return {
        **{name: getattr(model, name) for name in names},
        "aliases": [alias for alias, version in aliases.items() if version == model.version],
        "created_at": None if stored is None else stored.created_at,
    }


def curve_document(model: RiskModel, key: str) -> dict[str, Any]:
    """The curve of one criterion."""
    curve, criterion = model.curves[key], BY_KEY[key]
    return {
        "criterion": key,
        "name": criterion.name,
        "unit": criterion.unit,
        "source": criterion.source,
        "b0": curve.b0,
        "b": list(curve.b),
        "intervals": _intervals(curve),
        "significant": list(curve.significant),
        "critical_values": [
            {"axis": found.axis, "value": found.value, "reason": found.reason} for found in critical_values(model, key)
        ],
    }


def _intervals(curve: RiskCurve) -> list[list[float]] | None:
    if curve.covariance is None:
        return None
    half = NORMAL_975 * np.sqrt(np.diag(np.array(curve.covariance)))
    values = np.array([curve.b0, *curve.b])
    found: list[list[float]] = np.stack((values - half, values + half), axis=1).tolist()
    return found


def point_document(point: KnownPoint) -> dict[str, Any]:
    """An operating point."""
    low, high = point.linear_predictor_interval
    return {
        "sensitivity": point.sensitivity,
        "specificity": point.specificity,
        "threshold": probability_of(point.linear_predictor),
        "threshold_interval": [None if end is None else probability_of(end) for end in (high, low)],
        "linear_predictor": point.linear_predictor,
        "linear_predictor_interval": [low, high],
        "axis_intercepts": list(point.axis_intercepts),
        "printed": point.printed,
    }


def metrics_of(report: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """The figures of a report that a model is chosen by."""
    if report is None:
        return None
    return {
        name: {
            "auc": one["auc"]["value"],
            "auc_interval": one["auc"]["interval"],
            "auc_out_of_fold": one["out_of_fold"]["auc"],
            "average_precision": one["average_precision"],
            "expected_over_observed": one["calibration"]["expected_over_observed"],
            "calibration_slope_out_of_fold": one["out_of_fold"].get("calibration_slope"),
        }
        for name, one in report["criteria"].items()
    }
