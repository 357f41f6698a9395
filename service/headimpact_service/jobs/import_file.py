"""The import of a large file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from headimpact_service.errors import Problem
from headimpact_service.intake.importing import COUNTED, store, summary
from headimpact_service.jobs.import_score import Chunk
from headimpact_service.jobs.runs import House, Outcome, Result, Work
from headimpact_service.store import ids
from headimpact_service.store.jobs import Job

SHOWN = 1000
"""Refused impacts that a result lists; it counts them all."""


class ImportFile:
    """Each part is some hundred impacts, committed together."""

    name = "import"

    def run(self, work: Work) -> None:
        """Go on behind the parts that are committed."""
        with work.computing("headimpact_service.jobs.import_compute:compute", self._arguments(work)) as values:
            for value in values:
                if isinstance(value, Chunk):
                    room = SHOWN - sum(len(outcome["failed"]) for outcome in work.outcomes)
                    work.commit(value.number, len(value.ready), partial(_store, work.job.data_set_id, value, room))
                else:
                    work.expect(value)
        counts = self.result(work.outcomes).short["summary"]
        if counts["failed"] and not counts["created"] + counts["unchanged"]:
            detail = f"None of the file's {counts['failed']} impacts could be stored; `result` says why."
            raise Problem("unreadable-file", detail)

    def result(self, outcomes: Sequence[Outcome]) -> Result:
        """How many were created, unchanged and failed, and the first of those that failed."""
        counts = {name: sum(outcome["summary"][name] for outcome in outcomes) for name in COUNTED}
        failed = [row for outcome in outcomes for row in outcome["failed"]]
        return Result({"summary": counts, "failed_not_shown": counts["failed"] - len(failed)}, {"failed": failed})

    def clean(self, job: Job, house: House) -> None:
        """Delete the upload."""
        house.uploads.remove(ids.encode("job", job.id))

    def _arguments(self, work: Work) -> dict[str, Any]:
        job = work.job
        sent: Mapping[str, Any] = job.arguments
        return {
            **sent,
            "path": str(work.house.uploads.path(ids.encode("job", job.id))),
            "database_url": work.house.database.url.render_as_string(hide_password=False),
            "data_set_id": job.data_set_id,
            "key_id": job.key_id,
            "total": job.total,
            "first": len(work.outcomes),
        }


def _store(data_set_id: bytes, chunk: Chunk, room: int, conn: Any) -> Outcome:  # noqa: ANN401 - a connection of the store
    """`room` is how many refused impacts may still be kept to be shown."""
    rows = store(conn, data_set_id, chunk.ready, chunk.first)
    failed = [row for row in rows if row["status"] == "failed"]
    return {"summary": summary(rows), "failed": failed[: max(0, room)]}
