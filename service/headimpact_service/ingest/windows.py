"""The rows of a table parted into impacts, a window of them at a time: a file need not fit into memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from operator import itemgetter

import numpy as np

from headimpact_service.errors import Problem
from headimpact_service.ingest.cells import Stacked, said
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.steady import changed_rows
from headimpact_service.ingest.table import Columns

WINDOW_ROWS = 65_536
"""A file of no more rows may mix the rows of its impacts as it likes; in a longer one they stand near each other."""
MAX_ROWS = 200_000_000

Rows = slice | list[int]


def numbers_of(rows: Rows) -> Sequence[int]:
    """The numbers of rows, one by one."""
    return range(rows.start, rows.stop) if isinstance(rows, slice) else rows


@dataclass(frozen=True, slots=True)
class Window:
    """Some rows of a table and the impacts in them, in the order in which these begin; `first` is its first row."""

    columns: Columns
    impacts: list[Rows]
    first: int


def windows(
    blocks: Iterable[Columns],
    keys: Sequence[int],
    *,
    parted: bool,
    max_single: int,
    may_space: bool = True,
    may_part: bool = True,
) -> Iterator[Window]:
    """The impacts of a table: as its format parts them, by the columns `keys`, or all rows as one impact.

    Blocks of rows that blank lines part are one impact only where they `may_space`: times or the sender say so. Those
    of one key that stand apart are one only where they `may_part`: times put them in order.

    Raises
    ------
    Problem
        422: a single impact of more than `max_single` rows or in blocks, too many rows, or rows of one impact that
        stand too far apart.
    """
    if parted:
        yield from _parted(blocks)
    elif keys:
        yield from _keyed(blocks, keys, may_part=may_part)
    else:
        yield from _single(blocks, max_single, may_space=may_space)


def _parted(blocks: Iterable[Columns]) -> Iterator[Window]:
    first = 0
    for block in blocks:
        stops = np.cumsum(block.lengths or [0], dtype=np.int64).tolist()
        impacts: list[Rows] = [slice(a, b) for a, b in zip([0, *stops[:-1]], stops, strict=True)]
        if block.lengths:
            yield Window(block, impacts, first)
        first = _counted(first, block.rows)


def _single(blocks: Iterable[Columns], max_rows: int, *, may_space: bool) -> Iterator[Window]:
    held: list[Columns] = []
    count = 0
    for block in blocks:
        held.append(block)
        count += block.rows
        if block.joined:
            raise file_fault(
                "The headings stand again among the samples: if files of several impacts were joined, tell them apart "
                "by a column impact_id or a mapping's group_by.",
                "several-impacts",
            )
        if block.spaced_apart and not may_space:
            raise file_fault(
                "Blank lines part the rows, as between impacts, and the samples have no times: tell impacts apart by a "
                "column impact_id or a mapping's group_by, or say with an empty one that all rows are one impact.",
                "several-impacts",
            )
        if count > max_rows:
            raise _unreadable(f"An impact may have at most {max_rows} samples; a mapping's group_by parts a file.")
    if count:
        yield Window(_stacked(held), [slice(0, count)], 0)


def _keyed(blocks: Iterable[Columns], keys: Sequence[int], *, may_part: bool) -> Iterator[Window]:
    parting = _Parting(keys, may_part=may_part)
    held: list[Columns] = []
    first = count = 0
    for block in blocks:
        held.append(block)
        count += block.rows
        if count >= WINDOW_ROWS:
            window, rest = parting.window(_stacked(held), first)
            # a copy, and no block kept: what is given away is the only one to hold its rows
            first, held, count = _counted(first, count - rest.rows), [_copied(rest)], rest.rows
            del block, rest
            if window is not None:
                yield window
            del window
    if count:
        yield parting.last_window(_stacked(held), first)


class _Parting:
    """Parts windows of rows by their keys, and remembers which impacts were given away."""

    def __init__(self, keys: Sequence[int], *, may_part: bool) -> None:
        self._keys = keys
        self._may_part = may_part
        self._given: set[tuple[str, ...]] = set()

    def window(self, columns: Columns, first: int) -> tuple[Window | None, Columns]:
        """The impacts that are complete, and the rows of the last run, which may go on."""
        runs = self._runs(columns)
        _require_filled(runs, first)
        key, last = runs[-1]
        if last.start == 0:
            raise _unreadable(f"More than {WINDOW_ROWS} rows belong to one impact.")
        if any(other == key for other, _ in runs[:-1]):
            raise _unreadable(_APART)
        return self._window(_cut(columns, 0, last.start), runs[:-1], first), _cut(columns, last.start, columns.rows)

    def last_window(self, columns: Columns, first: int) -> Window:
        """The impacts of what is left."""
        runs = self._runs(columns)
        _require_filled(runs, first)
        return self._window(columns, runs, first)

    def _runs(self, columns: Columns) -> list[tuple[tuple[str, ...], slice]]:
        """Rows of one key that follow each other."""
        changed = changed_rows(columns.texts, self._keys, columns.rows)
        changed[:1] = True
        starts = np.flatnonzero(changed).tolist()
        keys = [tuple(said(columns.texts[index][row]) for index in self._keys) for row in starts]
        _require_one_nothing(columns, self._keys, [row for row, key in zip(starts, keys, strict=True) if not any(key)])
        runs: list[tuple[tuple[str, ...], slice]] = []
        for key, pieces in groupby(zip(keys, starts, [*starts[1:], columns.rows], strict=True), itemgetter(0)):
            (_, start, stop), *further = pieces
            runs.append((key, slice(start, further[-1][2] if further else stop)))
        return runs if all(any(key) for key, _ in runs) else _without_empty(columns, runs)

    def _window(self, columns: Columns, runs: list[tuple[tuple[str, ...], slice]], first: int) -> Window:
        parts: dict[tuple[str, ...], list[slice]] = {}
        for key, rows in runs:
            parts.setdefault(key, []).append(rows)
        if not self._given.isdisjoint(parts):
            raise _unreadable(_APART)
        if not self._may_part and len(parts) < len(runs) and any(rows.stop - rows.start > 1 for _, rows in runs):
            again = next(rows[1] for rows in parts.values() if len(rows) > 1)
            raise _unreadable(
                f"In row {first + again.start + 1} below the headings an impact begins again whose rows ended before, "
                "and the samples have no times that would put them in order. If it is another impact, name all columns "
                "that tell them apart in a mapping's group_by; if it is the same, give the samples' times."
            )
        self._given.update(parts)
        return Window(columns, [rows[0] if len(rows) == 1 else _joined(rows) for rows in parts.values()], first)


def _require_one_nothing(columns: Columns, keys: Sequence[int], rows: Sequence[int]) -> None:
    """Refuse names of impacts that are several words for nothing: NA and null are two impacts, or one mistake."""
    written = {tuple(columns.texts[index][row].strip() for index in keys) for row in rows} - {("",) * len(keys)}
    if len(written) > 1:
        shown = " and ".join(sorted(" ".join(words) for words in written)[:2])
        raise _unreadable(
            f"What tells impacts apart is {shown}, which both mean that there is nothing: give each impact a name."
        )


def _without_empty(columns: Columns, runs: list[tuple[tuple[str, ...], slice]]) -> list[tuple[tuple[str, ...], slice]]:
    """The runs without the rows of empty cells that part impacts from each other; within one they are lost samples."""
    kept: list[tuple[tuple[str, ...], slice]] = []
    for key, rows in runs:
        if any(key) or len(runs) == 1 or not all(np.isnan(cells[rows]).all() for cells in columns.numbers.values()):
            kept.append((key, rows))
    if any(before == key for (before, _), (key, _) in pairwise(kept)):
        raise _unreadable("Rows of empty cells stand between the samples of one impact: give their values or times.")
    return kept or runs


def _require_filled(runs: Sequence[tuple[tuple[str, ...], slice]], first: int) -> None:
    """Refuse a name that stands in the first row of its impact only, as merged cells of a spreadsheet are saved."""
    for (before, _), (key, rows) in pairwise(runs):
        if all(part in {named, ""} for named, part in zip(before, key, strict=True)):
            raise _unreadable(
                f"Row {first + rows.start + 1} below the headings leaves out what tells impacts apart, which the row "
                "above it says: write it in every row."
            )


_APART = f"In a file of more than {WINDOW_ROWS} rows, the rows of one impact follow each other: sort it by impact."


def _joined(parts: list[slice]) -> list[int]:
    return [row for part in parts for row in range(part.start, part.stop)]


def _stacked(blocks: list[Columns]) -> Columns:
    if len(blocks) == 1:
        return blocks[0]
    return Columns(
        rows=sum(block.rows for block in blocks),
        numbers={index: np.concatenate([block.numbers[index] for block in blocks]) for index in blocks[0].numbers},
        texts={index: Stacked([block.texts[index] for block in blocks]) for index in blocks[0].texts},
    )


def _cut(columns: Columns, start: int, stop: int) -> Columns:
    return Columns(
        rows=stop - start,
        numbers={index: values[start:stop] for index, values in columns.numbers.items()},
        texts={index: cells[start:stop] for index, cells in columns.texts.items()},
    )


def _copied(columns: Columns) -> Columns:
    return replace(columns, numbers={index: values.copy() for index, values in columns.numbers.items()})


def _counted(first: int, rows: int) -> int:
    if first + rows > MAX_ROWS:
        raise _unreadable(f"A file may have at most {MAX_ROWS} rows.")
    return first + rows


def _unreadable(detail: str) -> Problem:
    return Problem("unreadable-file", detail)
