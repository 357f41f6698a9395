"""A risk model as a document: what a refit writes, `headimpact models add` reads, and the service keeps.

Coefficients stand in the usual sign, p = 1/(1 + exp(-(intercept + slopes.x))), at the document's own incidence. (The
science works in the sign of Table 3 of Laksari et al. 2020, which is the opposite.)
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from headimpact.criteria import BY_KEY
from headimpact.errors import ModelDocumentError
from headimpact.risk import KnownPoint, RiskCurve, RiskModel

FORMAT = "headimpact-model/1"
_MEMBERS = frozenset(
    {"format", "version", "title", "source", "population", "incidence", "cohort", "curves", "operating_points"}
)
_TEXTS = ("version", "title", "source", "population")
MAX_TEXT = 2000
MAX_NUMBER = 1e300
"""Squares and sums of larger ones would overflow."""
MAX_VERSION = 100
VERSION = re.compile(rf"[A-Za-z0-9][A-Za-z0-9._-]{{0,{MAX_VERSION - 1}}}")


def model_to_document(model: RiskModel) -> dict[str, Any]:
    """A fitted model as JSON's own types."""
    return {
        "format": FORMAT,
        **{name: getattr(model, name) for name in _TEXTS},
        "incidence": model.incidence,
        "cohort": dict(model.cohort),
        "curves": {key: _curve_to_document(curve) for key, curve in model.curves.items()},
        "operating_points": {
            key: [_point_to_document(point) for point in points] for key, points in model.operating_points.items()
        },
    }


def _curve_to_document(curve: RiskCurve) -> dict[str, Any]:
    return {
        "intercept": -curve.b0,
        "slopes": [-b for b in curve.b],
        "covariance": None if curve.covariance is None else [list(row) for row in curve.covariance],
    }


def _point_to_document(point: KnownPoint) -> dict[str, Any]:
    low, high = point.linear_predictor_interval
    return {
        "sensitivity": point.sensitivity,
        "specificity": point.specificity,
        "linear_predictor": -point.linear_predictor,
        "linear_predictor_interval": [None if high is None else -high, None if low is None else -low],
    }


