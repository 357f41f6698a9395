"""A table of criteria with outcomes, CSV or Parquet, as a cohort: the columns of the flat export of impacts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isinf, nan
from pathlib import Path
from typing import Any

import numpy as np

from headimpact.calibration import Cohort, make_cohort
from headimpact.criteria import CRITERION_KEYS
from headimpact.eligibility import DUPLICATE, contradiction, exclusion_reason, first_of_each, outcome_of
from headimpact.errors import CalibrationError
from headimpact_service.cli.strain_table import COLUMNS as STRAINS
from headimpact_service.cli.strain_table import RESULTANT, strain_document
from headimpact_service.cli.table_cells import RowError, TableError, read_cells
from headimpact_service.ingest.formula_cells import unguarded
from headimpact_service.store.tables import CRITERION_COLUMNS

REQUIRED = ("athlete_id", "outcome")
READ_TOO = ("id", "revision", "event", "athlete_consent", "worn", "input_digest")
NOTHING = frozenset({"", "NA"})
"""Cells without a value; R writes the second."""
IMPACT_ID = "imp_"
"""How the service's own ids begin; in other tables a column `id` may be anything."""
TRUTHS = {"true": "1", "false": "0"}
"""Outcomes of data frames whose column is logical, whatever their case."""


@dataclass(frozen=True, slots=True)
class CohortTable:
    """A cohort, and what was not taken from its table.

    Parameters
    ----------
    cohort
        The impacts that enter.
    row_numbers
        The 0-based row of the table that each stood in, in the order in which they came in.
    rows
        Rows of the table.
    excluded
        How many rows stayed out, by reason.
    without_athlete
        How many of those that enter name no athlete.
    ignored
        Columns that nothing is made of.
    strain
        Regressions of finite-element results, where the table has some, on all of its rows.
    """

    cohort: Cohort
    row_numbers: tuple[int, ...]
    rows: int
    excluded: Mapping[str, int]
    without_athlete: int
    ignored: tuple[str, ...]
    strain: Mapping[str, Any] | None

    def resamples(self, drawn: Sequence[Sequence[int]]) -> list[list[int]]:
        """Rows of the table as positions among those that entered.

        Raises
        ------
        TableError
            A resample draws a row that is not in the cohort.
        """
        position = {number: i for i, number in enumerate(self.row_numbers)}
        found = []
        for line, rows in enumerate(drawn, start=1):
            absent = next((row for row in rows if row not in position), None)
            if absent is not None:
                raise TableError(f"Resample {line} draws row {absent} (from 0), which is not in the cohort.")
            found.append([position[row] for row in rows])
        return found


def read_cohort(path: Path, include: frozenset[str] = frozenset()) -> CohortTable:
    """Read a table.

    Parameters
    ----------
    path
        A CSV file (gzip or not) or a Parquet file, told apart by its content.
    include
        Kinds of impacts that enter only where they are asked for.

    Raises
    ------
    TableError
        A column is missing, or a cell is not what its column holds.
    CalibrationError
        No row of the table enters, or one recording has both outcomes.
    """
    cells = read_cells(path)
    try:
        return _cohort_table(cells.columns, include)
    except RowError as fault:
        raise cells.located(fault) from None


def _cohort_table(columns: Mapping[str, Sequence[Any]], include: frozenset[str]) -> CohortTable:
    missing = [name for name in REQUIRED if name not in columns]
    if missing:
        raise TableError(f"The table has no column {missing[0]}; its columns are: {', '.join(list(columns)[:30])}.")
    keys = _criteria(columns)
    _require_once(columns)
    outcome = [_outcome(cell, row) for row, cell in enumerate(columns["outcome"])]
    reasons = _without_duplicates(columns, outcome, _exclusions(columns, outcome, include))
    entering = [row for row, reason in enumerate(reasons) if reason is None]
    athletes = _athletes(columns, entering)
    criteria = {key: np.stack([_numbers(columns, name, entering) for name in keys[key]], axis=1) for key in keys}
    excluded = Counter(reason for reason in reasons if reason is not None)
    if not entering:
        told = ", ".join(f"{count} {reason}" for reason, count in sorted(excluded.items()))
        raise CalibrationError("no-impacts", f"No row of the table enters the cohort ({told or 'it has no rows'}).")
    known = np.array([outcome[row] for row in entering], dtype=np.float64)
    read = {name for names in keys.values() for name in names} | {*REQUIRED, *READ_TOO, *STRAINS, RESULTANT}
    return CohortTable(
        make_cohort(known, athletes, criteria, identities=_identities(columns, entering)),
        tuple(entering),
        len(outcome),
        dict(sorted(excluded.items())),
        sum(not _text(columns["athlete_id"][row]) for row in entering),
        tuple(name for name in columns if name not in read),
        _strain(columns, keys),
    )


def _strain(columns: Mapping[str, Sequence[Any]], keys: Mapping[str, Sequence[str]]) -> Mapping[str, Any] | None:
    rows = range(len(columns["outcome"]))
    strains = {name: _numbers(columns, name, rows) for name in STRAINS if name in columns}
    bam = np.stack([_numbers(columns, name, rows) for name in keys["bam"]], axis=1) if "bam" in keys else None
    resultant = _numbers(columns, RESULTANT, rows)[:, None] if strains and RESULTANT in columns else None
    return strain_document(strains, bam, resultant)


