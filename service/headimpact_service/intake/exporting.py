"""Stored impacts as they can be sent again: with their samples, and all that says how these are to be read.

What is exported and imported elsewhere has the same score to the last bit: samples leave in their own unit or, where a
table needs one unit for all, in the criteria's, converted as scoring converts them; rates as they were stated; times in
milliseconds that give the same seconds again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic_core import to_json

from headimpact.recording import AXES, TO_CRITERIA_UNIT, FloatArray
from headimpact_service.ingest.impact_json import Context
from headimpact_service.intake.records import TIME, kinematics_document, raw_traces, thousandfold
from headimpact_service.store import ids
from headimpact_service.store.impact_rows import Impact

CONTEXT = tuple(Context.model_fields)
"""Fields of an impact's context; four of them are columns of the store."""
CONTEXT_NUMBERS = frozenset(
    {
        "linear_acceleration_range_g",
        "angular_velocity_range_rad_s",
        "trigger_threshold_g",
        "post_trigger_ms",
        "age_years",
    }
)
CONTEXT_FLAGS = frozenset({"worn", "video_verified"})

_SYMBOLS = {
    "linear_acceleration": ("a", "_g"),
    "angular_velocity": ("w", "_rad_s"),
    "angular_acceleration": ("al", "_rad_s2"),
}
_SAMPLES = {signal: tuple(f"{symbol}{axis}{unit}" for axis in AXES) for signal, (symbol, unit) in _SYMBOLS.items()}
_LABELS = ("id", "external_id", "athlete", "device", "occurred_at", *CONTEXT)
NAMED = frozenset(_LABELS)
"""Columns of what the sender called things."""
_READING = ("axes", "filter", "constrained_plane", "pre_trigger_ms", "mounting", "fill_gaps", "unscorable")
_TIMES = ("time_base", "sample_rate_hz", "t_ms")

_COMPONENTS = tuple(name for names in _SAMPLES.values() for name in names)

SAMPLE_COLUMNS = (*_LABELS, *_READING, *_TIMES, *_COMPONENTS)
"""Of a table with one row for each sample, as the preset generic_six_axis reads them."""
SAMPLE_NUMBERS = CONTEXT_NUMBERS | {
    "pre_trigger_ms",
    "sample_rate_hz",
    "t_ms",
    *(n for ns in _SAMPLES.values() for n in ns),
}
SAMPLE_FLAGS = CONTEXT_FLAGS | {"fill_gaps"}


@dataclass(frozen=True, slots=True)
class Traced:
    """A stored impact with its samples."""

    impact: Impact
    document: Mapping[str, Any]
    samples: Mapping[str, FloatArray]


def context_of(impact: Impact) -> dict[str, Any]:
    """The context as it was sent: its columns and the rest."""
    named = {
        "session_id": impact.session_id,
        "activity": impact.activity,
        "sport": impact.sport,
        "position": impact.position,
    }
    return {name: value for name, value in named.items() if value is not None} | dict(impact.context or {})


def importable(traced: Traced) -> dict[str, Any]:
    """The impact as a line of NDJSON that `POST /v1/imports` takes."""
    impact, document = traced.impact, traced.document
    body: dict[str, Any] = {"external_id": _external_id(impact)}
    if (athlete := _athlete(impact)) is not None:
        body["athlete"] = {"external_id": athlete}
    if impact.occurred_at is not None:
        body["occurred_at"] = impact.occurred_at
    if impact.device_serial is not None:
        body["device"] = {"serial": impact.device_serial}
    if context := context_of(impact):
        body["context"] = context
    if document["unscorable"]:
        body["unscorable"] = document["unscorable"]
    return body | {"kinematics": _kinematics(traced)}


def _external_id(impact: Impact) -> str:
    """The sender's name, or ours, so that an impact without one is still found again elsewhere."""
    return impact.external_id or ids.encode("imp", impact.id)


def _athlete(impact: Impact) -> str | None:
    if impact.athlete_external_id is not None:
        return impact.athlete_external_id
    return None if impact.athlete_id is None else ids.encode("ath", impact.athlete_id)


