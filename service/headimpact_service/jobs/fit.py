"""The fit of a cohort: one part, the registration of what came of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from headimpact_service.errors import Problem
from headimpact_service.intake.cohorts import select
from headimpact_service.jobs.runs import House, Outcome, Result, Work
from headimpact_service.store import aliases, ids, models, schedules
from headimpact_service.store.jobs import Job
from headimpact_service.store.models import NewModel


class Fit:
    """Computed in a child process, stored in one transaction: a version, its report, and the alias `candidate`."""

    name = "fit"

    def run(self, work: Work) -> None:
        """Fit, unless the one part was committed already."""
        if work.outcomes:
            return
        work.expect(1)
        with work.computing(
            "headimpact_service.jobs.fit_compute:compute", self._arguments(work), strange=False
        ) as values:
            for value in values:
                # What a fit came to is known by its members: its class would load all of statistics here.
                store = _register if hasattr(value, "document") else _skip
                work.commit(0, 1, partial(store, work.job, value))

    def result(self, outcomes: Sequence[Outcome]) -> Result:
        """The version, or why there is none."""
        return Result(outcomes[0] if outcomes else {"version": None, "skipped": None, "promoted": False, "gates": None})

    def clean(self, job: Job, house: House) -> None:
        """Nothing is kept outside the database."""

    def _arguments(self, work: Work) -> dict[str, Any]:
        job = work.job
        return {
            **job.arguments,
            "version": job.arguments["fit"].get("version") or _version(job),
            "database_url": work.house.database.url.render_as_string(hide_password=False),
            "data_set_id": job.data_set_id,
        }


def _version(job: Job) -> str:
    """A name that the same job always gets."""
    return f"fit-{job.created_at:%Y%m%d}-{ids.encode('job', job.id)[-8:]}"


def _skip(job: Job, skipped: Any, conn: Any) -> Outcome:  # noqa: ANN401 - of the child; a connection of the store
    _note(conn, job, skipped.digest)
    return {"version": None, "skipped": skipped.reason, "promoted": False, "gates": None}


def _register(job: Job, fitted: Any, conn: Any) -> Outcome:  # noqa: ANN401 - a connection of the store
    """Register the version, unless the cohort has lost an impact since it was read."""
    _require_whole(conn, job, fitted.lines)
    version = fitted.document["version"]
    new = NewModel(
        version=version,
        document=fitted.document,
        report=fitted.report,
        page=fitted.page,
        cohort="\n".join(fitted.lines),
        schedule=job.arguments.get("schedule"),
        job_id=job.id,
        key_id=job.key_id,
    )
    models.add(conn, job.data_set_id, new)
    name = ids.encode("job", job.id)
    aliases.put(conn, job.data_set_id, "candidate", version, f"Fitted by {name}.", job.key_id)
    gates = fitted.report["gates"]
    promoted = bool(job.arguments.get("promote") and gates) and all(gate["passed"] for gate in gates)
    if promoted:
        reason = f"Passed all gates of the schedule {job.arguments.get('schedule')} ({name})."
        aliases.put(conn, job.data_set_id, "active", version, reason, job.key_id)
    _note(conn, job, fitted.digest)
    return {"version": version, "skipped": None, "promoted": promoted, "gates": gates}


def _note(conn: Any, job: Job, digest: str | None) -> None:  # noqa: ANN401 - a connection of the store
    schedule = job.arguments.get("schedule")
    if schedule is not None and digest is not None:
        schedules.note_fit(conn, job.data_set_id, schedule, digest)


def _require_whole(conn: Any, job: Job, lines: Sequence[str]) -> None:  # noqa: ANN401 - a connection of the store
    wanted: Mapping[str, Any] = job.arguments["fit"].get("cohort") or {}
    gone = len(set(lines) - set(select(conn, job.data_set_id, wanted).lines))
    if gone:
        impacts = "an impact was" if gone == 1 else f"{gone} impacts were"
        raise Problem(
            "cohort-changed",
            f"While the cohort was fitted, {impacts} deleted, corrected, labelled anew, or withdrawn. Fit it again.",
        )
