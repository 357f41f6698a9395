"""A table as a format hands it to the mapping: headings first, then the columns that a layout asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Columns:
    """The columns of a table, by index, all of one length; a cell that is no number is NaN."""

    rows: int
    numbers: dict[int, FloatArray]
    texts: dict[int, list[str]]


class Table(Protocol):
    """What a tabular format gives: CSV now, any other that has headings and columns likewise."""

    @property
    def headings(self) -> tuple[str, ...]:
        """The headings, as written."""

    def read(self, numbers: Sequence[int], texts: Sequence[int], max_rows: int) -> Columns:
        """The asked-for columns; 422 where there are more than `max_rows` rows or a row does not fit the headings."""
