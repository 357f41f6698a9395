"""Cells of CSV that a spreadsheet would run as a formula: written with an apostrophe before them, read without it."""

from __future__ import annotations

import re

_FORMULA = re.compile(r"'*[=+\-@\t\r]")
"""What needs the guard: also a cell that looks as if it had one, so that each comes back as it went."""


def guarded(cell: str) -> str:
    """The cell as it is written."""
    return "'" + cell if _FORMULA.match(cell) else cell


def unguarded(cell: str) -> str:
    """The cell that was written; another apostrophe at its start is the sender's own."""
    return cell[1:] if cell[:1] == "'" and _FORMULA.match(cell) else cell
