"""Members that stand twice in one object of a JSON text: a parser takes the last in silence, maybe a wrong number.

The parser that validates bodies cannot tell them, and another one would cost as much again. But colons stand in a JSON
text behind the name of each member and else in strings only: where the text has as many as what was made of it has
names and colons, no member is lost.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

_ESCAPED_COLONS = (b"\\u003a", b"\\u003A")


def repeated_members(data: bytes, made: object) -> Iterator[list[object]]:
    """Where `data`, of which the model or object `made` was made, has a member again: the steps that lead there."""
    if data.count(b":") == _colons(made) and not (b"\\" in data and any(map(data.__contains__, _ESCAPED_COLONS))):
        return
    yield from _repeated(json.loads(data, object_pairs_hook=_Members, parse_int=float), [])


def _colons(made: object) -> int:
    """How many colons the text had, if nothing of it was lost; less where values are no longer as they were sent."""
    count, rest = 0, [made]
    while rest:
        value = rest.pop()
        if isinstance(value, str):
            count += value.count(":")
        elif isinstance(value, BaseModel):
            members, names = value.__dict__, value.model_fields_set
            count += len(names)
            rest += [members[name] for name in names]
        elif isinstance(value, dict):
            count += len(value)
            rest += [*value, *value.values()]
        elif isinstance(value, list) and value and type(value[0]) is not float:  # samples have no colons
            rest += value
    return count


class _Members(list[tuple[str, Any]]):
    """An object's members as they stand."""


def _repeated(value: object, steps: list[object]) -> Iterator[list[object]]:
    if isinstance(value, _Members):
        seen: set[str] = set()
        for name, inner in value:
            if name in seen:
                yield [*steps, name]
            seen.add(name)
            yield from _repeated(inner, [*steps, name])
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            if isinstance(inner, list):
                yield from _repeated(inner, [*steps, index])
