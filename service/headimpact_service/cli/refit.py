"""`headimpact refit`: from a table of criteria with outcomes to a report and a model, without any service."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from headimpact.calibration import Refit, RefitOptions, fitted_model, refit, report_document
from headimpact.errors import CalibrationError
from headimpact.model_document import MAX_VERSION, VERSION, model_from_text, model_to_document
from headimpact.risk import PUBLISHED_MODELS, RiskModel
from headimpact_service.answers import json_bytes
from headimpact_service.cli.cohort_table import CohortTable, read_cohort
from headimpact_service.cli.table_cells import TableError
from headimpact_service.reports.figures import criterion_name
from headimpact_service.reports.findings import counted, ignored
from headimpact_service.reports.page import refit_page

REPORT, PAGE, MODEL = "report.json", "report.html", "model.json"


@dataclass(frozen=True, slots=True)
class Request:
    """What the command line asked for.

    Parameters
    ----------
    options
        Of the refit, apart from folds and resamples in files.
    include
        Kinds of impacts that enter only where they are asked for.
    folds, resamples
        Files; None where they are drawn.
    active
        Version of a published model, or a model's file, to compare with; None for no comparison.
    version
        What the model is to be called; from the cohort's digest unless given.
    """

    options: Mapping[str, Any]
    include: frozenset[str]
    folds: Path | None
    resamples: Path | None
    active: str | None
    version: str | None


def run(table: Path, out: Path, request: Request) -> None:
    """Fit, and write the report, its page and the model into a folder.

    Raises
    ------
    TableError
        A file is not what it should be.
    CalibrationError
        The cohort allows no fit, or an option is out of bounds.
    """
    RefitOptions(**request.options)  # a wrong option is told before a long table is read
    active = None if request.active is None else _active(request.active)
    held = read_cohort(table, request.include)
    given: dict[str, Any] = dict(request.options)
    if request.folds is not None:
        given["folds"] = read_folds(request.folds)
    if request.resamples is not None:
        given["resamples"] = held.resamples(read_resamples(request.resamples, held.rows))
    found = refit(held.cohort, RefitOptions(**given), active)
    model = _model(found, request.version)
    document = report_document(found) | {
        "table": _table_document(held),
        "model": model and model.version,
        "strain": held.strain,
    }
    written = {
        REPORT: json_bytes(document) + b"\n",
        PAGE: refit_page(found, document, model, active).encode(),
    }
    if model is not None:
        written[MODEL] = json_bytes(model_to_document(model)) + b"\n"
    out.mkdir(parents=True, exist_ok=True)
    for name, content in written.items():
        (out / name).write_bytes(content)
    _tell(held, document, [out / name for name in written])


def _model(found: Refit, version: str | None) -> RiskModel | None:
    """The model; None where only criteria joined together were fitted, which scoring has no place for."""
    if version is not None and VERSION.fullmatch(version) is None:
        raise TableError(f"A version has 1 to {MAX_VERSION} letters, digits, dots, dashes.")
    name = version or f"refit-{found.cohort.digest.removeprefix('sha256:')[:12]}"
    try:
        return fitted_model(found, name)
    except CalibrationError as error:
        if error.code != "no-criteria":
            raise
        return None


def _active(name: str) -> RiskModel:
    if name in PUBLISHED_MODELS:
        return PUBLISHED_MODELS[name]
    path = Path(name)
    if not path.is_file():
        raise TableError(f"{name} is no published model ({', '.join(PUBLISHED_MODELS)}) and no file.")
    return model_from_text(path.read_bytes())


def _table_document(held: CohortTable) -> dict[str, Any]:
    return {
        "rows": held.rows,
        "excluded": dict(held.excluded),
        "without_athlete": held.without_athlete,
        "ignored_columns": list(held.ignored),
    }


def read_folds(path: Path) -> dict[str, int]:
    """The fold of each athlete, from lines `athlete_id,fold` under that heading.

    Raises
    ------
    TableError
        A line is not that, or gives an athlete two folds.
    """
    with path.open(encoding="utf-8-sig", newline="") as lines:
        rows = [[cell.strip() for cell in row] for row in csv.reader(lines) if row]
    if not rows or rows[0] != ["athlete_id", "fold"]:
        raise TableError("A file of folds begins with the heading athlete_id,fold.")
    folds: dict[str, int] = {}
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != 2 or not row[0] or not row[1].isdecimal():
            raise TableError(f"Line {number} of the folds: an athlete and a whole number are needed.")
        if folds.setdefault(row[0], int(row[1])) != int(row[1]):
            raise TableError(f"Line {number} of the folds gives an athlete a second fold.")
    return folds


def read_resamples(path: Path, rows: int) -> list[list[int]]:
    """Row numbers of each resample, one a line.

    Raises
    ------
    TableError
        A line is empty, or a number is not that of a row of the table.
    """
    found = []
    for number, line in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), start=1):
        cells = [cell.strip() for cell in line.split(",")]
        if not all(cell.isdecimal() for cell in cells):
            raise TableError(f"Line {number} of the resamples: whole numbers between commas are needed.")
        drawn = [int(cell) for cell in cells]
        if max(drawn) >= rows:
            raise TableError(f"Line {number} of the resamples: row numbers are 0 to {rows - 1}.")
        found.append(drawn)
    if not found:
        raise TableError("The file of resamples is empty.")
    return found


def _tell(held: CohortTable, document: Mapping[str, Any], written: Sequence[Path]) -> None:
    console = Console(highlight=False, soft_wrap=True)
    cohort = document["cohort"]
    console.print(
        f"{counted(cohort['n'], 'impact')} of {counted(cohort['athletes'], 'athlete')}, "
        f"{counted(cohort['events'], 'concussion')}; "
        f"{cohort['sampling'].replace('_', ' ')}, incidence {cohort['incidence']:.4g}"
    )
    for reason, count in held.excluded.items():
        console.print(f"{counted(count, 'row')} left out: {reason.replace('_', ' ')}")
    if held.ignored:
        console.print(f"Columns that nothing is made of: {', '.join(held.ignored)}", markup=False)
    for note in ignored(document):
        console.print(note.text)
    console.print(_summary(document))
    for name, reason in document["failed"].items():
        console.print(f"{criterion_name(name)} was not fitted: {reason['detail']}", markup=False)
    for path in written:
        console.print(f"Wrote {path}", markup=False)


def _summary(document: Mapping[str, Any]) -> Table:
    table = Table(box=None, pad_edge=False)
    for heading, justify in (("criterion", "left"), ("deviance", "right"), ("AUC", "right"), ("out of fold", "right")):
        table.add_column(heading, justify=justify)  # type: ignore[arg-type]  # one of rich's words
    for name, one in document["criteria"].items():
        numbers = (one["deviance"], one["auc"]["value"], one["out_of_fold"]["auc"])
        cells = [
            "–" if number is None else f"{number:.{digits}f}" for number, digits in zip(numbers, (1, 3, 3), strict=True)
        ]
        table.add_row(name, *cells)
    return table
