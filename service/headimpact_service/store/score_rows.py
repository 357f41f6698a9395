"""Scores as rows: one column for each number, and JSON for what is only read with the whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal

from headimpact_service.store.tables import (
    CRITERION_COLUMNS,
    PEAK_COLUMNS,
    PROBABILITY_COLUMNS,
    VALUE_COLUMNS,
    scores,
)

State = Literal["scored", "unscorable"]
CriterionValue = float | tuple[float, float, float] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class NewScore:
    """A score to be stored. A criterion that is missing from `values` or `probabilities` is stored as null.

    `provenance` holds what a recomputation needs beside the trace: filters, conventions, the mounting used.
    `details` is the rest of the answer: quality notes, windows, reasons, times of peak, operating points.
    """

    state: State
    model: str
    incidence: float
    service_version: str
    input_digest: bytes
    values: Mapping[str, CriterionValue] = field(default_factory=dict)
    probabilities: Mapping[str, float | None] = field(default_factory=dict)
    brain_angle_resultant: float | None = None
    linear_acceleration_g: float | None = None
    angular_velocity_rad_s: float | None = None
    angular_acceleration_rad_s2: float | None = None
    quality_codes: Sequence[str] = ()
    details: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Score(NewScore):
    """A score as stored; `number` counts the scores of its impact, `revision` is the one that it was made from."""

    impact_id: bytes
    number: int
    revision: int
    created_at: datetime


COLUMNS = list(scores.c)
"""Of a query whose rows :func:`score_of` reads, in this order."""
_EMPTY: dict[str, Any] = dict.fromkeys((*VALUE_COLUMNS, *PROBABILITY_COLUMNS))
_PROBABILITY_OF = dict(zip(CRITERION_COLUMNS, PROBABILITY_COLUMNS, strict=True))
_FIRST_VALUE = [column.name for column in COLUMNS].index(VALUE_COLUMNS[0])
_FIRST_PROBABILITY = _FIRST_VALUE + len(VALUE_COLUMNS)
_FIRST_PEAK = _FIRST_PROBABILITY + len(PROBABILITY_COLUMNS)
_REST = _FIRST_PEAK + len(PEAK_COLUMNS)


def row_of(new: NewScore, impact_id: bytes, number: int, revision: int, created_at: datetime) -> dict[str, Any]:
    """The values of every column; an unknown criterion raises KeyError."""
    row = _EMPTY.copy()
    for key, value in new.values.items():
        columns = CRITERION_COLUMNS[key]
        if len(columns) == 1:
            row[columns[0]] = value
        elif value is not None:
            row.update(zip(columns, value, strict=True))  # type: ignore[arg-type] # a vector, as its columns say
    for key, probability in new.probabilities.items():
        row[_PROBABILITY_OF[key]] = probability
    row.update(
        impact_id=impact_id,
        number=number,
        revision=revision,
        state=new.state,
        model=new.model,
        incidence=new.incidence,
        service_version=new.service_version,
        input_digest=new.input_digest,
        brain_angle_resultant=new.brain_angle_resultant,
        resultant_linear_acceleration_g=new.linear_acceleration_g,
        resultant_angular_velocity_rad_s=new.angular_velocity_rad_s,
        resultant_angular_acceleration_rad_s2=new.angular_acceleration_rad_s2,
        quality_codes=f" {' '.join(new.quality_codes)} ",
        details=new.details,
        provenance=new.provenance,
        created_at=created_at,
    )
    return row


def stored(new: NewScore, impact_id: bytes, number: int, revision: int, created_at: datetime) -> Score:
    """What :func:`score_of` will read of the row, without reading it."""
    return Score(
        state=new.state,
        model=new.model,
        incidence=new.incidence,
        service_version=new.service_version,
        input_digest=new.input_digest,
        values={key: new.values.get(key) for key in CRITERION_COLUMNS},
        probabilities={key: new.probabilities.get(key) for key in CRITERION_COLUMNS},
        brain_angle_resultant=new.brain_angle_resultant,
        linear_acceleration_g=new.linear_acceleration_g,
        angular_velocity_rad_s=new.angular_velocity_rad_s,
        angular_acceleration_rad_s2=new.angular_acceleration_rad_s2,
        quality_codes=tuple(new.quality_codes),
        details=new.details,
        provenance=new.provenance,
        impact_id=impact_id,
        number=number,
        revision=revision,
        created_at=created_at,
    )


def score_of(row: Sequence[Any]) -> Score:
    """The score in the values of :data:`COLUMNS`."""
    impact_id, number, revision, state, model, incidence, service_version, input_digest = row[:_FIRST_VALUE]
    resultant, linear, velocity, acceleration = row[_FIRST_PEAK:_REST]
    quality_codes, details, provenance, created_at = row[_REST : _REST + 4]
    return Score(
        impact_id=impact_id,
        number=number,
        revision=revision,
        state=state,
        model=model,
        incidence=incidence,
        service_version=service_version,
        input_digest=input_digest,
        values=_values(row),
        probabilities=dict(zip(CRITERION_COLUMNS, row[_FIRST_PROBABILITY:_FIRST_PEAK], strict=True)),
        brain_angle_resultant=resultant,
        linear_acceleration_g=linear,
        angular_velocity_rad_s=velocity,
        angular_acceleration_rad_s2=acceleration,
        quality_codes=tuple(quality_codes.split()),
        details=details,
        provenance=provenance,
        created_at=created_at,
    )


def _values(row: Sequence[Any]) -> dict[str, CriterionValue]:
    """The criteria by key, vectors as triples; a vector is null as a whole."""
    values: dict[str, CriterionValue] = {}
    at = _FIRST_VALUE
    for key, columns in CRITERION_COLUMNS.items():
        if len(columns) == 1:
            values[key] = row[at]
        else:
            values[key] = None if row[at] is None else tuple(row[at : at + 3])
        at += len(columns)
    return values
