"""The shape of a score, as it is documented and tested: `intake.rendering` makes the same, without the detour."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model

from headimpact.criteria import CRITERIA

Probability = Annotated[float, Field(ge=0, le=1)]


class Shape(BaseModel):
    """Part of an answer; `examples` of the documentation come from real answers."""

    model_config = ConfigDict(extra="forbid")


class AxesView(Shape):
    """One number for each axis: x coronal, y sagittal, z axial."""

    x: float | None
    y: float | None
    z: float | None


class QualityView(Shape):
    """One finding about the record."""

    code: str
    severity: Literal["note", "warning"]
    detail: str
    signal: str | None = None
    channel: str | None = None


class BrainAngleView(Shape):
    """The largest angle of the brain relative to the skull, by axis, and of their resultant."""

    unit: Literal["rad"]
    x: float
    y: float
    z: float
    resultant: float
    time_of_peak_ms: AxesView


class PeaksView(Shape):
    """Resultant peaks at the head's centre of gravity, after filtering."""

    linear_acceleration_g: float | None
    angular_velocity_rad_s: float | None
    angular_acceleration_rad_s2: float | None


class CriterionView(Shape):
    """One criterion; `value` is null, with the `reason`, where the record does not carry what it needs."""

    value: AxesView | float | None
    unit: str
    probability: Probability | None
    probability_interval: Annotated[list[Probability], Field(min_length=2, max_length=2)] | None = Field(
        None, description="95 %, by the coefficients' covariance; absent of the published model, which gives none."
    )
    window_ms: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    reason: str | None = None


class ExtraCriterionView(CriterionView):
    """A criterion beside the thirteen; `risks` are its own published curves, by name."""

    risks: dict[str, Probability] | None = None


_FIELDS: dict[str, Any] = {criterion.key: (CriterionView, ...) for criterion in CRITERIA}
CriteriaView = create_model(
    "CriteriaView", __base__=Shape, __doc__="The thirteen criteria, in the paper's order.", **_FIELDS
)


class OperatingPointView(Shape):
    """A threshold on a criterion's probability, and on which side of it this impact lies.

    The organisation's default point that the model does not have stands in its place, all null, with the `reason`.
    """

    criterion: str
    requested: dict[str, float]
    threshold: float | None
    threshold_interval: Annotated[list[float | None], Field(min_length=2, max_length=2)] | None = Field(
        description="Null for a threshold that was asked for, and for a fitted model's specificity."
    )
    exceeded: bool | None
    sensitivity: float | None
    specificity: float | None
    basis: Literal["published", "interpolated", "cohort", "requested"] | None
    reason: str | None = Field(None, description="Why the model does not have it; absent where it has.")


class FilterView(Shape):
    """The low-pass filter of one signal; `corner_hz` is null where the rate could not carry it."""

    signal: str
    cut_off: float | str
    corner_hz: float | None
    applied: bool


class ProvenanceView(Shape):
    """What the score was made from and with; enough to make it again."""

    input_digest: str
    service_version: str
    model: str
    incidence: float
    filters: list[FilterView]
    conventions: dict[str, str]
    angular_velocity_source: str | None = Field(None, description="`supplied`, or what it was derived by.")
    angular_acceleration_source: str | None = Field(None, description="`supplied`, or what it was derived by.")


class TraceView(Shape):
    """Three-axis samples on the score's own time base."""

    unit: str
    x: list[float]
    y: list[float]
    z: list[float]


class ScoredTracesView(Shape):
    """The filtered head kinematics and the brain angle that the score was read from."""

    sample_rate_hz: float
    start_time_ms: float
    linear_acceleration: TraceView | None
    angular_velocity: TraceView | None
    angular_acceleration: TraceView | None
    brain_angle: TraceView | None


class ScoreView(Shape):
    """The score of one impact."""

    state: Literal["scored", "unscorable"]
    model: str
    reasons: list[str] | None = Field(None, description="Why it must not be scored; absent where it was.")
    quality: list[QualityView]
    brain_angle: BrainAngleView | None
    peaks: PeaksView
    criteria: CriteriaView  # type: ignore[valid-type] # its fields are the registry's
    extra_criteria: dict[str, ExtraCriterionView] | None = Field(None, description="Those asked for by name.")
    operating_points: list[OperatingPointView]
    provenance: ProvenanceView
    traces: ScoredTracesView | None = Field(None, description='Only where `include` asked for "traces".')
