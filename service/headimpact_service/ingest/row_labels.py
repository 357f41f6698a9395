"""What the rows of one impact say of it: the same in all of them, or in one and nothing in the others."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from headimpact_service.errors import Problem
from headimpact_service.ingest.axis_peaks import unclear_axis
from headimpact_service.ingest.blocks import (
    STAY,
    are_named_apart,
    are_several,
    begins_anew,
    count_triggers,
    lie_in_long_blocks,
    mark_blocks,
    number_impacts,
    peaks_lie_in_blocks,
    tell_parts,
    tell_parts_or_name_them,
)
from headimpact_service.ingest.cells import said
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.filling import MOST
from headimpact_service.ingest.labelled_rows import labelled_row
from headimpact_service.ingest.layout import Layout
from headimpact_service.ingest.mapping import read_from_none
from headimpact_service.ingest.unread import left_out, lie_apart, longest_s, moment_of, span_s
from headimpact_service.ingest.windows import Rows, numbers_of

MAX_SHOWN = 40
"""Characters of a cell that a message shows."""
_OR_ONE = "; if they are one, say so by an empty group_by"
_SAY = "does not say the same"
_ANY = "does not say something"
_TIME = "does not say one time"
_COUNT = "does not count on"


@dataclass(frozen=True, slots=True)
class RowLabels:
    """The labels of one impact.

    `cell` is where its first row's stand, `row` that row's number in the table; `alike` says that all its rows surely
    say the same.
    """

    layout: Layout
    texts: Mapping[int, Sequence[str]]
    rows: Rows
    cell: int
    row: int
    alike: bool

    def said(self, column: int) -> str:
        """What the impact's first row says in a column, or where that says nothing, the first that does."""
        text = said(self.texts[column][self.cell])
        if text or self.alike:
            return text
        return next(filter(None, self._distinct(column)), "")

    def all_said(self, column: int) -> list[str]:
        """What its rows say in a column, each once."""
        return [self.said(column)] if self.alike else self._distinct(column)

    def require_one_impact(self, time_zone: str | None) -> None:
        """Refuse rows that say different things of their impact: they are several, and nothing tells them apart."""
        if self.alike:
            return
        self._require_unread_alike(time_zone)
        for column in self.layout.labels:
            if len([cell for cell in self._distinct(column) if cell]) > 1:
                raise self._several(column, _SAY, self._or_unread(column))
            if self._ends(column):
                raise self._several(column, _ANY, self._or_unread(column))
        if any(len(self._distinct(column)) > 1 for column in self.layout.occurred_at):
            self._require_one_time(self.layout.occurred_at, time_zone)
        for column, signal in self.layout.axis_peaks.items():
            if len([cell for cell in self._distinct(column) if cell]) > 1:
                raise unclear_axis(self.layout.named(column), signal)
        self._require_counted()

    def _require_unread_alike(self, time_zone: str | None) -> None:
        """The same of columns that are not read otherwise, by what their headings or their cells say they are."""
        unread = self.layout.unread
        for column in (*unread.names, *unread.counters, *unread.others) if unread.alone else ():
            if (found := labelled_row(self._cells(column))) is not None:
                raise self._no_sample(column, *found)
        for columns, tell, what in (
            (unread.names, are_named_apart if unread.alone else are_several, _SAY),
            (unread.impacts, number_impacts, _SAY),
            (() if unread.named else unread.times, partial(lie_apart, time_zone=time_zone), _TIME),
            (() if unread.named else unread.counters, begins_anew, _COUNT),
            (unread.others, tell_parts_or_name_them, _SAY),
            (unread.remarks, tell_parts, _SAY),
            (unread.marks, mark_blocks, _SAY),
            (unread.triggers, count_triggers, _SAY),
            (unread.peaks, peaks_lie_in_blocks, _SAY),
            ((*unread.measured, *(unread.times if unread.alone else ())), lie_in_long_blocks, _SAY),
        ):
            for column in columns:
                if tell(self._cells(column)):
                    raise self._several(column, what, self._or_one())

    def _no_sample(self, column: int, place: int, name: str) -> Problem:
        row = numbers_of(self.rows)[place] - numbers_of(self.rows)[0] + self.row
        return file_fault(
            f"{self.layout.named(column)} calls row {row + 1} below the headings {name[:MAX_SHOWN]}, which seems to be "
            "no sample: leave such rows out, or say by an empty group_by that all rows are samples of one impact.",
            "labelled-row",
        )

    def _or_one(self) -> str:
        """What to do if a column that is not read says nothing of impacts."""
        if self.layout.unread.said_one:
            return ""
        if not self.layout.keys:
            return _OR_ONE
        keys = ", ".join(f'"{self.layout.headings[column]}"' for column in self.layout.keys)
        return f'; if it is of the samples, say in a mapping what tells impacts apart ({{"group_by": [{keys}]}})'

    def parting(self) -> str:
        """How a mapping may part the rows: by the first column that is not read and says different things in them."""
        found = (column for column in self.layout.unread.hints if are_named_apart(self._cells(column)))
        return next((self._by(column) for column in found), "")

    def _by(self, column: int) -> str:
        heading = self.layout.headings[column] or f"Column {column + 1}"
        return f' (["{heading}"], if that tells them apart)'

    def _or_unread(self, column: int) -> str:
        """How to leave a column alone that says nothing of the impact: a number of each row, say."""
        way = self.layout.field_of(column)
        if way is None:
            return ""
        alone: dict[str, list[str]] = {} if self.layout.keys else {"group_by": []}
        return f"; if they are one, read no {way[-1]} from it ({json.dumps(read_from_none(*way) | alone)} in a mapping)"

    def _require_counted(self) -> None:
        """Refuse samples that are left out, as numbers of them that are not read otherwise say."""
        for column in self.layout.unread.numbering:
            hole = left_out(self._cells(column))
            if hole is not None:
                raise self._counted(column, *hole)

    def _counted(self, column: int, before: float, after: float, step: float) -> Problem:
        heading = self.layout.headings[column]
        filled = (
            f', or name the column in a mapping ({{"sample_number": "{heading}"}}) and ask for fill_gaps'
            if heading and step == 1.0 and after - before <= MOST + 1
            else ""
        )
        return file_fault(
            f"{self.layout.named(column)} goes on from {before:g} to {after:g} in the impact that begins in row "
            f"{self.row + 1} below the headings: samples were left out. Send all of them{filled}; if the column does "
            "not count the impact's samples, say so by an empty group_by.",
            "sample-order",
        )

    def _cells(self, column: int) -> list[str]:
        cells = self.texts[column]
        return list(cells[self.rows] if isinstance(self.rows, slice) else map(cells.__getitem__, self.rows))

    def _ends(self, column: int) -> bool:
        """Whether, of samples without times, several rows say something and others nothing: two impacts' rows."""
        if self.layout.has_order or self.layout.unread.said_one:
            return False
        there = [bool(said(cell)) for cell in self._cells(column)]
        return 1 < sum(there) < len(there)

    def _distinct(self, column: int) -> list[str]:
        """What the impact's rows say in a column, in their order."""
        return list(dict.fromkeys(map(said, self._cells(column))))

    def _require_one_time(self, columns: Sequence[int], time_zone: str | None) -> None:
        """Times that go on from sample to sample are those of the samples; others are of several impacts."""
        rows = numbers_of(self.rows)
        told = dict.fromkeys(tuple(said(self.texts[column][row]) for column in columns) for row in rows)
        untold = not (self.layout.has_order or self.layout.unread.said_one)
        stay = 1 < sum(map(any, told)) <= len(rows) // STAY
        if untold and (stay or any(self._ends(column) for column in columns)):
            raise self._several(columns[0], _TIME, _OR_ONE)
        order = self.layout.date_order
        moments = [moment_of("T".join(parts), time_zone, order) for parts in told if all(parts)]
        known = [when for when in moments if when is not None]
        if known and span_s(known) > longest_s(len(rows)):
            raise self._several(columns[0], _TIME)

    def _several(self, column: int, what: str, otherwise: str = "") -> Problem:
        parting = self._by(column) if what == _SAY else ""
        return file_fault(
            f"{self.layout.named(column)} {what} in all rows of the impact that begins in row {self.row + 1} below the "
            f"headings: if they are several impacts, tell them apart by a column impact_id or a mapping's group_by"
            f"{parting}{otherwise}.",
            "several-impacts",
        )
