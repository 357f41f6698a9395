"""A table as a format hands it to the mapping: headings first, then, block by block, the columns of a layout."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
DURATION = "duration us"
"""The unit of a column whose type says that it holds times: microseconds, whatever its heading or a mapping says."""


@dataclass(frozen=True, slots=True)
class Columns:
    """Rows of a table, the columns by their index; a cell that is no number is NaN.

    Where the format itself parts impacts, `lengths` says how many rows each of them has, a block holds whole impacts,
    and `texts` have one cell an impact; else they have one cell a row. `joined` says that the headings stood again
    among these rows, as where files were joined, `spaced_apart` that blank lines part them into blocks.
    """

    rows: int
    numbers: dict[int, FloatArray]
    texts: Mapping[int, Sequence[str]]
    lengths: list[int] | None = None
    joined: bool = False
    spaced_apart: bool = False


class Table(Protocol):
    """What a tabular format gives: anything that has headings and columns."""

    @property
    def headings(self) -> tuple[str, ...]:
        """The headings, as written."""

    @property
    def units(self) -> Mapping[int, str]:
        """Units that the format states beside a heading, by column."""

    @property
    def dated(self) -> Collection[int]:
        """Columns of dates with times of day; as numbers they are microseconds since one instant or another."""

    @property
    def parted(self) -> bool:
        """Whether the format itself parts the impacts, so that every block has `lengths`."""

    @property
    def above(self) -> Sequence[Sequence[str]]:
        """The rows of cells above the headings, as far as the format gives them."""

    @property
    def beside(self) -> Sequence[Sequence[str]]:
        """Rows of what the file says elsewhere, perhaps of this table: a workbook's sheets of words before it."""

    @property
    def wordless(self) -> Collection[int]:
        """Columns whose cells cannot be read as text."""

    def has_samples(self, place: int) -> bool:
        """Whether a column may hold a number for each sample; one that does not may be read as text."""

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Columns]:
        """The asked-for columns in the order of their rows; 422 where a row does not fit the headings."""
