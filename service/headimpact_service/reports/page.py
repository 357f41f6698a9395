"""The page of a refit: one file that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from headimpact.calibration.refit import Refit
from headimpact.risk import RiskModel
from headimpact_service.reports import figures
from headimpact_service.reports.findings import findings


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("headimpact_service.reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "number": _number,
        "significant": _significant,
        "significant_interval": _significant_interval,
        "interval": _interval,
        "percent": _percent,
        "p": _p,
    }
    environment.globals["name_of"] = figures.criterion_name
    return environment


def refit_page(
    found: Refit, document: Mapping[str, Any], model: RiskModel | None, active: RiskModel | None = None
) -> str:
    """The page as HTML.

    Parameters
    ----------
    found
        The refit, which figures are drawn from.
    document
        The same as `report.json` has it, which tables are filled from.
    model
        The model that came of it; None where no criterion alone was fitted.
    active
        The model in service that it was compared with.
    """
    return (
        _environment()
        .get_template("refit.html")
        .render(
            report=document,
            model=model,
            active=active,
            ranked=_ranked(document),
            findings=findings(document),
            deviance=figures.deviance_bars(found),
            curves=figures.discrimination_curves(found),
            logistic={name: figures.logistic_curve(one, found) for name, one in found.criteria.items()},
            calibration={name: figures.calibration_curve(one) for name, one in found.criteria.items()},
            planes=figures.half_risk_planes(found),
            risk_map=None if model is None else figures.risk_map_of(model),
            compared=_compared(model, active),
            no_athletes=_without_athletes(document),
        )
    )


def _compared(model: RiskModel | None, active: RiskModel | None) -> str | None:
    return None if model is None or active is None else figures.coefficient_comparison("bam", model, active)


def _without_athletes(document: Mapping[str, Any]) -> list[str]:
    """Why criteria have no resamples by athlete, each reason once."""
    reasons = [one["bootstrap"]["by_athlete"]["reason"] for one in document["criteria"].values()]
    return list(dict.fromkeys(reason for reason in reasons if reason))


def _ranked(document: Mapping[str, Any]) -> list[str]:
    """The criteria, the largest area first."""
    criteria = document["criteria"]
    return sorted(criteria, key=lambda name: -criteria[name]["auc"]["value"])


def _number(value: float | None, digits: int = 3) -> str:
    return (
        "–"
        if value is None
        else f"{value:.{digits}g}"
        if abs(value) < 1e-3 or abs(value) >= 1e4
        else f"{value:.{digits}f}"
    )


def _significant(value: float | None) -> str:
    """Four digits that mean something, wherever the point is."""
    return "–" if value is None else f"{value:.4g}"


def _significant_interval(ends: list[float] | None) -> str:
    return "–" if ends is None else f"{_significant(ends[0])} to {_significant(ends[1])}"


def _interval(ends: list[float | None] | None, digits: int = 3) -> str:
    if ends is None:
        return "–"
    low, high = ("unbounded" if end is None else _number(end, digits) for end in ends)
    return f"{low} to {high}"


def _percent(value: float | None, digits: int = 1) -> str:
    return "–" if value is None else f"{100 * value:.{digits}f} %"


def _p(value: float | None) -> str:
    """A p value as people read it."""
    if value is None:
        return "–"
    return "< 0.0001" if value < 1e-4 else f"{value:.4f}"
