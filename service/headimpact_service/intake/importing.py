"""What an import does with the records of a file: look up, score together, make rows, store, say what became of each.

One request does it for a small file and a job for a large one, part by part.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from headimpact.recording import AXES, FloatArray, Signal
from headimpact_service.errors import Problem
from headimpact_service.ingest.digest import content_digest
from headimpact_service.ingest.record import ImpactRecord, RefusedImpact
from headimpact_service.intake.facts import facts_of
from headimpact_service.intake.records import describe, kinematics_document
from headimpact_service.intake.rendering import new_score, score_document
from headimpact_service.intake.scoring import DeviceFacts, Scored, Terms, score_records
from headimpact_service.intake.storing import new_impacts
from headimpact_service.store import ids
from headimpact_service.store.impact_batches import Added, add_many
from headimpact_service.store.impact_rows import NewImpact

Found = Sequence[ImpactRecord | Problem]
"""Impacts as they were read, in the file's order; a fault of one stands in its place."""
Known = list[tuple[ImpactRecord, DeviceFacts] | None]

GAP = 1.5
"""Steps of so many usual ones leave out a sample."""
COUNTED = ("created", "unchanged", "failed")


@dataclass(frozen=True, slots=True)
class Item:
    """One impact of a file, and what became of it so far."""

    external_id: str | None
    outcome: Scored | Problem
    sent_digest: bytes = b""


@dataclass(frozen=True, slots=True)
class Ready:
    """One impact of a file as it can be stored, or why it cannot."""

    external_id: str | None
    new: NewImpact | Problem


def look_up(conn: Any, data_set_id: bytes, found: Found) -> Known:  # noqa: ANN401 - a connection of the store
    """What the devices and athletes of the records add to them."""
    facts = facts_of(conn, data_set_id, [record for record in found if not isinstance(record, Problem)])
    return [None if isinstance(record, Problem) else facts(record) for record in found]


def score_found(found: Found, known: Known, terms: Terms) -> list[Item]:
    """Every impact scored, or its problem."""
    scored = iter(score_records([pair for pair in known if pair is not None], terms))
    return [_item(record, None if isinstance(record, Problem) else next(scored)) for record in found]


def _item(record: ImpactRecord | Problem, scored: Scored | Problem | None) -> Item:
    if isinstance(record, Problem):
        return Item(record.external_id if isinstance(record, RefusedImpact) else None, record)
    assert scored is not None
    sent_digest = scored.sent_digest if isinstance(scored, Scored) else None
    return Item(record.external_id, scored, content_digest(record, sent_digest))


def make_ready(items: Sequence[Item], key_id: bytes | None) -> list[Ready]:
    """The rows of the store."""
    scored = [(item.outcome, item.sent_digest) for item in items if isinstance(item.outcome, Scored)]
    made = iter(new_impacts(scored, key_id))
    return [
        Ready(item.external_id, item.outcome if isinstance(item.outcome, Problem) else next(made)) for item in items
    ]


def store(conn: Any, data_set_id: bytes, ready: Sequence[Ready], first: int) -> list[dict[str, Any]]:  # noqa: ANN401 - a connection of the store
    """Add what can be added, in one transaction; what became of each, numbered from `first`."""
    added = iter(add_many(conn, data_set_id, [item.new for item in ready if isinstance(item.new, NewImpact)]))
    return [
        _stored_row(index, item.external_id, item.new if isinstance(item.new, Problem) else next(added))
        for index, item in enumerate(ready, first)
    ]


def _stored_row(index: int, external_id: str | None, outcome: Added | Problem) -> dict[str, Any]:
    if isinstance(outcome, Problem):
        return failed_row(index, external_id, outcome)
    row = {"index": index, "external_id": external_id or outcome.external_id}
    return row | {"status": outcome.status, "id": ids.encode("imp", outcome.id), "problem": None}


def failed_row(index: int, external_id: str | None, problem: Problem) -> dict[str, Any]:
    """The row of an impact that was refused."""
    row = {"index": index, "external_id": external_id, "status": "failed", "id": None}
    return row | {"problem": problem.as_dict()}


def summary(rows: Iterable[dict[str, Any]]) -> dict[str, int]:
    """How many were created, unchanged and failed."""
    counts = dict.fromkeys(COUNTED, 0)
    for row in rows:
        if row["status"] in counts:
            counts[row["status"]] += 1
    return counts


def preview_row(index: int, item: Item) -> dict[str, Any]:
    """The row of a dry run: what was understood, and what would be noted."""
    if isinstance(item.outcome, Problem):
        return failed_row(index, item.external_id, item.outcome)
    row = {"index": index, "external_id": item.external_id, "status": "readable", "id": None, "problem": None}
    return row | {"preview": _preview(item.outcome)}


def _preview(scored: Scored) -> dict[str, Any]:
    record = scored.record
    document = score_document(new_score(scored))
    return {
        "athlete": record.athlete_external_id or record.athlete_id,
        "device": record.device_serial,
        "occurred_at": record.occurred_at,
        "kinematics": kinematics_document(describe(record)),
        "as_sent": {name: _as_sent(signal) for name, signal in record.recording.signals()},
        "source": dict(record.metadata),
        **{name: document[name] for name in ("state", "reasons") if name in document},
        "peaks": document["peaks"],
        "quality": document["quality"],
    }


def _as_sent(signal: Signal) -> dict[str, Any]:
    """A signal as its file has it: what a sender recognises before anything is converted, filtered or turned."""
    count = signal.values.shape[0]
    if signal.time_s is None:
        rate = signal.sample_rate_hz or 0.0
        duration_s = (count - 1) / rate if rate else 0.0
    else:
        duration_s = float(signal.time_s[-1] - signal.time_s[0]) if count else 0.0
        rate = _rate(np.diff(signal.time_s), duration_s)
    return {
        "unit": signal.unit,
        "samples": count,
        "sample_rate_hz": rate,
        "duration_ms": duration_s * 1000.0,
        "range": signal.declared_range,
        "peak": {axis: _peak(signal.values[:, column]) for column, axis in enumerate(AXES)},
    }


def _rate(steps_s: FloatArray, duration_s: float) -> float:
    """The rate of stamps: their mean or, where samples are missing, that between those that are there."""
    usual = float(np.median(steps_s)) if steps_s.size else 0.0
    if usual > 0.0 and steps_s.max() > GAP * usual:
        return 1.0 / usual
    return steps_s.size / duration_s if duration_s else 0.0


def _peak(values: FloatArray) -> float | None:
    """The value of largest magnitude, with its sign; None of a channel without any."""
    known = values[np.isfinite(values)]
    return float(known[np.abs(known).argmax()]) if known.size else None