def model_from_text(text: str | bytes) -> RiskModel:
    """The model of a document's JSON.

    Raises
    ------
    ModelDocumentError
        It is no JSON, or breaks a rule; the message says where.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        raise ModelDocumentError("", "A model's document is JSON.") from None
    return model_from_document(document)


def model_from_document(document: Any) -> RiskModel:  # noqa: ANN401 - anything may be sent
    """The model of a document; every rule is held before anything is used.

    Raises
    ------
    ModelDocumentError
        A rule is broken; the message says where.
    """
    members = _object(document, "", _MEMBERS)
    if members["format"] != FORMAT:
        raise ModelDocumentError("/format", f"The format must be {FORMAT}.")
    texts = {name: _text(members[name], f"/{name}") for name in _TEXTS}
    if VERSION.fullmatch(texts["version"]) is None:
        raise ModelDocumentError("/version", f"A version has 1 to {MAX_VERSION} letters, digits, dots, dashes.")
    incidence = _number(members["incidence"], "/incidence")
    if not 0.0 < incidence < 1.0:
        raise ModelDocumentError("/incidence", "An incidence is above 0 and below 1.")
    curves = _curves(members["curves"])
    return RiskModel(
        **texts,
        incidence=incidence,
        curves=curves,
        operating_points=_operating_points(members["operating_points"], curves),
        basis="cohort",
        cohort=_cohort(members["cohort"]),
    )


def _curves(document: Any) -> dict[str, RiskCurve]:  # noqa: ANN401 - anything may be sent
    if not isinstance(document, Mapping) or not document:
        raise ModelDocumentError("/curves", "At least one criterion's curve is needed.")
    unknown = [key for key in document if key not in BY_KEY]
    if unknown:
        raise ModelDocumentError("/curves", f"Criteria are: {', '.join(BY_KEY)}.")
    return {key: _curve(document[key], key, f"/curves/{key}") for key in BY_KEY if key in document}


def _curve(document: Any, key: str, place: str) -> RiskCurve:  # noqa: ANN401 - anything may be sent
    members = _object(document, place, frozenset({"intercept", "slopes", "covariance"}))
    intercept = _number(members["intercept"], f"{place}/intercept")
    slopes = _numbers(members["slopes"], BY_KEY[key].components, f"{place}/slopes")
    return RiskCurve(
        -intercept, tuple(-b for b in slopes), (), _covariance(members["covariance"], 1 + len(slopes), place)
    )


def _covariance(document: Any, k: int, place: str) -> tuple[tuple[float, ...], ...] | None:  # noqa: ANN401 - anything may be sent
    if document is None:
        return None
    place += "/covariance"
    if not isinstance(document, Sequence) or isinstance(document, str) or len(document) != k:
        raise ModelDocumentError(place, f"A covariance has {k} rows.")
    rows = tuple(tuple(_numbers(row, k, f"{place}/{i}")) for i, row in enumerate(document))
    matrix = np.array(rows)
    scale = np.sqrt(np.outer(np.abs(np.diag(matrix)), np.abs(np.diag(matrix))))
    if (np.diag(matrix) <= 0).any() or (np.abs(matrix - matrix.T) > 1e-9 * scale).any():
        raise ModelDocumentError(place, "A covariance is symmetric, with variances above 0.")
    if np.linalg.eigvalsh(matrix / scale).min() < -1e-9:
        raise ModelDocumentError(place, "A covariance has no negative variance in any direction.")
    return rows


def _operating_points(document: Any, curves: Mapping[str, RiskCurve]) -> dict[str, tuple[KnownPoint, ...]]:  # noqa: ANN401 - anything may be sent
    if not isinstance(document, Mapping):
        raise ModelDocumentError("/operating_points", "Operating points are an object by criterion.")
    unknown = [key for key in document if key not in curves]
    if unknown:
        raise ModelDocumentError("/operating_points", "Operating points belong to criteria with a curve.")
    found = {}
    for key, points in document.items():
        place = f"/operating_points/{key}"
        if not isinstance(points, Sequence) or isinstance(points, str):
            raise ModelDocumentError(place, "Operating points are a list.")
        found[key] = tuple(_point(point, f"{place}/{i}") for i, point in enumerate(points))
    return found


def _point(document: Any, place: str) -> KnownPoint:  # noqa: ANN401 - anything may be sent
    names = {"sensitivity", "specificity", "linear_predictor", "linear_predictor_interval"}
    members = _object(document, place, frozenset(names))
    shares = {name: _share(members[name], f"{place}/{name}") for name in ("sensitivity", "specificity")}
    ends = members["linear_predictor_interval"]
    if not isinstance(ends, Sequence) or isinstance(ends, str) or len(ends) != 2:
        raise ModelDocumentError(f"{place}/linear_predictor_interval", "An interval has two ends, which may be null.")
    low, high = (
        None if end is None else _number(end, f"{place}/linear_predictor_interval/{i}") for i, end in enumerate(ends)
    )
    return KnownPoint(
        sensitivity=shares["sensitivity"],
        linear_predictor=-_number(members["linear_predictor"], f"{place}/linear_predictor"),
        linear_predictor_interval=(None if high is None else -high, None if low is None else -low),
        specificity=shares["specificity"],
    )


def _cohort(document: Any) -> dict[str, Any]:  # noqa: ANN401 - anything may be sent
    if not isinstance(document, Mapping):
        raise ModelDocumentError("/cohort", "The cohort is an object.")
    for name, value in document.items():
        known = value is None or isinstance(value, bool | str)
        if not known and not (isinstance(value, int | float) and -MAX_NUMBER <= value <= MAX_NUMBER):
            raise ModelDocumentError(f"/cohort/{name}", "What is said of the cohort is text, a number or null.")
    return dict(document)


def _object(document: Any, place: str, members: frozenset[str]) -> Mapping[str, Any]:  # noqa: ANN401 - anything may be sent
    if not isinstance(document, Mapping):
        raise ModelDocumentError(place, "An object is needed.")
    missing, unknown = sorted(members - set(document)), sorted(set(document) - members)
    if missing:
        raise ModelDocumentError(f"{place}/{missing[0]}", "This member is required.")
    if unknown:
        raise ModelDocumentError(place, f"Members are: {', '.join(sorted(members))}.")
    return document


def _text(value: Any, place: str) -> str:  # noqa: ANN401 - anything may be sent
    if not isinstance(value, str) or not 0 < len(value) <= MAX_TEXT or not value.isprintable():
        raise ModelDocumentError(place, f"Printable text of 1 to {MAX_TEXT} characters is needed.")
    return value


def _number(value: Any, place: str) -> float:  # noqa: ANN401 - anything may be sent
    if isinstance(value, bool) or not isinstance(value, int | float) or not -MAX_NUMBER <= value <= MAX_NUMBER:
        raise ModelDocumentError(place, "A finite number is needed.")
    return float(value)


def _numbers(value: Any, count: int, place: str) -> list[float]:  # noqa: ANN401 - anything may be sent
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != count:
        raise ModelDocumentError(place, f"A list of {count} numbers is needed.")
    return [_number(part, f"{place}/{i}") for i, part in enumerate(value)]


def _share(value: Any, place: str) -> float:  # noqa: ANN401 - anything may be sent
    found = _number(value, place)
    if not 0.0 <= found <= 1.0:
        raise ModelDocumentError(place, "A share is 0 to 1.")
    return found
