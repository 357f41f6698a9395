"""Risk models: from criteria to concussion probabilities, operating points, and the shift to another incidence.

The published coefficients are used as p = 1/(1 + exp(e)) with the linear predictor e = b0 + b.x: the opposite of the
usual sign, as Table 3 of Laksari et al. 2020 prints them (docs/misprints.md, 1). A larger e is a smaller risk.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from math import exp, log
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from headimpact.criteria import BY_KEY, CRITERION_KEYS
from headimpact.errors import OperatingPointUnreachable, UnknownModel
from headimpact.published import data_file

FloatArray = NDArray[np.float64]

# Two sensitivities or specificities are the same published point when they agree to the digits that are printed.
PRINTED_DIGITS = 3


@dataclass(frozen=True, slots=True)
class RiskCurve:
    """One criterion's logistic curve: p = 1/(1 + exp(b0 + b.x)).

    Parameters
    ----------
    b0
        Intercept at the model's own incidence.
    b
        One coefficient per component of the criterion, per its unit.
    significant
        Whether the source marks each coefficient as significant at p < 0.05.
    covariance
        Of intercept and coefficients, k x k, where the curve was fitted to a cohort; sources publish none.
    """

    b0: float
    b: tuple[float, ...]
    significant: tuple[bool, ...] = ()
    covariance: tuple[tuple[float, ...], ...] | None = None


@dataclass(frozen=True, slots=True)
class KnownPoint:
    """An operating point that a source gives or a cohort shows, by its linear predictor at the model's own incidence.

    Of an interval's ends, one that a cohort is too small to bound is None.
    """

    sensitivity: float
    linear_predictor: float
    linear_predictor_interval: tuple[float | None, float | None]
    specificity: float | None = None
    axis_intercepts: tuple[float, ...] = ()
    printed: str = ""


@dataclass(frozen=True)
class RiskModel:
    """A version of the risk model: one curve per criterion, and the operating points known for it."""

    version: str
    title: str
    source: str
    population: str
    incidence: float
    curves: Mapping[str, RiskCurve]
    operating_points: Mapping[str, tuple[KnownPoint, ...]] = field(default_factory=dict)
    basis: Literal["published", "cohort"] = "published"
    cohort: Mapping[str, Any] = field(default_factory=dict)
    """What a fitted model was fitted on: impacts, events, athletes, digest, sampling, bias correction."""

    @cached_property
    def coefficients(self) -> tuple[FloatArray, FloatArray]:
        """Intercepts (13) and coefficients (13 x 3, zero where a criterion has one component), in CRITERIA's order."""
        b0 = np.full(len(CRITERION_KEYS), np.nan)
        b = np.zeros((len(CRITERION_KEYS), 3))
        for row, key in enumerate(CRITERION_KEYS):
            curve = self.curves.get(key)
            if curve is not None:
                b0[row] = curve.b0
                b[row, : len(curve.b)] = curve.b
        return b0, b

    @cached_property
    def covariances(self) -> FloatArray | None:
        """Of intercepts and coefficients, 13 x 4 x 4 in CRITERIA's order, NaN without one; None if no curve has one."""
        if all(curve.covariance is None for curve in self.curves.values()):
            return None
        found = np.full((len(CRITERION_KEYS), 4, 4), np.nan)
        for row, key in enumerate(CRITERION_KEYS):
            curve = self.curves.get(key)
            if curve is not None and curve.covariance is not None:
                found[row] = 0.0
                k = len(curve.covariance)
                found[row, :k, :k] = curve.covariance
        return found

    def incidence_shift(self, incidence: float | None) -> float:
        """What is added to every linear predictor to serve another incidence (King & Zeng 2001, prior correction)."""
        if incidence is None or incidence == self.incidence:
            return 0.0
        return log((1.0 - incidence) / incidence) - log((1.0 - self.incidence) / self.incidence)


def probability_of(linear_predictor: float) -> float:
    """p = 1/(1 + exp(e)), without overflow."""
    if linear_predictor > 0:
        decayed = exp(-linear_predictor)
        return decayed / (1.0 + decayed)
    return 1.0 / (1.0 + exp(linear_predictor))


def linear_predictor_of(probability: float) -> float:
    """e such that p = 1/(1 + exp(e))."""
    return log((1.0 - probability) / probability)


