"""The re-score of stored impacts under another version: each part some hundred impacts, each once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from headimpact_service.errors import Problem
from headimpact_service.jobs.runs import House, Outcome, Result, Work
from headimpact_service.store import impacts, scores
from headimpact_service.store.jobs import Job

COUNTED = ("scored", "unchanged", "changed", "failed")
"""`changed` were corrected or deleted while the job ran: their scores are of what they are now."""


class Rescore:
    """Goes through the impacts in the order of their ids, up to the last that was there when the job was ordered."""

    name = "rescore"

    def run(self, work: Work) -> None:
        """Go on behind the parts that are committed."""
        with work.computing(
            "headimpact_service.jobs.rescore_compute:compute", self._arguments(work), strange=False
        ) as values:
            for value in values:
                if isinstance(value, int):
                    work.expect(value)
                else:
                    done = len(value.scores) + value.failed
                    work.commit(value.number, done, partial(_store, work.job, value))

    def result(self, outcomes: Sequence[Outcome]) -> Result:
        """How many impacts have a new score, and why the others have none."""
        return Result({"summary": {name: sum(outcome[name] for outcome in outcomes) for name in COUNTED}})

    def clean(self, job: Job, house: House) -> None:
        """Nothing is kept outside the database."""

    def _arguments(self, work: Work) -> dict[str, Any]:
        job, done = work.job, work.outcomes
        return {
            **job.arguments,
            "database_url": work.house.database.url.render_as_string(hide_password=False),
            "data_set_id": job.data_set_id,
            "total": job.total,
            "first": len(done),
            # Identifiers grow with time: what comes later than the order is not the job's.
            "until": job.id,
            "after": done[-1]["last"] if done else bytes(16).hex(),
        }


def _store(job: Job, part: Any, conn: Any) -> Outcome:  # noqa: ANN401 - of the child; a connection of the store
    counts = dict.fromkeys(COUNTED, 0) | {"failed": part.failed}
    for impact_id, revision, new in part.scores:
        counts[_store_one(job, impact_id, revision, new, conn)] += 1
    return counts | {"last": part.last.hex()}


def _store_one(job: Job, impact_id: bytes, revision: int, new: Any, conn: Any) -> str:  # noqa: ANN401 - a connection of the store
    present = impacts.get(conn, job.data_set_id, impact_id)
    if present is None or present.revision != revision:
        return "changed"
    try:
        _, made = scores.add(conn, job.data_set_id, impact_id, new, make_current=job.arguments["make_current"])
    except Problem:
        return "changed"
    return "scored" if made else "unchanged"
