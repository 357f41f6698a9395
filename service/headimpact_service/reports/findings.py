"""What a reader should take from a refit, in sentences: what was found, how sure that is, and what to do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from headimpact.calibration.sample_size import events_for_expected_over_observed
from headimpact_service.reports.figures import criterion_name

FEW_EVENTS = events_for_expected_over_observed()
"""Events that E:O within 20 % needs (recalibrations with fewer are mostly noise)."""


def counted(number: int, what: str) -> str:
    """A number of things, in words that agree with it."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


@dataclass(frozen=True, slots=True)
class Finding:
    """One sentence; `kind` is good, note or warning."""

    kind: str
    text: str


def findings(report: Mapping[str, Any]) -> list[Finding]:
    """The findings of a report, the most weighty first."""
    found = [
        *_cohort(report),
        *ignored(report),
        *_gates(report),
        *_best(report),
        *_direction(report),
        *_update(report),
        *_failed(report),
    ]
    order = ("warning", "note", "good")
    return sorted(found, key=lambda finding: order.index(finding.kind))


def _cohort(report: Mapping[str, Any]) -> Iterator[Finding]:
    cohort, needed = report["cohort"], report["sample_size"]
    factor = needed["expected_over_observed_factor"]
    if cohort["events"] < FEW_EVENTS:
        yield Finding(
            "warning",
            f"{cohort['events']} concussions leave the overall level of the probabilities uncertain by a factor of "
            f"{factor:.2f} either way (95 %). {FEW_EVENTS} are needed for 20 %. Treat this as evidence for an "
            "update of the intercept at most, unless the active model is clearly wrong.",
        )
    if cohort["athletes_with_events"] < 10:
        yield Finding(
            "warning",
            f"Only {counted(cohort['athletes_with_events'], 'athlete')} had a concussion: what was learnt may be about "
            "them rather than about heads in general.",
        )


def ignored(report: Mapping[str, Any]) -> Iterator[Finding]:
    """What was given or is in the cohort, and counts otherwise than whoever gave it may think."""
    ignored = report["options"]["ignored"]
    if ignored:
        named = " and ".join(name.replace("_", " ") for name in ignored)
        yield Finding(
            "note",
            f"The {named} had no effect: in a full follow-up the incidence is the cohort's own share of concussions.",
        )
    alone = (report.get("table") or {}).get("without_athlete", 0)
    if alone:
        told = (
            "1 impact names no athlete and counts" if alone == 1 else f"{alone} impacts name no athlete and count each"
        )
        yield Finding(
            "note",
            f"{told} as one of its own: if some are of one athlete, intervals by athlete are too narrow, and figures "
            "out of fold too good.",
        )


def _gates(report: Mapping[str, Any]) -> Iterator[Finding]:
    """Of a scheduled fit: which gates hold its model back."""
    gates = report.get("gates")
    if not gates:
        return
    missed = [gate for gate in gates if not gate["passed"]]
    if not missed:
        yield Finding("good", "The model passed every gate of its schedule.")
        return
    named = ", ".join(_gate_name(gate) for gate in missed)
    yield Finding(
        "warning",
        f"The model did not pass every gate of its schedule ({named}): it is not promoted by itself, and whoever "
        "promotes it should know why that is right.",
    )


def _gate_name(gate: Mapping[str, Any]) -> str:
    name = str(gate["gate"]).replace("_", " ")
    return name if gate["criterion"] is None else f"{name} of {criterion_name(gate['criterion'])}"


def _best(report: Mapping[str, Any]) -> Iterator[Finding]:
    criteria = report["criteria"]
    judged = {
        name: one["out_of_fold"]["auc"] for name, one in criteria.items() if one["out_of_fold"]["auc"] is not None
    }
    if not judged:
        yield Finding("warning", "No criterion could be judged on athletes that it was not fitted on.")
        return
    best = max(judged, key=lambda name: (judged[name], name))
    yield Finding(
        "good",
        f"On athletes that it was not fitted on, {criterion_name(best)} tells concussions best: AUC "
        f"{judged[best]:.3f} (fitted and judged on the same impacts: {criteria[best]['auc']['value']:.3f}).",
    )
    flattered = [
        criterion_name(name) for name, value in judged.items() if criteria[name]["auc"]["value"] - value > 0.05
    ]
    if flattered:
        yield Finding(
            "note",
            "Judged on other athletes, the AUC falls by more than 0.05 for " + ", ".join(flattered) + ".",
        )


def _direction(report: Mapping[str, Any]) -> Iterator[Finding]:
    lowering = {name: one["lowers_risk"] for name, one in report["criteria"].items() if one["lowers_risk"]}
    if lowering:
        told = "; ".join(f"{criterion_name(name)} ({', '.join(parts)})" for name, parts in lowering.items())
        yield Finding(
            "warning",
            f"In these, more motion lowers the fitted risk: {told}. That is no physics but chance or confounding; a "
            "gate holds such a model back unless it is waived.",
        )


def _update(report: Mapping[str, Any]) -> Iterator[Finding]:
    if report["active"] is None:
        return
    chosen: dict[str, list[str]] = {}
    for name, one in report["criteria"].items():
        if one["update"] and one["update"]["chosen"]:
            chosen.setdefault(one["update"]["chosen"], []).append(criterion_name(name))
    meaning = {
        "original": f"{report['active']} still describes the cohort: no update is needed",
        "intercept": f"a new intercept on {report['active']} is enough",
        "recalibration": f"a new intercept and one factor on {report['active']} are enough",
        "refit": "the refit describes the cohort better than any simpler update",
    }
    for choice, names in chosen.items():
        yield Finding("note", f"Closed test: {meaning.get(choice, choice)} ({', '.join(names)}).")


def _failed(report: Mapping[str, Any]) -> Iterator[Finding]:
    for name, reason in report["failed"].items():
        yield Finding("warning", f"{criterion_name(name)} was not fitted: {reason['detail']}")
