"""Cells whose text would be taken for something else: written with an apostrophe before them, read without it.

A spreadsheet would run some as a formula; readers of tables, ours among them, take others for no value.
"""

from __future__ import annotations

import re

from headimpact_service.ingest.cells import NOTHING

_NOTHING = re.compile(rf"'*(?:{'|'.join(map(re.escape, sorted(NOTHING - {''})))})", re.IGNORECASE)
_FORMULA = re.compile(r"'*[=+\-@\t\r]")
"""What needs the guard: also a cell that looks as if it had one, so that each comes back as it went."""


def guarded(cell: str) -> str:
    """The cell as CSV has it."""
    return "'" + cell if _FORMULA.match(cell) or _NOTHING.fullmatch(cell) else cell


def unguarded(cell: str) -> str:
    """The cell that was written; another apostrophe at its start is the sender's own."""
    return cell[1:] if cell[:1] == "'" and (_FORMULA.match(cell) or _NOTHING.fullmatch(cell)) else cell


def guarded_name(cell: str) -> str:
    """The cell as a typed table has it, which no spreadsheet runs: only a name that would be taken for nothing."""
    return "'" + cell if _NOTHING.fullmatch(cell) else cell


def unguarded_name(cell: str) -> str:
    """The name that was written."""
    return cell[1:] if cell[:1] == "'" and _NOTHING.fullmatch(cell) else cell
