"""The fit of a cohort: one part, the registration of what came of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from headimpact_service.errors import Problem
from headimpact_service.intake import registry
from headimpact_service.intake.cohorts import select
from headimpact_service.jobs.runs import House, Outcome, Result, Work
from headimpact_service.store import aliases, ids, models, organisation_settings, schedules
from headimpact_service.store.jobs import Job
from headimpact_service.store.models import NewModel

_NO_MODEL: Outcome = {"version": None, "skipped": None, "promoted": False, "not_promoted": None, "gates": None}


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
        return Result(outcomes[0] if outcomes else _NO_MODEL)

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
    return {**_NO_MODEL, "skipped": skipped.reason}


def _register(job: Job, fitted: Any, conn: Any) -> Outcome:  # noqa: ANN401 - a connection of the store
    """Register the version, unless the cohort has lost an impact since it was read, or another job has learnt it."""
    if schedules.last_seen(conn, job.data_set_id, job.arguments.get("schedule")) == fitted.digest:
        return {**_NO_MODEL, "skipped": schedules.NOTHING_NEW}
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
    passed = bool(job.arguments.get("promote") and gates) and all(gate["passed"] for gate in gates)
    held = _what_holds(conn, job, version, fitted.active) if passed else None
    if passed and held is None:
        reason = f"Passed all gates of the schedule {job.arguments.get('schedule')} ({name})."
        aliases.put(conn, job.data_set_id, "active", version, reason, job.key_id)
    _note(conn, job, fitted.digest)
    return {
        "version": version,
        "skipped": None,
        "promoted": passed and held is None,
        "not_promoted": held,
        "gates": gates,
    }


def _what_holds(conn: Any, job: Job, version: str, judged_against: str) -> str | None:  # noqa: ANN401 - of the store
    """Why a model that passed its gates is not promoted all the same: what a person did meanwhile goes before."""
    active = registry.active_model(conn, job.data_set_id).version
    if active != judged_against:
        return f"It was judged against {judged_against}, but {active} is active now: promote it by hand, or fit again."
    settings = organisation_settings.of_data_set(conn, job.data_set_id)
    try:
        model = registry.model_of(conn, job.data_set_id, version)
        registry.require_promotable(model, settings.incidence, settings.operating_points)
    except Problem as problem:
        return problem.detail
    return None


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
