"""Risk models: their curves, their operating points, and where both come from."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field
from starlette.responses import Response

from headimpact.criteria import BY_KEY
from headimpact.errors import UnknownModel
from headimpact.risk import PUBLISHED_MODELS, KnownPoint, RiskModel, critical_values, load_model, probability_of
from headimpact_service.answers import answer
from headimpact_service.errors import not_found
from headimpact_service.operation import Answer, Call, Routes

routes = Routes("models")


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
    significant: list[bool] = Field(description="Which coefficients the source marks as significant at p < 0.05.")
    critical_values: list[CriticalValueView]


class ModelPointView(BaseModel):
    """An operating point that the model's source gives."""

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


class ModelView(BaseModel):
    """A version of the risk model."""

    version: str
    title: str
    source: str
    population: str
    incidence: float
    probability: str
    curves: list[CurveView]
    operating_points: dict[str, list[ModelPointView]]


class ModelSummary(BaseModel):
    """A model in the list."""

    version: str
    title: str
    source: str
    population: str
    incidence: float


class ModelList(BaseModel):
    """Every model that the caller can use."""

    data: list[ModelSummary]
    next_cursor: None


@routes("GET", "/v1/models", "List risk models", "models:read", {200: Answer(ModelList, "All models, on one page.")})
async def list_models(call: Call) -> Response:  # noqa: ARG001 - the shape of a handler
    """The published ones."""
    return answer({"data": [_summary(model) for model in PUBLISHED_MODELS.values()], "next_cursor": None})


@routes(
    "GET",
    "/v1/models/{version}",
    "Read a risk model",
    "models:read",
    {200: Answer(ModelView, "The model.")},
    problems=("not-found",),
)
async def read_model(call: Call) -> Response:
    """Coefficients, operating points with their intervals, and the source of both."""
    try:
        model = load_model(call.path("version"))
    except UnknownModel:
        raise not_found("model") from None
    return answer(document(model))


def _summary(model: RiskModel) -> dict[str, Any]:
    names = ("version", "title", "source", "population", "incidence")
    return {name: getattr(model, name) for name in names}


def document(model: RiskModel) -> dict[str, Any]:
    """A model as it is answered."""
    return {
        **_summary(model),
        "probability": "p = 1/(1 + exp(b0 + b.x))",
        "curves": [_curve(model, key) for key in model.curves],
        "operating_points": {
            key: [_point(point) for point in points] for key, points in model.operating_points.items()
        },
    }


def _curve(model: RiskModel, key: str) -> dict[str, Any]:
    curve, criterion = model.curves[key], BY_KEY[key]
    return {
        "criterion": key,
        "name": criterion.name,
        "unit": criterion.unit,
        "source": criterion.source,
        "b0": curve.b0,
        "b": list(curve.b),
        "significant": list(curve.significant),
        "critical_values": [
            {"axis": found.axis, "value": found.value, "reason": found.reason} for found in critical_values(model, key)
        ],
    }


def _point(point: KnownPoint) -> dict[str, Any]:
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
