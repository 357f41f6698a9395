"""Decimal commas: the comma of a number is one where it cannot group thousands.

`1,250` may be either, and is a number only in a file in which some other comma is clear. `1.250` is a number unless
points part thousands where decimals have commas, between semicolons or tabs, and no other number of the file has a
point.
"""

from __future__ import annotations

import re

NUMBER = r"[+-]?[0-9]*,[0-9]+(?:[eE][+-]?[0-9]+)?"
"""With a comma, of whichever kind."""
CLEAR = r"(?![+-]?[1-9][0-9]{0,2},[0-9]{3}(?![0-9eE]))" + NUMBER
"""With one that cannot group thousands."""
MIXED = "The file's numbers have decimal commas, and points too: use one of them, and no separators of thousands."
UNCLEAR_COMMA = (
    "Whether commas in the file's numbers are decimal or group thousands is not clear: write them with a decimal point "
    "and without separators of thousands."
)
_POINTED = r"[+-]?[1-9][0-9]{0,2}\.[0-9]{3}"
CLEAR_POINT = rf"(?!{_POINTED}(?:[;\t\r\n\"]|$))[+-]?[0-9]*\.[0-9]+(?:[eE][+-]?[0-9]+)?"
"""With a point that cannot group thousands."""
IN_GROUPS = "Write numbers without separators of thousands"
UNCLEAR_POINT = (
    "Whether points in the file's numbers are decimal or group thousands is not clear: each has three digits behind it "
    f"and every other number is whole. {IN_GROUPS} or, where the points are decimal, one with another digit (1.2040)."
)
GROUPED = f"A number of the file groups its thousands, such as 1,204.5 or 1.204,5. {IN_GROUPS}."
_GROUPED = re.compile(
    r"\s*[+-]?[1-9][0-9]{0,2}(?:(?:,[0-9]{3})+\.[0-9]+|(?:\.[0-9]{3})+,[0-9]+|(?:,[0-9]{3}){2,}|(?:\.[0-9]{3}){2,})\s*",
    re.ASCII,
)
_MAY_BE_GROUPED = re.compile(rf"\s*(?:{_POINTED})\s*", re.ASCII)
_NUMBER, _CLEAR = (re.compile(rf"\s*{number}\s*", re.ASCII) for number in (NUMBER, CLEAR))


def has_comma(cell: str) -> bool:
    """Whether a cell is a number with a comma, decimal or not."""
    return _NUMBER.fullmatch(cell) is not None


def has_decimal_comma(cell: str) -> bool:
    """Whether a cell is a number whose comma is decimal whatever else stands in its file."""
    return _CLEAR.fullmatch(cell) is not None


def may_group_by_point(cell: str) -> bool:
    """Whether a cell is a number whose point may group thousands."""
    return _MAY_BE_GROUPED.fullmatch(cell) is not None


def groups_thousands(cell: str) -> bool:
    """Whether a cell is a number in which thousands are grouped, by whichever sign."""
    return _GROUPED.fullmatch(cell) is not None
