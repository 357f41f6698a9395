"""Impacts in parts that are worked on together: many of them where they are short, few where they are long."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")

MAX_VALUES = 153_600
"""Samples of all channels of a part: 256 ordinary impacts, one of the longest; 1.2 MB as they are sent."""


def parts(items: Iterable[T], values_of: Callable[[T], int], most: int) -> Iterator[list[T]]:
    """Items in their order, up to `most` of them together and, unless one alone has more, up to :data:`MAX_VALUES`."""
    part: list[T] = []
    values = 0
    for item in items:
        more = values_of(item)
        if part and (len(part) == most or values + more > MAX_VALUES):
            yield part
            part, values = [], 0
        part.append(item)
        values += more
    if part:
        yield part
