"""A window of a table as signals: put together once for all of its impacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.filling import how_filled
from headimpact_service.ingest.layout import Layout, SignalLayout
from headimpact_service.ingest.steady import changed_rows
from headimpact_service.ingest.table import Columns, FloatArray
from headimpact_service.ingest.windows import Rows, Window


class Samples:
    """A window's columns, put together into signals once for all its impacts."""

    def __init__(self, layout: Layout, window: Window) -> None:
        """Assemble every signal."""
        columns = window.columns
        self.layout, self.window, self.texts, self.numbers = layout, window, columns.texts, columns.numbers
        self.signals = {name: _assembled(signal, columns) for name, signal in layout.signals.items()}
        self._changes = self._changed(layout)
        beside = {clock.column for clock in layout.others.clocks}
        self.is_whole = all(np.isfinite(columns.numbers[place]).all() for place in columns.numbers.keys() - beside)

    def _changed(self, layout: Layout) -> NDArray[np.intp] | None:
        """How often what rows say of their impact has changed, row by row; None where nothing is said in rows."""
        columns = sorted(
            {*layout.labels, *layout.occurred_at, *layout.unread.watched, *layout.peaks, *layout.axis_peaks}
        )
        if not columns or self.window.columns.lengths is not None:
            return None
        return np.cumsum(changed_rows(self.texts, columns, self.window.columns.rows))

    def are_alike(self, rows: Rows) -> bool:
        """Whether the rows surely say the same of their impact; where not, one has to look."""
        if self._changes is None:
            return True
        return isinstance(rows, slice) and bool(self._changes[rows.start] == self._changes[rows.stop - 1])

    @property
    def has_ends(self) -> bool:
        """Whether a signal may end before its impact does: arrays and lists of unlike lengths."""
        return self.window.columns.lengths is not None and not self.is_whole

    def require_finite(self, columns: list[int], rows: Rows, first: int, needed: str = "a finite number") -> None:
        """Refuse rows in which a cell is not a finite number, or the other thing that is needed."""
        if self.is_whole:
            return
        for column in columns:
            numbers = self.numbers[column][rows]
            faulty = np.flatnonzero(~np.isfinite(numbers))
            if faulty.size:
                helps = "" if column in self.layout.stamps else how_filled(numbers, int(faulty[0]))
                raise file_fault(
                    f"{self.layout.named(column)} has a cell that is not {needed}, at sample {faulty[0]} of the "
                    f"impact that begins in row {first + 1} below the headings{helps}.",
                    "missing-sample",
                )


def _assembled(signal: SignalLayout, columns: Columns) -> FloatArray:
    """A signal's three columns with their signs; one that a constrained plane leaves out is zero."""
    values = np.zeros((columns.rows, 3))
    for axis, component in enumerate(signal.components):
        if component.column is not None:
            with np.errstate(invalid="ignore"):  # a binary file may hold NaNs that signal
                np.multiply(columns.numbers[component.column], component.factor, out=values[:, axis])
    return values