def load_model(version: str) -> RiskModel:
    """A published model by its version.

    Raises
    ------
    UnknownModel
        No published model has that version.
    """
    try:
        return PUBLISHED_MODELS[version]
    except KeyError:
        raise UnknownModel(f"There is no model with version {version!r}.") from None


def _read_model(name: str) -> RiskModel:
    data = data_file(name)
    return RiskModel(
        version=data["version"],
        title=data["title"],
        source=data["source"],
        population=data["population"],
        incidence=data["incidence"],
        curves={key: RiskCurve(c["b0"], tuple(c["b"]), tuple(c["significant"])) for key, c in data["curves"].items()},
        operating_points={
            key: tuple(_read_point(point) for point in points) for key, points in data["operating_points"].items()
        },
    )


def _read_point(data: dict[str, Any]) -> KnownPoint:
    low, high = data["linear_predictor_interval"]
    return KnownPoint(
        sensitivity=data["sensitivity"],
        linear_predictor=data["linear_predictor"],
        linear_predictor_interval=(low, high),
        specificity=data.get("specificity"),
        axis_intercepts=tuple(data["axis_intercepts_rad"]),
        printed=data["printed"],
    )


LAKSARI_2020 = _read_model("laksari_2020")
PUBLISHED_MODELS: dict[str, RiskModel] = {LAKSARI_2020.version: LAKSARI_2020}


@dataclass(frozen=True, slots=True)
class OperatingPointRequest:
    """An operating point to be found: a criterion and exactly one of sensitivity, specificity and threshold."""

    criterion: str
    sensitivity: float | None = None
    specificity: float | None = None
    threshold: float | None = None

    @property
    def requested(self) -> dict[str, float]:
        """The one quantity that is asked for."""
        asked = {
            "sensitivity": self.sensitivity,
            "specificity": self.specificity,
            "threshold": self.threshold,
        }
        return {name: value for name, value in asked.items() if value is not None}


DEFAULT_OPERATING_POINTS = (
    OperatingPointRequest("bam", sensitivity=0.5),
    OperatingPointRequest("bam", sensitivity=0.9),
)


@dataclass(frozen=True, slots=True)
class OperatingPoint:
    """A threshold on a criterion's probability, and how sure it is.

    `basis` is ``published``, ``interpolated`` (linear in the linear predictor between published sensitivities),
    ``cohort`` or ``requested``. `threshold_interval` is what the source's rounding leaves open, or what a cohort of its
    size leaves open at 95 %; an end is None where the cohort has too few events to bound it. It is None where nothing
    is known of it: of a requested threshold, and of a cohort's specificity, since the interval of a cohort's point is
    that of its sensitivity, of which the events decide.
    """

    request: OperatingPointRequest
    threshold: float
    threshold_interval: tuple[float | None, float | None] | None
    sensitivity: float | None
    specificity: float | None
    basis: str


def resolve_operating_point(
    request: OperatingPointRequest, model: RiskModel, incidence: float | None = None
) -> OperatingPoint:
    """Find the threshold that a request means under a model, served at an incidence.

    Parameters
    ----------
    request
        What is asked for.
    model
        The risk model.
    incidence
        Concussions per impact that probabilities are served at; the model's own unless given. Thresholds shift with the
        probabilities, so that who exceeds one does not change.

    Raises
    ------
    OperatingPointUnreachable
        The model gives no such point: nothing is extrapolated.
    """
    if request.threshold is not None:
        return OperatingPoint(request, request.threshold, None, None, None, "requested")
    points = model.operating_points.get(request.criterion, ())
    if not points:
        raise OperatingPointUnreachable(
            f"Model {model.version} has no operating points for {request.criterion}; ask for a threshold instead."
        )
    shift = model.incidence_shift(incidence)
    if model.basis == "cohort":
        return _of_cohort(request, points, shift)
    if request.specificity is not None:
        return _by_specificity(request, points, shift)
    return _by_sensitivity(request, points, shift)


def _of_cohort(request: OperatingPointRequest, points: tuple[KnownPoint, ...], shift: float) -> OperatingPoint:
    """The largest threshold of a sensitivity that is reached, or the smallest of a specificity that is."""
    ordered = sorted(points, key=lambda point: point.sensitivity)
    for point in ordered if request.sensitivity is not None else reversed(ordered):
        if request.sensitivity is not None and point.sensitivity >= request.sensitivity - 1e-9:
            return _at(request, point, shift, "cohort")
        if request.specificity is not None and (point.specificity or 0.0) >= request.specificity - 1e-9:
            return replace(_at(request, point, shift, "cohort"), threshold_interval=None)
    raise OperatingPointUnreachable(f"No threshold on {request.criterion} reaches that in the model's cohort.")