def _kinematics(traced: Traced) -> dict[str, Any]:
    shown = kinematics_document(traced.document)
    signals = raw_traces(traced.document, traced.samples)
    for name, signal in signals.items():
        if signal is not None:
            rate_or_times = {key: value for key, value in signal.items() if value is not None}
            full_scale = traced.document["signals"][name]["declared_range"]
            signals[name] = rate_or_times if full_scale is None else rate_or_times | {"range": full_scale}
    return shown | signals


@dataclass(frozen=True, slots=True)
class Part:
    """Signals of one impact that share their times: as many rows of the table as they have samples."""

    rows: int
    labels: dict[str, Any]
    numbers: dict[str, FloatArray]

    def column(self, name: str) -> Any:  # noqa: ANN401 - an array, or the cell that all rows have
        """One of :data:`SAMPLE_COLUMNS`."""
        found = self.numbers.get(name)
        return self.labels.get(name) if found is None else found


def parts(traced: Traced) -> Iterator[Part]:
    """The impact as rows of a table, one part for each time base."""
    labels = _labels(traced)
    described = traced.document["signals"]
    for number, names in enumerate(_time_bases(traced), start=1):
        rate = described[names[0]]["sample_rate_hz"]
        samples = {name: _in_criteria_unit(traced, name) for name in names}
        count = samples[names[0]].shape[0]
        columns = {column: samples[name][:, axis] for name in names for axis, column in enumerate(_SAMPLES[name])}
        times = np.arange(count) * (1000.0 / rate) if rate else thousandfold(traced.samples[names[0] + TIME])
        yield Part(count, labels | {"time_base": str(number), "sample_rate_hz": rate}, columns | {"t_ms": times})


def _time_bases(traced: Traced) -> list[list[str]]:
    """The signals, those of equal rate and length or equal stamps together."""
    found: dict[Any, list[str]] = {}
    for name, signal in traced.document["signals"].items():
        stamps = traced.samples.get(name + TIME)
        key = (signal["sample_rate_hz"], signal["samples"], None if stamps is None else stamps.tobytes())
        found.setdefault(key, []).append(name)
    return list(found.values())


def _in_criteria_unit(traced: Traced, name: str) -> FloatArray:
    """As scoring converts it, so that the converted samples are scored alike."""
    factor = TO_CRITERIA_UNIT[traced.document["signals"][name]["unit"]]
    values = traced.samples[name]
    return values if factor == 1.0 else values * factor


def _labels(traced: Traced) -> dict[str, Any]:
    impact, document = traced.impact, traced.document
    shown = kinematics_document(document)
    chosen, mounting = shown["filter"], shown["mounting"]
    return {
        "id": ids.encode("imp", impact.id),
        "external_id": _external_id(impact),
        "athlete": _athlete(impact),
        "device": impact.device_serial,
        "occurred_at": impact.occurred_at,
        **_ranges(traced),
        **context_of(impact),
        "axes": shown["axes"],
        "filter": chosen if isinstance(chosen, str) else to_json(chosen).decode(),
        "constrained_plane": shown["constrained_plane"],
        "pre_trigger_ms": shown["pre_trigger_ms"],
        "mounting": None if mounting is None else to_json(mounting).decode(),
        "fill_gaps": shown["fill_gaps"] or None,
        "unscorable": " ".join(document["unscorable"]) or None,
    }


def _ranges(traced: Traced) -> dict[str, float]:
    """The sensors' full scales in the units of their columns, where they came with the device or the signals."""
    columns = {"linear_acceleration": "linear_acceleration_range_g", "angular_velocity": "angular_velocity_range_rad_s"}
    described: Mapping[str, Any] = traced.document["signals"]
    found = {column: described[name] for name, column in columns.items() if name in described}
    return {
        column: signal["declared_range"] * TO_CRITERIA_UNIT[signal["unit"]]
        for column, signal in found.items()
        if signal["declared_range"] is not None
    }
