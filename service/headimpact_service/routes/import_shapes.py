"""What became of an imported file, as answers and jobs show it."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel, Field

from headimpact_service.problem_shapes import ProblemDocument
from headimpact_service.routes.impact_shapes import KinematicsView
from headimpact_service.routes.score_shapes import AxesView, PeaksView, QualityView

Status = Literal["created", "unchanged", "failed", "readable"]


class AsSentView(BaseModel):
    """A signal as its file has it: before units, filters and axes."""

    unit: str
    samples: int
    sample_rate_hz: float = Field(description="Of jittered stamps, their mean.")
    duration_ms: float
    range: float | None = Field(description="The sensor's full scale, where it is known.")
    peak: AxesView = Field(description="By axis the value of largest magnitude, with its sign.")


class PreviewView(BaseModel):
    """What a dry run understood of an impact."""

    athlete: str | None
    device: str | None
    occurred_at: datetime | None
    kinematics: KinematicsView
    as_sent: dict[str, AsSentView]
    source: dict[str, Any]
    state: Literal["scored", "unscorable"]
    reasons: list[str] | None = Field(None, description="Why it must not be scored; absent where it is.")
    peaks: PeaksView
    quality: list[QualityView]


class ImportedView(BaseModel):
    """What became of one impact of the file."""

    index: int
    external_id: str | None
    status: Status
    id: str | None
    problem: ProblemDocument | None
    preview: PreviewView | None = Field(None, description="Only of a dry run.")


class SummaryView(BaseModel):
    """How many of each."""

    created: int
    unchanged: int
    failed: int


class ImportView(BaseModel):
    """What became of a file."""

    data: list[ImportedView]
    summary: SummaryView


class ImportResult(BaseModel):
    """What a job has imported until it ended."""

    summary: SummaryView
    failed: list[ImportedView] | None = Field(
        None, description="The first 1000 refused impacts, in the file's order; not in lists."
    )
    failed_not_shown: int = Field(description="Refused impacts behind those.")
