"""Cells whose text would be taken for something else: written with an apostrophe before them, read without it.

A spreadsheet would run some as a formula; readers of tables, ours among them, take others for no value or for a number.
"""

from __future__ import annotations

import re

from headimpact_service.ingest.cells import NOTHING

_WHOLE = r"(?:0|[1-9][0-9]{0,14})\.0"
"""A whole number as a data frame writes it that also has empty cells in its column."""
_WORDS = "|".join(map(re.escape, sorted(NOTHING - {""})))
_OTHERWISE = re.compile(rf"'*\s*(?:{_WORDS}|{_WHOLE})\s*", re.IGNORECASE)
"""Also between blanks, which readers of tables take off."""
_FORMULA = re.compile(r"'*[=+\-@\t\r]")
"""What needs the guard: also a cell that looks as if it had one, so that each comes back as it went."""


def guarded(cell: str) -> str:
    """The cell as CSV has it."""
    return "'" + cell if _FORMULA.match(cell) or _OTHERWISE.fullmatch(cell) else cell


def unguarded(cell: str) -> str:
    """The cell that was written; another apostrophe at its start is the sender's own."""
    return cell[1:] if cell[:1] == "'" and (_FORMULA.match(cell) or _OTHERWISE.fullmatch(cell)) else cell


def guarded_name(cell: str) -> str:
    """The cell as a typed table has it, which no spreadsheet runs: only a name that would be taken for another."""
    return "'" + cell if _OTHERWISE.fullmatch(cell) else cell


def unguarded_name(cell: str) -> str:
    """The name that was written."""
    return cell[1:] if cell[:1] == "'" and _OTHERWISE.fullmatch(cell) else cell


def name_in(cell: str, *, typed: bool = False) -> str:
    """The name in a cell: a whole number that is written as a float is that number, unless it is guarded.

    One rule for every table, as those of a format with types know no difference between 7 and 7.0.
    """
    if re.fullmatch(_WHOLE, cell):
        return cell.removesuffix(".0")
    return unguarded_name(cell) if typed else unguarded(cell)
