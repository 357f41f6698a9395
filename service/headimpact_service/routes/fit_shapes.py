"""What a fit is asked for, by a request or by a schedule."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from headimpact.criteria import CRITERION_KEYS
from headimpact.errors import CalibrationError
from headimpact_service.errors import PayloadError
from headimpact_service.ingest.impact_json import CriterionKey, Incidence, Moment, Name, Strict, Text, Word
from headimpact_service.ingest.json_faults import rules_problem
from headimpact_service.intake.scoring import Terms

MAX_REPLICAS = 10_000


class CohortBody(Strict):
    """Which labelled impacts enter; all unless it says so."""

    occurred_from: Moment | None = Field(default=None, description="At this time or later.")
    occurred_to: Moment | None = Field(default=None, description="Before this time.")
    sport: Text | None = None
    activity: Text | None = None
    session_id: Name | None = None
    device_serial: Text | None = None
    athlete_level: Word | None = None
    athlete_sex: Literal["male", "female", "other"] | None = None
    include: Annotated[list[Literal["unverified", "false_positive", "not_worn"]], Field(max_length=3)] = Field(
        default=[], description="Kinds of impacts that stay out otherwise."
    )

    @model_validator(mode="after")
    def _goes_forward(self) -> CohortBody:
        if self.occurred_from is not None and self.occurred_to is not None and self.occurred_from >= self.occurred_to:
            raise ValueError("A cohort's occurred_from is before its occurred_to.")
        return self


def _known(name: str) -> str:
    keys = name.split("+")
    if any(key not in CRITERION_KEYS for key in keys) or len(set(keys)) < len(keys):
        raise ValueError("A criterion is one of the thirteen keys; a plus sign joins some that are fitted together.")
    return name


def _distinct(names: list[str]) -> list[str]:
    if len({frozenset(name.split("+")) for name in names}) < len(names):
        raise ValueError("Each criterion may be named once.")
    return names


def _rising(bounds: list[float]) -> list[float]:
    if bounds[0] > bounds[1]:
        raise ValueError("A range rises: its first number is not above its second.")
    return bounds


Criteria = Annotated[
    list[Annotated[Word, AfterValidator(_known)]], Field(min_length=1, max_length=40), AfterValidator(_distinct)
]
IncidenceRange = Annotated[list[Incidence], Field(min_length=2, max_length=2), AfterValidator(_rising)]


class FitBody(Strict):
    """A fit: on whom, of what, and how."""

    cohort: CohortBody = Field(default_factory=CohortBody)
    criteria: Criteria | None = Field(default=None, description="All thirteen unless given.")
    sampling: Literal["case_control", "full_follow_up"] = Field(
        default="case_control",
        description="`case_control` where impacts were chosen by their outcome: intercepts go to `incidence`. In a "
        "`full_follow_up` they do not, and an incidence has no effect.",
    )
    incidence: Incidence | None = Field(default=None, description="What GET /v1/settings shows unless given.")
    incidence_range: IncidenceRange | None = Field(
        default=None, description="The least and the greatest that the incidence may be; it lies between them."
    )
    bias_correction: Literal["king_zeng", "firth", "zelig", "none"] = "king_zeng"
    replicas: Annotated[int, Field(ge=0, le=MAX_REPLICAS)] = 1000
    folds: Annotated[int, Field(ge=2, le=100)] = 5
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    sensitivity_targets: Annotated[list[Annotated[float, Field(gt=0, le=1)]], Field(min_length=1, max_length=20)] = (
        Field(default=[0.5, 0.9])
    )
    title: Text | None = None


def _coefficient(name: str) -> str:
    """One of a criterion's coefficients, or all of them."""
    from headimpact.calibration.cohort import component_names  # costs a tenth of a second: few requests name one

    key, dot, component = name.partition(".")
    components = component_names(_known(key))
    if dot and component not in components:
        raise ValueError(f"The coefficients of {key} are: {', '.join(components)}.")
    return name


Range = Annotated[list[float], Field(min_length=2, max_length=2), AfterValidator(_rising)]
PositiveRange = Annotated[
    list[Annotated[float, Field(gt=0)]], Field(min_length=2, max_length=2), AfterValidator(_rising)
]


class GatesBody(Strict):
    """What a model must pass before it is promoted by itself; what is left out keeps its default."""

    criteria: Annotated[list[CriterionKey], Field(min_length=1, max_length=13)] = Field(default=["bam"])
    min_events: Annotated[int, Field(ge=1)] = 30
    min_athletes_with_events: Annotated[int, Field(ge=1)] = 15
    max_condition_number: Annotated[float, Field(gt=1)] = 1e8
    max_auc_loss: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.02, description="Out of fold against the active model, by the lower end of a bootstrap of athletes."
    )
    expected_over_observed: PositiveRange = Field(
        default=[0.8, 1.25],
        description="What the 95 % interval of E:O must meet, out of fold and weighted to the incidence.",
    )
    calibration_slope: Range = Field(default=[0.8, 1.2], description="Out of fold.")
    waive_lowering: Annotated[list[Annotated[Word, AfterValidator(_coefficient)]], Field(max_length=39)] = Field(
        default=[],
        description="Coefficients that may lower the risk: `bam.y`, or `bam` for all of its.",
        examples=[["bam.y"]],
    )
    max_panel_change: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.15, description="Of any probability over the cohort's range, against the active model."
    )
    sensitivity: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.9, description="At whose threshold no fewer concussions may be alarmed than by the active model."
    )


def stored(body: FitBody, terms: Terms, place: str = "") -> dict[str, Any]:
    """A fit as jobs and schedules keep it: JSON, complete, with the incidence that holds now.

    Raises
    ------
    Problem
        The range of incidences, a member of the object at `place`, does not hold that incidence.
    """
    document = body.model_dump(mode="json", exclude_none=True)
    if body.sampling == "case_control":
        incidence = document.setdefault("incidence", terms.incidence or terms.model.incidence)
        if body.incidence_range is not None:
            _require_in_range(incidence, body.incidence_range, f"{place}/incidence_range")
    return document


def _require_in_range(incidence: float, bounds: list[float], place: str) -> None:
    from headimpact.calibration.options import require_in_range  # as above

    try:
        require_in_range(incidence, bounds)
    except CalibrationError as error:
        raise rules_problem([PayloadError(str(error), "out-of-range", pointer=place)]) from None
