"""What an import does with the records of a file: look up, score together, store in a few transactions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from anyio.to_thread import run_sync

from headimpact_service import deps
from headimpact_service.errors import Problem
from headimpact_service.ingest.digest import content_digest
from headimpact_service.ingest.record import ImpactRecord, RefusedImpact
from headimpact_service.intake.records import describe, kinematics_document
from headimpact_service.intake.rendering import new_score, score_document
from headimpact_service.intake.scoring import DeviceFacts, Scored, digest_bytes, score_records
from headimpact_service.intake.storing import new_impact
from headimpact_service.operation import Call
from headimpact_service.routes.facts import facts_in
from headimpact_service.store import ids, impacts
from headimpact_service.store.impacts import NewImpact

PER_TRANSACTION = 100
"""Impacts that share a commit: other writers wait no longer than for these."""


@dataclass(frozen=True, slots=True)
class Item:
    """One impact of a file, and what became of it so far."""

    external_id: str | None
    outcome: Scored | Problem
    sent_digest: bytes = b""


async def score_all(call: Call, found: Sequence[ImpactRecord | Problem]) -> list[Item]:
    """Every impact scored, or its problem, in the file's order."""
    known = await deps.read(call.request, partial(_facts, call.data_set_id, found))
    return await run_sync(partial(_score_all, call, found, known))


Known = list[tuple[ImpactRecord, DeviceFacts] | None]


def _facts(data_set_id: bytes, found: Sequence[ImpactRecord | Problem], conn: Any) -> Known:  # noqa: ANN401 - a connection
    """What the devices and athletes of the records add to them; each is looked up once."""
    look_up = facts_in(conn, data_set_id)
    return [None if isinstance(record, Problem) else look_up(record) for record in found]


def _score_all(call: Call, found: Sequence[ImpactRecord | Problem], known: Known) -> list[Item]:
    scored = iter(score_records([pair for pair in known if pair is not None], call.terms))
    items = []
    for record in found:
        if isinstance(record, Problem):
            items.append(Item(record.external_id if isinstance(record, RefusedImpact) else None, record))
        else:
            items.append(Item(record.external_id, next(scored), digest_bytes(content_digest(record))))
    return items


async def store_all(call: Call, items: Sequence[Item]) -> list[dict[str, Any]]:
    """The rows of the answer, once everything is committed."""
    rows: list[dict[str, Any]] = []
    for first in range(0, len(items), PER_TRANSACTION):
        part = items[first : first + PER_TRANSACTION]
        new = await run_sync(partial(_rows, call, part))
        outcomes = await deps.write(call.request, partial(_add, call.data_set_id, new))
        for item, outcome in zip(part, outcomes, strict=True):
            rows.append(_row(len(rows), item.external_id, outcome))
    return rows


def _rows(call: Call, items: Sequence[Item]) -> list[NewImpact | Problem]:
    return [
        item.outcome if isinstance(item.outcome, Problem) else new_impact(item.outcome, item.sent_digest, call.key.id)
        for item in items
    ]


def _add(
    data_set_id: bytes,
    new: Sequence[NewImpact | Problem],
    conn: Any,  # noqa: ANN401 - a connection of the store
) -> list[impacts.Outcome | Problem]:
    """Add what can be added; a refusal comes before anything of that impact is written, so the others stay."""
    outcomes: list[impacts.Outcome | Problem] = []
    for item in new:
        try:
            outcomes.append(
                item
                if isinstance(item, Problem)
                else impacts.add(conn, data_set_id, item, same_event_is_unchanged=True)
            )
        except Problem as problem:
            outcomes.append(problem)
    return outcomes


def _row(index: int, external_id: str | None, outcome: impacts.Outcome | Problem) -> dict[str, Any]:
    if isinstance(outcome, Problem):
        return failed_row(index, external_id, outcome)
    impact_id = ids.encode("imp", outcome.impact.id)
    row = {"index": index, "external_id": external_id or outcome.impact.external_id}
    return row | {"status": outcome.status, "id": impact_id, "problem": None}


def failed_row(index: int, external_id: str | None, problem: Problem) -> dict[str, Any]:
    """The row of an impact that was refused."""
    row = {"index": index, "external_id": external_id, "status": "failed", "id": None}
    return row | {"problem": problem.as_dict()}


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
        "source": dict(record.metadata),
        "state": document["state"],
        "peaks": document["peaks"],
        "quality": document["quality"],
    }