def _criteria(columns: Mapping[str, Any]) -> dict[str, list[str]]:
    """The columns of each criterion that the table has."""
    found = {}
    for key, names in CRITERION_COLUMNS.items():
        there = [name for name in names if name in columns]
        if there and there != list(names):
            lacking = next(name for name in names if name not in columns)
            raise TableError(f"The table has {there[0]} but no {lacking}: {key} has three components.")
        if there:
            found[key] = list(names)
    if not found:
        raise TableError(
            f"The table has no column of a criterion; such are: bam_x, bam_y, bam_z, {', '.join(CRITERION_KEYS[2:4])}."
        )
    return found


def _text(cell: Any) -> str:  # noqa: ANN401 - a cell of any type
    if cell is None or cell != cell:
        return ""
    if isinstance(cell, bool):
        return str(int(cell))
    return unguarded(str(cell).strip())


def _outcome(cell: Any, row: int) -> float | None:  # noqa: ANN401 - a cell of any type
    word = _text(cell)
    try:
        return outcome_of("" if word in NOTHING else TRUTHS.get(word.lower(), word))
    except CalibrationError as error:
        raise RowError(f", column outcome: {error}", row) from None


def _require_once(columns: Mapping[str, Sequence[Any]]) -> None:
    """Refuse a table in which one of the service's impacts stands twice: it would count twice, or contradict itself."""
    first: dict[str, int] = {}
    for row, cell in enumerate(columns.get("id", ())):
        name = _text(cell)
        if name.startswith(IMPACT_ID) and first.setdefault(name, row) != row:
            labels = [_text(columns["outcome"][at]) or "nothing" for at in (first[name], row)]
            told = "twice" if labels[0] == labels[1] else f"with the outcomes {' and '.join(labels)}"
            raise RowError(f": the impact {name} stands there {told}.", first[name], row)


def _exclusions(
    columns: Mapping[str, Sequence[Any]], outcome: Sequence[float | None], include: frozenset[str]
) -> list[str | None]:
    def cells(name: str) -> Sequence[Any]:
        return columns.get(name) or [None] * len(outcome)

    return [
        exclusion_reason(found, event=_text(event), consent=_text(consent), worn=_flag(worn, row), include=include)
        for row, (found, event, consent, worn) in enumerate(
            zip(outcome, cells("event"), cells("athlete_consent"), cells("worn"), strict=True)
        )
    ]


def _without_duplicates(
    columns: Mapping[str, Sequence[Any]], outcome: Sequence[float | None], reasons: Sequence[str | None]
) -> list[str | None]:
    """The same reasons, and one for each row whose recording entered as another impact of its athlete.

    The first is that of the first id, as in the service, whatever the order of the rows.
    """
    digests = columns.get("input_digest")
    if digests is None:
        return list(reasons)
    ids = columns.get("id") or [""] * len(reasons)
    rows = sorted((row for row, reason in enumerate(reasons) if reason is None), key=lambda row: (_text(ids[row]), row))
    keys = [(_text(columns["athlete_id"][row]), _text(digests[row])) for row in rows]
    firsts = first_of_each([key if key[1] else None for key in keys])
    names = [_text(ids[row]) or f"the row of {digests[row]}" for row in rows]
    fault = contradiction(firsts, [outcome[row] or 0.0 for row in rows], names)
    if fault is not None:
        raise fault
    repeated = {rows[i] for i, first in enumerate(firsts) if i != first}
    return [DUPLICATE if row in repeated else reason for row, reason in enumerate(reasons)]


def _flag(cell: Any, row: int) -> bool | None:  # noqa: ANN401 - a cell of any type
    word = _text(cell).lower()
    if word not in {"", "true", "false", "1", "0"}:
        raise RowError(", column worn: true, false or nothing is needed.", row)
    return None if word == "" else word in {"true", "1"}


def _athletes(columns: Mapping[str, Sequence[Any]], rows: Sequence[int]) -> list[str]:
    """The athlete of each row; an impact without one stands for itself."""
    impacts = columns.get("id")
    names = []
    for row in rows:
        name = _text(columns["athlete_id"][row])
        names.append(name or (_text(impacts[row]) if impacts else "") or f"row {row}")
    return names


def _numbers(columns: Mapping[str, Sequence[Any]], name: str, rows: Sequence[int]) -> np.ndarray[Any, Any]:
    found = np.empty(len(rows))
    for i, row in enumerate(rows):
        cell = columns[name][row]
        if cell is None or cell in NOTHING:
            found[i] = nan
            continue
        try:
            found[i] = float(cell)
        except (TypeError, ValueError):
            found[i] = inf
        if isinf(found[i]):
            raise RowError(f", column {name}: a finite number or an empty cell is needed.", row)
    return found


def _identities(columns: Mapping[str, Sequence[Any]], rows: Sequence[int]) -> list[str]:
    """Id and revision of each impact, as the service knows them; none where the table lacks some."""
    if "id" not in columns or "revision" not in columns:
        return []
    parts = [(_text(columns["id"][row]), _text(columns["revision"][row])) for row in rows]
    return [] if any("" in part for part in parts) else [" ".join(part) for part in parts]
