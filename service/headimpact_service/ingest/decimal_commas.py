"""Decimal commas: the comma of a number is one where it cannot group thousands.

`1,250` may be either, and is a number only in a file in which some other comma is clear.
"""

from __future__ import annotations

import re

NUMBER = r"[+-]?[0-9]*,[0-9]+(?:[eE][+-]?[0-9]+)?"
"""With a comma, of whichever kind."""
CLEAR = r"(?![+-]?[1-9][0-9]{0,2},[0-9]{3}(?![0-9eE]))" + NUMBER
"""With one that cannot group thousands."""
MIXED = "The file's numbers have decimal commas, and points too: use one of them."
_NUMBER, _CLEAR = (re.compile(rf"\s*{number}\s*", re.ASCII) for number in (NUMBER, CLEAR))


def has_comma(cell: str) -> bool:
    """Whether a cell is a number with a comma, decimal or not."""
    return _NUMBER.fullmatch(cell) is not None


def has_decimal_comma(cell: str) -> bool:
    """Whether a cell is a number whose comma is decimal whatever else stands in its file."""
    return _CLEAR.fullmatch(cell) is not None
