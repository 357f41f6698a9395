"""Queries over many values: no more of them at a time than one statement may name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")

ASKED_AT_ONCE = 500


def in_parts(values: Iterable[T]) -> Iterator[list[T]]:
    """As many values as one query may ask for."""
    every = list(values)
    for first in range(0, len(every), ASKED_AT_ONCE):
        yield every[first : first + ASKED_AT_ONCE]
