"""A CSV of labels: a line for each impact, each checked alone: a bad one keeps no other out."""

from __future__ import annotations

import csv
import io
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pydantic import BaseModel
from pydantic_core import to_json

from headimpact_service.errors import Problem
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.formula_cells import name_in, unguarded
from headimpact_service.ingest.json_faults import parse
from headimpact_service.ingest.text_facts import delimiter_of

MAX_ROWS = 50_000
IMPACT = ("impact_id", "external_id")
"""A line names its impact by one of these."""


@dataclass(frozen=True, slots=True)
class LabelLine:
    """One line: which impact, and what is said of it, or why the line cannot be taken."""

    index: int
    impact_id: str | None
    external_id: str | None
    said: BaseModel | Problem


def read_labels(data: bytes, model: type[BaseModel]) -> list[LabelLine]:
    """The lines of a table with columns of `model` and one or both of :data:`IMPACT`.

    Two lines that say different things of one impact are both refused: nobody could say which one holds.

    Raises
    ------
    Problem
        422 for what is no such table.
    """
    rows = _rows(data)
    header = [name.strip() for name in next(rows, [])]
    _require_columns(header, model)
    lines = []
    for index, cells in enumerate(rows):
        if index >= MAX_ROWS:
            raise file_fault(f"A table of labels has at most {MAX_ROWS} lines.", "table")
        lines.append(_line(index, header, cells, model))
    return _without_contradictions(lines)


def _rows(data: bytes) -> Iterator[list[str]]:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise file_fault("The table is not text in UTF-8.", "table") from None
    heading = next((line for line in text.splitlines() if line.strip()), "")
    delimiter = delimiter_of(heading) if heading else ","
    try:
        yield from (row for row in csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True) if row)
    except csv.Error as error:
        raise file_fault(f"The table is no CSV: {error}.", "table") from None


def _require_columns(header: Sequence[str], model: type[BaseModel]) -> None:
    known = (*IMPACT, *model.model_fields)
    if not any(name in header for name in IMPACT):
        raise file_fault("The table needs a column impact_id or external_id.", "table")
    missing = [name for name, field in model.model_fields.items() if field.is_required() and name not in header]
    if missing:
        raise file_fault(f"The table has no column {missing[0]}.", "table")
    if len(set(header)) < len(header):
        raise file_fault("The table has a column twice.", "table")
    if any(name not in known for name in header):
        raise file_fault(f"Columns of a table of labels are: {', '.join(known)}.", "table")


def _line(index: int, header: Sequence[str], cells: Sequence[str], model: type[BaseModel]) -> LabelLine:
    if len(cells) != len(header):
        fault = Problem(
            "invalid-payload", f"The line has {len(cells)} cells where the table has {len(header)} columns."
        )
        return LabelLine(index, None, None, fault)
    told = ((name, cell.strip()) for name, cell in zip(header, cells, strict=True))
    values = {name: name_in(cell) if name in IMPACT else unguarded(cell) for name, cell in told}
    given = {name: cell for name, cell in values.items() if cell}
    impact_id, external_id = given.pop("impact_id", None), given.pop("external_id", None)
    if impact_id is None and external_id is None:
        fault = Problem("invalid-payload", "The line names no impact.")
        return LabelLine(index, None, None, fault)
    return LabelLine(index, impact_id, external_id, _said(given, model))


def _said(given: Mapping[str, str], model: type[BaseModel]) -> BaseModel | Problem:
    try:
        return parse(to_json(given), model, what="line")
    except Problem as problem:
        return problem


def _without_contradictions(lines: Sequence[LabelLine]) -> list[LabelLine]:
    said: defaultdict[tuple[str | None, str | None], list[BaseModel]] = defaultdict(list)
    for line in lines:
        if isinstance(line.said, BaseModel):
            said[_name(line)].append(line.said)
    contradicted = {name for name, found in said.items() if any(one != found[0] for one in found)}
    conflict = Problem("label-conflict", "Another line of the table says something else of this impact.")
    return [
        LabelLine(line.index, line.impact_id, line.external_id, conflict)
        if _name(line) in contradicted and isinstance(line.said, BaseModel)
        else line
        for line in lines
    ]


def _name(line: LabelLine) -> tuple[str | None, str | None]:
    return (line.impact_id, None) if line.impact_id is not None else (None, line.external_id)
