"""What the child process of a fit does: read the cohort, fit and judge it, draw its page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from headimpact.calibration import Refit, fitted_model, refit, report_document
from headimpact.errors import CalibrationError
from headimpact.model_document import model_to_document
from headimpact.risk import RiskModel
from headimpact_service.errors import Problem
from headimpact_service.intake import registry
from headimpact_service.intake.cohorts import Selected, cohort_of, options_of, select
from headimpact_service.intake.drift import drift_document
from headimpact_service.intake.gates import judge
from headimpact_service.reports.page import refit_page
from headimpact_service.store import schedules
from headimpact_service.store.database import Database


@dataclass(frozen=True, slots=True)
class Fitted:
    """A model that is ready to be registered, with the lines of the cohort that it was fitted on."""

    document: dict[str, Any]
    report: dict[str, Any]
    page: str
    lines: list[str]
    digest: str
    active: str
    """The version that it was judged against."""


@dataclass(frozen=True, slots=True)
class Skipped:
    """Why there was nothing to do."""

    reason: str
    digest: str | None = None


def compute(arguments: dict[str, Any]) -> Iterator[Fitted | Skipped]:
    """One model, or why there is none; a `cohort-unfit` problem where the cohort allows no fit."""
    database = Database(arguments["database_url"], readers=1)
    try:
        with database.read() as conn:
            selected = select(conn, arguments["data_set_id"], arguments["fit"].get("cohort") or {})
            active = registry.active_model(conn, arguments["data_set_id"])
            seen = schedules.last_seen(conn, arguments["data_set_id"], arguments.get("schedule"))
    finally:
        database.close()
    try:
        yield _fitted(arguments, selected, active, seen)
    except CalibrationError as error:
        if arguments.get("schedule") is None:
            raise Problem("cohort-unfit", str(error), extra={"excluded": dict(selected.excluded)}) from None
        yield Skipped(str(error))


def _fitted(arguments: Mapping[str, Any], selected: Selected, active: RiskModel, seen: str | None) -> Fitted | Skipped:
    fit = arguments["fit"]
    cohort = cohort_of(selected)
    if seen == cohort.digest:
        return Skipped(schedules.NOTHING_NEW, cohort.digest)
    found = refit(cohort, options_of(fit), active)
    model = fitted_model(found, arguments["version"], fit.get("title") or "")
    report = report_document(found) | {
        "table": {
            "rows": cohort.n + sum(selected.excluded.values()),
            "excluded": dict(selected.excluded),
            "without_athlete": sum(impact.athlete_id is None for impact in selected.impacts),
        },
        "model": model.version,
        "strain": None,
        "drift": drift_document(selected, active, options_of(fit).tau),
        "gates": _gates(arguments, found, model, active),
    }
    page = refit_page(found, report, model, active)
    return Fitted(model_to_document(model), report, page, selected.lines, cohort.digest, active.version)


def _gates(
    arguments: Mapping[str, Any], found: Refit, model: RiskModel, active: RiskModel
) -> list[dict[str, Any]] | None:
    """How the model did at each gate; None where nobody set any."""
    gates = arguments.get("gates")
    return None if gates is None else [judged.as_dict() for judged in judge(found, model, active, gates)]
