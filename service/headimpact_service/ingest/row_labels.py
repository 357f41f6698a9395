"""What the rows of one impact say of it: the same in all of them, or in one and nothing in the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from headimpact_service.errors import Problem
from headimpact_service.ingest.cells import said
from headimpact_service.ingest.impact_json import MIN_RATE_HZ
from headimpact_service.ingest.labels import label_fault, moment
from headimpact_service.ingest.layout import Layout
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.windows import Rows, numbers_of

ROUNDED_TO_S = 1.0
"""Times of samples may be written to the second."""


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

    def require_one_impact(self, options: ImportOptions) -> None:
        """Refuse rows that say different things of their impact: they are several, and nothing tells them apart."""
        if self.alike:
            return
        for column in self.layout.labels:
            if len([cell for cell in self._distinct(column) if cell]) > 1:
                raise self._several(f"Column {column + 1} does not say the same")
        columns = [] if options.occurred_at is not None else self.layout.occurred_at
        if any(len(self._distinct(column)) > 1 for column in columns):
            self._require_one_time(columns, options.time_zone)

    def _distinct(self, column: int) -> list[str]:
        """What the impact's rows say in a column, in their order."""
        cells = self.texts[column]
        told = cells[self.rows] if isinstance(self.rows, slice) else map(cells.__getitem__, self.rows)
        return list(dict.fromkeys(map(said, told)))

    def _require_one_time(self, columns: Sequence[int], time_zone: str | None) -> None:
        """Times that go on from sample to sample are those of the samples; others are of several impacts."""
        rows = numbers_of(self.rows)
        told = dict.fromkeys(tuple(said(self.texts[column][row]) for column in columns) for row in rows)
        moments = [moment(list(parts), time_zone) for parts in told if all(parts)]
        known = [when for when in moments if when is not None]
        if known and (max(known) - min(known)).total_seconds() > len(rows) / MIN_RATE_HZ + ROUNDED_TO_S:
            raise self._several("The time of the impact is not the same")

    def _several(self, what: str) -> Problem:
        return label_fault(
            f"{what} in all rows of the impact that begins in row {self.row + 1} below the headings: if they are "
            "several impacts, tell them apart by a column impact_id or a mapping's group_by.",
            "several-impacts",
        )
