"""An import that is answered at once: the file's impacts scored together, stored in a few transactions."""

from __future__ import annotations

from functools import partial
from typing import Any

from anyio.to_thread import run_sync

from headimpact_service import deps
from headimpact_service.intake.importing import Found, Item, look_up, make_ready, score_found, store
from headimpact_service.operation import Call

PER_TRANSACTION = 100
"""Impacts that share a commit: other writers wait no longer than for these."""


async def score_all(call: Call, found: Found) -> list[Item]:
    """Every impact scored, or its problem, in the file's order, under the terms that are stored now."""
    terms = (await call.renewed()).terms
    known = await deps.read(call.request, lambda conn: look_up(conn, call.data_set_id, found))
    return await run_sync(partial(score_found, found, known, terms))


async def store_all(call: Call, items: list[Item]) -> list[dict[str, Any]]:
    """The rows of the answer, once everything is committed."""
    rows: list[dict[str, Any]] = []
    for first in range(0, len(items), PER_TRANSACTION):
        ready = await run_sync(partial(make_ready, items[first : first + PER_TRANSACTION], call.key.id))
        change = partial(store, data_set_id=call.data_set_id, ready=ready, first=first)
        rows += await deps.write(call.request, change)
    return rows
