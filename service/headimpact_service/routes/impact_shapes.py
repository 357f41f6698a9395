"""The shape of an impact, and how a stored one is answered: as JSON and as the cells of a table."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from headimpact.quality import QualityNote
from headimpact_service.ingest.digest import shown
from headimpact_service.ingest.impact_json import Filter, MountingBody
from headimpact_service.intake.exporting import CONTEXT, CONTEXT_NUMBERS, context_of
from headimpact_service.intake.records import kinematics_document
from headimpact_service.intake.rendering import note_document, score_document
from headimpact_service.routes.score_shapes import ScoreView, Shape
from headimpact_service.routes.tables import Cell
from headimpact_service.store import ids
from headimpact_service.store.impact_lists import DUPLICATE
from headimpact_service.store.impact_rows import Impact
from headimpact_service.store.keys import KeyRow
from headimpact_service.store.score_rows import Score
from headimpact_service.store.tables import CRITERION_COLUMNS, PROBABILITY_COLUMNS, VALUE_COLUMNS


class AthleteOfImpact(Shape):
    """Whose head it was."""

    id: str
    external_id: str | None


class DeviceOfImpact(Shape):
    """Which device recorded it."""

    serial: str


class SignalView(Shape):
    """How a signal was sent; its samples are at `/traces`."""

    unit: str
    sample_rate_hz: float | None = Field(description="Null where stamps were sent.")
    samples: int


class KinematicsView(Shape):
    """How the kinematics were sent, without the samples."""

    axes: Literal["anatomical", "sae_j211"]
    location: Literal["head_cg", "sensor"]
    pre_trigger_ms: float | None
    filter: Filter
    constrained_plane: Literal["sagittal", "coronal", "axial"] | None
    mounting: MountingBody | None = Field(description="The one that was used: the request's own, or the device's.")
    fill_gaps: bool = Field(description="Whether gaps of at most 2 samples were to be filled.")
    linear_acceleration: SignalView | None
    angular_velocity: SignalView | None
    angular_acceleration: SignalView | None


class ImpactView(Shape):
    """An impact with its score."""

    id: str
    external_id: str | None
    athlete: AthleteOfImpact | None
    occurred_at: datetime | None
    device: DeviceOfImpact | None
    context: dict[str, Any]
    kinematics: KinematicsView
    source: dict[str, Any] = Field(description="The form it came in, and what its file said besides.")
    duplicate_of: str | None = Field(description="An earlier impact with the same signals.")
    outcome: Literal["concussion", "no_concussion", "unknown"] | None = Field(
        description="What its label says; null as long as nobody has labelled it, and for a key without the scope "
        "`labels:read`."
    )
    revision: int
    created_at: datetime
    updated_at: datetime
    score: ScoreView


class ImpactTombstone(Shape):
    """What is left of a deleted impact."""

    id: str
    external_id: str | None
    athlete: AthleteOfImpact | None
    revision: int
    updated_at: datetime
    deleted_at: datetime


class ImpactList(Shape):
    """A page of impacts; with `updated_since` deleted ones among them, as tombstones."""

    data: list[ImpactView | ImpactTombstone]
    next_cursor: str | None


def shown_to(key: KeyRow, impact: Impact) -> Impact:
    """The impact as a key may see it: what its label says only with the scope of labels."""
    return impact if "labels:read" in key.scopes else replace(impact, outcome=None, event=None)


def impact_document(impact: Impact) -> dict[str, Any]:
    """An impact, or a tombstone, as it is answered: after POST as after GET, alone as in a list."""
    document: dict[str, Any] = {
        "id": ids.encode("imp", impact.id),
        "external_id": impact.external_id,
        "athlete": _athlete(impact),
    }
    if impact.deleted_at is not None or impact.document is None or impact.score is None:
        times = {"updated_at": impact.updated_at, "deleted_at": impact.deleted_at}
        return document | {"revision": impact.revision, **times}
    document["occurred_at"] = impact.occurred_at
    document["device"] = None if impact.device_serial is None else {"serial": impact.device_serial}
    document["context"] = context_of(impact)
    document["kinematics"] = kinematics_document(impact.document)
    document["source"] = impact.document["metadata"]
    document["duplicate_of"] = None if impact.duplicate_of is None else ids.encode("imp", impact.duplicate_of)
    document["outcome"] = impact.outcome
    document["revision"] = impact.revision
    document["created_at"] = impact.created_at
    document["updated_at"] = impact.updated_at
    document["score"] = _score(impact, impact.score)
    return document


def _athlete(impact: Impact) -> dict[str, Any] | None:
    if impact.athlete_id is None:
        return None
    return {"id": ids.encode("ath", impact.athlete_id), "external_id": impact.athlete_external_id}


def _score(impact: Impact, score: Score) -> dict[str, Any]:
    """The score, with a note where an earlier impact has the same signals."""
    document = score_document(score)
    if impact.duplicate_of is not None:
        detail = f"The same signals came before as {ids.encode('imp', impact.duplicate_of)}."
        note = QualityNote("duplicate_content", "note", detail)
        document["quality"] = [*document["quality"], note_document(note)]
    return document


_REST = tuple(name for name in CONTEXT if name not in {"session_id", "activity", "sport", "position"})
SCORE_COLUMNS = (
    "state",
    "model",
    "incidence",
    *VALUE_COLUMNS,
    *PROBABILITY_COLUMNS,
    "brain_angle_resultant",
    "peak_resultant_linear_acceleration_g",
    "peak_resultant_angular_velocity_rad_s",
    "peak_resultant_angular_acceleration_rad_s2",
)
"""Of a score as a part of a row."""
COLUMNS = (
    "id",
    "external_id",
    "athlete_id",
    "occurred_at",
    "outcome",
    "athlete_external_id",
    "device_serial",
    "session_id",
    "activity",
    "sport",
    "position",
    *SCORE_COLUMNS,
    "quality_codes",
    "duplicate_of",
    "input_digest",
    "revision",
    "created_at",
    "updated_at",
    "deleted_at",
    "event",
    "athlete_consent",
    *_REST,
)
"""Of an impact as a row of a table.

