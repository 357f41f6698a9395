"""The impacts of a JSON document as pieces of its text, so that a file never becomes objects as a whole.

A list of ten million empty lists is 30 MB of text and a gigabyte of objects. Only brackets and strings are looked at
here; each piece is then parsed and checked by itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from headimpact_service.errors import Problem
from headimpact_service.ingest.json_faults import MAX_MEMBERS, too_many_members

_SPACE = re.compile(rb"[ \t\n\r]*")
_LIST = re.compile(rb"""[ \t\n\r]*(?:\{[ \t\n\r]*"(?:data|impacts)"[ \t\n\r]*:[ \t\n\r]*)?\[""")
_MARK = re.compile(rb'[\[\]{}]|"[^"\\]*+(?:\\.[^"\\]*+)*+"|"', re.DOTALL)
_SCALAR = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+"|[^\s,\[\]{}":]+', re.DOTALL)
MAX_MARKS = 4 * MAX_MEMBERS
"""Brackets and strings of one impact; one of as many members as may be has fewer."""


def items(data: bytes) -> Iterator[bytes]:
    """The text of each impact: of every item of a list, or of the object `{"data": [...]}`; else the whole.

    Raises
    ------
    Problem
        422: the text is not JSON as far as its brackets, strings and commas tell.
    """
    listed = _LIST.match(data)
    if listed is None:
        yield data
        return
    place = _space(data, listed.end())
    while data[place : place + 1] != b"]":
        end = _end_of(data, place)
        yield data[place:end]
        place = _after(data, end)
    _require_end(data, place + 1, b"}" if b"{" in listed[0] else b"")


def _end_of(data: bytes, start: int) -> int:
    """Where the value that begins at `start` ends."""
    if data[start : start + 1] not in {b"{", b"["}:
        scalar = _SCALAR.match(data, start)
        if scalar is None:
            raise _not_json("a value was expected", start)
        return scalar.end()
    depth = 0
    for count, mark in enumerate(_MARK.finditer(data, start)):
        if count > MAX_MARKS:
            raise Problem("unreadable-file", too_many_members("impact").detail)
        match mark[0]:
            case b"{" | b"[":
                depth += 1
            case b"}" | b"]":
                depth -= 1
                if depth == 0:
                    return mark.end()
            case b'"':
                break
    raise _not_json("a bracket or a string is not closed", start)


def _after(data: bytes, end: int) -> int:
    """Where the next item begins, or the list's end is."""
    place = _space(data, end)
    if data[place : place + 1] == b",":
        following = _space(data, place + 1)
        if data[following : following + 1] != b"]":
            return following
    elif data[place : place + 1] == b"]":
        return place
    raise _not_json("a comma and a value, or the end of the list, was expected", place)


def _space(data: bytes, place: int) -> int:
    found = _SPACE.match(data, place)
    assert found is not None
    return found.end()


def _require_end(data: bytes, place: int, closing: bytes) -> None:
    place = _space(data, place)
    if not data.startswith(closing, place) or _space(data, place + len(closing)) != len(data):
        raise Problem("unreadable-file", f"The file holds more than a list of impacts, from byte {place} on.")


def _not_json(reason: str, place: int) -> Problem:
    return Problem("unreadable-file", f"The file is not JSON: {reason}, at byte {place}.")