def _by_specificity(request: OperatingPointRequest, points: tuple[KnownPoint, ...], shift: float) -> OperatingPoint:
    assert request.specificity is not None
    for point in points:
        if point.specificity is not None and _printed_alike(point.specificity, request.specificity):
            return _at(request, point, shift, "published")
    known = ", ".join(f"{p.specificity:.3f}" for p in points if p.specificity is not None)
    raise OperatingPointUnreachable(f"The only specificities published for {request.criterion} are: {known}.")


def _by_sensitivity(request: OperatingPointRequest, points: tuple[KnownPoint, ...], shift: float) -> OperatingPoint:
    assert request.sensitivity is not None
    for point in points:
        if _printed_alike(point.sensitivity, request.sensitivity):
            return _at(request, point, shift, "published")
    ordered = sorted(points, key=lambda point: point.sensitivity)
    for below, above in pairwise(ordered):
        if below.sensitivity < request.sensitivity < above.sensitivity:
            return _interpolated(request, below, above, shift)
    raise OperatingPointUnreachable(
        f"Sensitivities for {request.criterion} are published from {ordered[0].sensitivity:.3f} "
        f"to {ordered[-1].sensitivity:.3f}; nothing is extrapolated beyond."
    )


def _printed_alike(published: float, asked: float) -> bool:
    return round(published, PRINTED_DIGITS) == round(asked, PRINTED_DIGITS)


def _at(request: OperatingPointRequest, point: KnownPoint, shift: float, basis: str) -> OperatingPoint:
    low, high = (None if end is None else probability_of(end + shift) for end in point.linear_predictor_interval)
    return OperatingPoint(
        request,
        probability_of(point.linear_predictor + shift),
        (high, low),  # a larger linear predictor is a smaller risk
        point.sensitivity,
        point.specificity,
        basis,
    )


def _interpolated(request: OperatingPointRequest, below: KnownPoint, above: KnownPoint, shift: float) -> OperatingPoint:
    assert request.sensitivity is not None
    share = (request.sensitivity - below.sensitivity) / (above.sensitivity - below.sensitivity)

    def between(low: float, high: float) -> float:
        return probability_of(low + share * (high - low) + shift)

    (low0, high0), (low1, high1) = below.linear_predictor_interval, above.linear_predictor_interval
    assert low0 is not None  # published intervals are whole
    assert high0 is not None
    assert low1 is not None
    assert high1 is not None
    return OperatingPoint(
        request,
        between(below.linear_predictor, above.linear_predictor),
        (between(high0, high1), between(low0, low1)),
        request.sensitivity,
        None,
        "interpolated",
    )


@dataclass(frozen=True, slots=True)
class CriticalValue:
    """Where a curve's plane of equal risk cuts one axis; `value` is None, with the reason, where it does not."""

    axis: str
    value: float | None
    reason: str | None = None


def critical_values(model: RiskModel, key: str, probability: float = 0.5) -> tuple[CriticalValue, ...]:
    """The value of each component that alone gives a probability, at the model's own incidence.

    Where the risk falls with a component, or where a criterion's largest value stays below that probability, there is
    none: it is null with the reason, never a negative threshold.
    """
    curve = model.curves[key]
    axes = ("x", "y", "z") if len(curve.b) == 3 else ("value",)
    return tuple(
        _critical_value(key, axis, curve.b0, coefficient, probability)
        for axis, coefficient in zip(axes, curve.b, strict=True)
    )


def _critical_value(key: str, axis: str, b0: float, coefficient: float, probability: float) -> CriticalValue:
    if coefficient >= 0:
        return CriticalValue(axis, None, "The risk does not rise with this component.")
    value = (linear_predictor_of(probability) - b0) / coefficient
    if value < 0:
        return CriticalValue(axis, None, "The risk is above this probability already without any motion.")
    largest = LARGEST_VALUES.get(key)
    if largest is not None and value > largest:
        reachable = probability_of(b0 + coefficient * largest)
        return CriticalValue(
            axis, None, f"{BY_KEY[key].name} is at most {largest:g}, where the risk is {reachable:.2f}."
        )
    return CriticalValue(axis, value)


# Criteria that are probabilities themselves cannot exceed 1.
LARGEST_VALUES = {"vtcp": 1.0}
