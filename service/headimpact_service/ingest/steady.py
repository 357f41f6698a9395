"""Where what a table says of an impact changes from one row to the next.

It stands in every row and is read from the first, so rows that differ belong to different impacts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from headimpact_service.ingest.cells import LineCells, Stacked, Words

Rows = NDArray[np.bool_]


def changed_rows(texts: Mapping[int, Sequence[str]], columns: Sequence[int], rows: int) -> Rows:
    """For each row, whether one of the columns differs from the row above, or may where a block of rows begins."""
    changed = np.zeros(rows, dtype=np.bool_)
    lines: list[LineCells] = []
    for column in columns:
        cells = texts[column]
        if isinstance(cells, Stacked):
            return _of_blocks(texts, columns, rows)
        if isinstance(cells, LineCells):
            lines.append(cells)
        else:
            _mark(cells, changed)
    if lines:
        _mark_lines(lines, changed)
    return changed


def _of_blocks(texts: Mapping[int, Sequence[str]], columns: Sequence[int], rows: int) -> Rows:
    """Block by block; where a block begins, something may have changed."""
    stacked = {column: cells for column in columns if isinstance(cells := texts[column], Stacked)}
    parts = zip(*(cells.parts for cells in stacked.values()), strict=True)
    found = []
    for part in parts:
        block = changed_rows(dict(zip(stacked, part, strict=True)), list(stacked), len(part[0]))
        block[:1] = True
        found.append(block)
    changed = np.concatenate(found) if found else np.zeros(rows, dtype=np.bool_)
    changed[:1] = False
    return changed


def _mark(cells: Sequence[str], changed: Rows) -> None:
    if isinstance(cells, Words):
        changed[1:] |= cells.places[1:] != cells.places[:-1]
    else:
        changed[1:] |= np.fromiter((a != b for a, b in pairwise(cells)), np.bool_, max(len(cells) - 1, 0))


def _mark_lines(columns: Sequence[LineCells], changed: Rows) -> None:
    """Columns that lines begin or end with are looked at together, as one piece of the line."""
    columns = sorted(columns, key=lambda cells: cells.column)
    front = [cells for place, cells in enumerate(columns) if cells.column == place]
    if front:
        front[-1].mark_where_beginnings_differ(changed)
    for cells in columns[len(front) :]:
        _mark(cells, changed)
