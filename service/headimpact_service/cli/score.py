"""`headimpact score FILE`: a table for people, or the JSON of the API."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from headimpact_service.answers import json_bytes
from headimpact_service.cli.faults import USAGE, problem_line
from headimpact_service.cli.files import is_set, zipped
from headimpact_service.cli.score_table import show
from headimpact_service.errors import Problem
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.upload import read_upload
from headimpact_service.intake.rendering import new_score, score_document, scored_traces
from headimpact_service.intake.scoring import UNKNOWN_DEVICE as NO_DEVICE
from headimpact_service.intake.scoring import Scored, Terms, score_records


def run(file: Path, fields: Mapping[str, str], *, as_json: bool) -> int:
    """Score and print; the exit code says whether every impact could be scored."""
    options = ImportOptions.from_fields(with_mapping(fields), filename=file.name)
    outcomes = _score(_bytes(file), options)
    for index, outcome in enumerate(outcomes):
        if isinstance(outcome, Problem):
            print(f"headimpact: impact {index}: {problem_line(outcome)}", file=sys.stderr)
    scored = [outcome for outcome in outcomes if isinstance(outcome, Scored)]
    if as_json:
        _print_json([_document(item) for item in scored])
    else:
        for item in scored:
            show(item.record, _document(item))
    return 0 if len(scored) == len(outcomes) else USAGE


def _bytes(file: Path) -> bytes:
    if str(file) == "-":
        return sys.stdin.buffer.read()
    if not file.is_dir():
        return file.read_bytes()
    if not is_set(file):
        raise ValueError(f"{file} is a folder, but not one set of a laboratory: score one of its files.")
    return zipped(file)


def with_mapping(fields: Mapping[str, str]) -> dict[str, str]:
    """The fields, with a mapping that was given as `@file` in place of its name."""
    given = dict(fields)
    if given.get("mapping", "").startswith("@"):
        given["mapping"] = Path(given["mapping"][1:]).read_text("utf-8")
    return given


def _score(data: bytes, options: ImportOptions) -> list[Scored | Problem]:
    found = list(read_upload(data, options))
    scored = iter(score_records([(item, NO_DEVICE) for item in found if not isinstance(item, Problem)], Terms()))
    return [item if isinstance(item, Problem) else next(scored) for item in found]


def _document(scored: Scored) -> dict[str, Any]:
    document = score_document(new_score(scored))
    if "traces" in scored.record.include:
        document["traces"] = scored_traces(scored)
    return document


def _print_json(documents: list[dict[str, Any]]) -> None:
    """One score is an object, as the API answers it; several are a list."""
    if documents:
        sys.stdout.buffer.write(json_bytes(documents[0] if len(documents) == 1 else documents) + b"\n")
