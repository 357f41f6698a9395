"""Stored impacts as a cohort of the calibration, and what a fit is asked for as the calibration takes it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from headimpact.eligibility import DUPLICATE, contradiction, exclusion_reason, first_of_each, outcome_of
from headimpact.errors import CalibrationError
from headimpact_service.store import cohorts, ids
from headimpact_service.store.cohorts import CohortFilter, LabelledImpact
from headimpact_service.store.tables import CRITERION_COLUMNS, VALUE_COLUMNS

if TYPE_CHECKING:
    from headimpact.calibration import Cohort, RefitOptions

_TIMES = frozenset({"occurred_from", "occurred_to"})


@dataclass(frozen=True, slots=True)
class Selected:
    """The impacts that may enter a fit, and how many stay out, by reason.

    `fault` is why no cohort can be made of them, although they may enter.
    """

    impacts: Sequence[LabelledImpact]
    outcomes: Sequence[float]
    excluded: Mapping[str, int]
    fault: CalibrationError | None = None

    @property
    def lines(self) -> list[str]:
        """Each impact with its revision and outcome: what tells one cohort from another."""
        return [
            f"{ids.encode('imp', impact.id)} {impact.revision} {outcome:g}"
            for impact, outcome in zip(self.impacts, self.outcomes, strict=True)
        ]


def filter_of(wanted: Mapping[str, Any]) -> CohortFilter:
    """The filter in a request or in a job's arguments."""
    names = {field.name for field in fields(CohortFilter)}
    given = {name: value for name, value in wanted.items() if name in names and value is not None}
    for name in _TIMES & given.keys():
        if isinstance(given[name], str):
            given[name] = datetime.fromisoformat(given[name])
    return CohortFilter(**given)


def select(conn: Any, data_set_id: bytes, wanted: Mapping[str, Any]) -> Selected:  # noqa: ANN401 - a connection of the store
    """The impacts of a cohort that may enter, each recording of an athlete once; the others are counted only."""
    chosen, include = filter_of(wanted), frozenset(wanted.get("include") or ())
    rows = cohorts.labelled(conn, data_set_id, chosen)
    excluded = Counter({"no_outcome": cohorts.count(conn, data_set_id, chosen) - len(rows)})
    entering, outcomes = [], []
    for row in rows:
        outcome = outcome_of(row.outcome)
        reason = exclusion_reason(
            outcome,
            event=row.event or "",
            consent=row.consent or "",
            worn=(row.context or {}).get("worn"),
            include=include,
        )
        if reason is not None:
            excluded[reason] += 1
        elif outcome is not None:
            entering.append(row)
            outcomes.append(outcome)
    firsts = first_of_each([row.input_digest and (row.athlete_id, row.input_digest) for row in entering])
    fault = contradiction(firsts, outcomes, [ids.encode("imp", row.id) for row in entering])
    once = [i for i, first in enumerate(firsts) if i == first]
    excluded[DUPLICATE] += len(entering) - len(once)
    counted = {name: number for name, number in sorted(excluded.items()) if number}
    return Selected([entering[i] for i in once], [outcomes[i] for i in once], counted, fault)


def cohort_of(selected: Selected) -> Cohort:
    """The cohort of these impacts: the same as `headimpact refit` makes of their flat export.

    Raises
    ------
    CalibrationError
        There are none, or one recording has both outcomes.
    """
    from headimpact.calibration import make_cohort

    if selected.fault is not None:
        raise selected.fault

    table = np.array(
        [[np.nan if value is None else value for value in impact.values] for impact in selected.impacts]
    ).reshape(len(selected.impacts), len(VALUE_COLUMNS))
    criteria, first = {}, 0
    for key, columns in CRITERION_COLUMNS.items():
        criteria[key] = np.ascontiguousarray(table[:, first : first + len(columns)])
        first += len(columns)
    return make_cohort(
        np.array(selected.outcomes, dtype=np.float64),
        [_athlete(impact) for impact in selected.impacts],
        criteria if selected.impacts else {},
        identities=[f"{ids.encode('imp', impact.id)} {impact.revision}" for impact in selected.impacts],
    )


def _athlete(impact: LabelledImpact) -> str:
    """An impact without an athlete stands for itself."""
    return ids.encode("imp", impact.id) if impact.athlete_id is None else ids.encode("ath", impact.athlete_id)


def options_of(fit: Mapping[str, Any]) -> RefitOptions:
    """What a request for a fit asks for.

    Raises
    ------
    CalibrationError
        A number is out of its bounds.
    """
    from headimpact.calibration import RefitOptions

    names = {field.name for field in fields(RefitOptions)}
    given = {name: value for name, value in fit.items() if name in names and value is not None}
    for name in ("criteria", "incidence_range", "sensitivity_targets"):
        if name in given:
            given[name] = tuple(given[name])
    return RefitOptions(**given)
