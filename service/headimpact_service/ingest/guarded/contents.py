"""What a file of a guarded format holds: tables with their names, or impacts as lines of JSON."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from headimpact_service.errors import Problem
from headimpact_service.ingest.table import Table

MAX_COLUMNS = 1024
MAX_HEADING = 200
MAX_TEXT = 1000


@dataclass(frozen=True, slots=True)
class NamedTable:
    """One table of a file; `name` where the file names it, as a workbook does its sheets."""

    name: str | None
    table: Table


@dataclass(frozen=True, slots=True)
class Lines:
    """Impacts as JSON, one a line, in pieces of any length."""

    pieces: Iterable[bytes]


Content = NamedTable | Lines


def checked_headings(headings: Iterable[str]) -> tuple[str, ...]:
    """Headings under the bounds of any table."""
    kept = tuple(headings)
    if len(kept) > MAX_COLUMNS:
        raise unreadable(f"A file may have at most {MAX_COLUMNS} columns.")
    return tuple(heading[:MAX_HEADING] for heading in kept)


def checked_text(text: str) -> str:
    """A cell of text under the bound of any cell."""
    if len(text) > MAX_TEXT:
        raise unreadable(f"A cell of text may have at most {MAX_TEXT} characters.")
    return text


def unreadable(detail: str) -> Problem:
    """The 422 of a file as a whole."""
    return Problem("unreadable-file", detail)