`outcome` and `event` are empty as long as nobody has labelled the impact, and for a key that may not read labels.
"""
SCORE_NUMBERS = frozenset(SCORE_COLUMNS) - {"state", "model"}
NUMBERS = CONTEXT_NUMBERS | SCORE_NUMBERS
"""Those of :data:`COLUMNS` that hold numbers."""


def impact_cells(impact: Impact) -> list[Cell]:
    """The cells of :data:`COLUMNS`."""
    return [
        ids.encode("imp", impact.id),
        impact.external_id,
        None if impact.athlete_id is None else ids.encode("ath", impact.athlete_id),
        impact.occurred_at,
        impact.outcome,
        impact.athlete_external_id,
        impact.device_serial,
        impact.session_id,
        impact.activity,
        impact.sport,
        impact.position,
        *(_NO_SCORE if impact.score is None else score_cells(impact.score)),
        _quality_codes(impact),
        None if impact.duplicate_of is None else ids.encode("imp", impact.duplicate_of),
        None if impact.input_digest is None else shown(impact.input_digest),
        impact.revision,
        impact.created_at,
        impact.updated_at,
        impact.deleted_at,
        impact.event,
        impact.athlete_consent,
        *((impact.context or {}).get(name) for name in _REST),
    ]


_NO_SCORE: list[Cell] = [None] * len(SCORE_COLUMNS)


def score_cells(score: Score) -> list[Cell]:
    """The cells of :data:`SCORE_COLUMNS`."""
    values: list[Cell] = []
    for key, columns in CRITERION_COLUMNS.items():
        value = score.values.get(key)
        values += value if isinstance(value, tuple) else [value] * len(columns)
    return [
        score.state,
        score.model,
        score.incidence,
        *values,
        *(score.probabilities.get(key) for key in CRITERION_COLUMNS),
        score.brain_angle_resultant,
        score.linear_acceleration_g,
        score.angular_velocity_rad_s,
        score.angular_acceleration_rad_s2,
    ]


def _quality_codes(impact: Impact) -> str | None:
    if impact.score is None:
        return None
    duplicate = () if impact.duplicate_of is None else (DUPLICATE,)
    return " ".join((*impact.score.quality_codes, *duplicate))
