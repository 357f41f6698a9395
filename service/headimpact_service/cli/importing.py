"""`headimpact import PATH…`: files and folders into the database, with a progress bar and a line per file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from headimpact_service.cli.database import migrated
from headimpact_service.cli.faults import USAGE, problem_line
from headimpact_service.cli.files import files_of, texts_beside
from headimpact_service.cli.score import with_mapping
from headimpact_service.errors import Problem
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.upload import read_upload, sample_count
from headimpact_service.intake.importing import (
    COUNTED,
    Item,
    look_up,
    make_ready,
    preview_row,
    score_found,
    store,
    summary,
)
from headimpact_service.intake.parts import parts
from headimpact_service.intake.registry import active_model
from headimpact_service.intake.rendering import new_score
from headimpact_service.intake.scoring import Terms, terms_of
from headimpact_service.store import organisation_settings, organisations
from headimpact_service.store.database import Database

CHUNK = 500
"""Impacts that are committed together."""
SHOWN = 5
"""Refused impacts of a file that are told one by one, and those that a dry run shows."""
NOT_SCORED = "not scored"


@dataclass(frozen=True, slots=True)
class Target:
    """Where impacts go, and what they are scored with."""

    data_set_id: bytes
    terms: Terms


def run(
    paths: Sequence[Path],
    fields: Mapping[str, str],
    *,
    organisation: str,
    mode: str,
    dry_run: bool,
    database_url: str | None,
) -> int:
    """Import every file; the exit code is 2 if any impact of any file was refused."""
    given = with_mapping(fields)
    ImportOptions.from_fields(given)  # a field that is wrong is wrong for every file: say so before the first
    files = [file for path in paths for file in files_of(path)]
    if not files:
        raise ValueError("There is no file to import in these paths.")
    console = Console(highlight=False, soft_wrap=True)
    for text in (text for path in paths for text in texts_beside(path)):
        console.print(f"{text}: passed over, a text beside the recordings", markup=False)
    failed = 0
    with migrated(database_url) as database, _progress(console) as progress:
        target = _target(database, organisation, mode)
        task = progress.add_task("", total=None)
        for label, content in files:
            options = ImportOptions.from_fields(given, filename=label.name)

            def advance(total: int, done: int, name: str = label.name) -> None:
                progress.update(task, description=name, total=total, completed=done)

            failed += _import(database, target, (label, content), options, console, advance, dry_run=dry_run)
    return USAGE if failed else 0


def _progress(console: Console) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def _target(database: Database, organisation: str, mode: str) -> Target:
    def find(conn: Any) -> Target:  # noqa: ANN401 - a connection of the store
        found = organisations.known(conn, organisation)
        settings = organisation_settings.get(conn, found.id)
        data_set = organisations.ensure_data_set(conn, found.id, cast("Literal['live', 'test']", mode))
        terms = terms_of(settings.incidence, settings.operating_points, active_model(conn, data_set))
        return Target(data_set, terms)

    return database.write(find)


def _import(
    database: Database,
    target: Target,
    file: tuple[Path, bytes | Path],
    options: ImportOptions,
    console: Console,
    advance: Callable[[int, int], None],
    *,
    dry_run: bool,
) -> int:
    """One file and its line; how many of its impacts were refused.

    It is read to its end before anything is stored: one that breaks in its midst stores nothing.
    """
    label, content = file
    try:
        total = sum(1 for _ in read_upload(content, options))
        rows: list[dict[str, Any]] = []
        noted: Counter[str] = Counter()
        for part in parts(read_upload(content, options), sample_count, CHUNK):
            rows += _chunk(database, target, part, len(rows), noted, dry_run=dry_run)
            advance(total, len(rows))
    except Problem as problem:
        console.print(f"{label}: refused: {problem_line(problem)}", markup=False)
        return 1
    except OSError as error:
        console.print(f"{label}: refused: {error.strerror or 'it cannot be read'}.", markup=False)
        return 1
    return _report(console, label, rows, noted)


def _chunk(
    database: Database, target: Target, part: Sequence[Any], first: int, noted: Counter[str], *, dry_run: bool
) -> list[dict[str, Any]]:
    with database.read() as conn:
        known = look_up(conn, target.data_set_id, part)
    items = score_found(part, known, target.terms)
    for item in items:
        noted.update(_notes(item))
    if dry_run:
        return [preview_row(index, item) for index, item in enumerate(items, first)]
    ready = make_ready(items, None)
    return database.write(lambda conn: store(conn, target.data_set_id, ready, first))


def _notes(item: Item) -> set[str]:
    """What is noted of an impact, by its codes, and whether it has no score."""
    if isinstance(item.outcome, Problem):
        return set()
    stored = new_score(item.outcome)
    return {*stored.quality_codes, *([NOT_SCORED] if stored.state == "unscorable" else [])}


def _report(console: Console, label: Path, rows: Sequence[Mapping[str, Any]], noted: Mapping[str, int]) -> int:
    counts = summary(dict(row) for row in rows)
    readable = sum(row["status"] == "readable" for row in rows)
    told = [f"{counts[name]} {name}" for name in COUNTED if counts[name] or (name == "created" and not readable)]
    console.print(f"{label}: {', '.join([f'{readable} readable', *told] if readable else told)}", markup=False)
    if noted:
        console.print(f"    noted: {', '.join(f'{code} ({noted[code]})' for code in sorted(noted))}", markup=False)
    for row in [row for row in rows if "preview" in row][:SHOWN]:
        for line in _preview_lines(row):
            console.print(f"    {line}", markup=False)
    failed = [row for row in rows if row["status"] == "failed"]
    for row in failed[:SHOWN]:
        name = row["external_id"] or f"impact {row['index']}"
        console.print(f"    {name}: {_problem_line(row['problem'])}", markup=False)
    if len(failed) > SHOWN:
        console.print(f"    and {len(failed) - SHOWN} more")
    return len(failed)


def _preview_lines(row: Mapping[str, Any]) -> Iterator[str]:
    """What was read of an impact: its signals in their own units, and what is noted."""
    preview = row["preview"]
    name = row["external_id"] or f"impact {row['index']}"
    whose = ", ".join(f"{what} {preview[what]}" for what in ("athlete", "device", "occurred_at") if preview[what])
    yield f"{name}: axes {preview['kinematics']['axes']}{', ' if whose else ''}{whose}"
    for signal, sent in preview["as_sent"].items():
        peaks = ", ".join(f"{axis} {'-' if peak is None else f'{peak:.4g}'}" for axis, peak in sent["peak"].items())
        yield (
            f"  {signal.replace('_', ' ')} [{sent['unit']}]: {sent['samples']} samples, "
            f"{sent['sample_rate_hz']:.6g} Hz, peaks {peaks}"
        )
    for note in preview["quality"]:
        yield f"  {note['severity']} {note['code']}: {note['detail']}"


def _problem_line(problem: Mapping[str, Any]) -> str:
    """As :func:`headimpact_service.cli.faults.problem_line`, of a problem as it is answered."""
    news = [error for error in problem.get("errors", ()) if error["detail"] not in problem["detail"]]
    places = "; ".join(
        f"{error.get('pointer') or error.get('parameter') or 'body'}: {error['detail']}" for error in news
    )
    return f"{problem['detail']} {places}".strip()
