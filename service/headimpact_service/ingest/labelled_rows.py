"""Rows among the samples that a column calls something else: units, a sensor's range, a table's own maximum."""

from __future__ import annotations

from collections.abc import Sequence

from headimpact_service.ingest.blocks import SHORTEST
from headimpact_service.ingest.cells import is_written_number, said
from headimpact_service.ingest.spelling import words_of

MOST = 20
"""So many rows at most stand above or below the samples."""
_LABELS = frozenset(
    {
        *("unit", "units", "einheit", "unite", "range", "messbereich", "offset", "zero", "bias", "resolution"),
        *("scale", "gain", "sensitivity", "calibration", "type", "channel", "kanal", "length", "label", "limit"),
        *("max", "maximum", "min", "minimum", "mean", "average", "avg", "mittelwert", "median", "moyenne"),
        *("std", "stdev", "sd", "rms", "sum", "count", "peak", "total"),
    }
)
"""Words for what is said of a column, or computed from it."""


def labelled_row(cells: Sequence[str]) -> tuple[int, str] | None:
    """The first row that a column gives a name where it numbers the samples, or says nothing of them, and the name."""
    told = list(map(said, cells))
    named = [row for row, text in enumerate(told) if text and not is_written_number(text)]
    if not named or len(named) > MOST or len(told) - len(named) < SHORTEST or not _stand_at_an_end(named, len(told)):
        return None
    numbers = sum(map(is_written_number, told))
    labels = all(not _LABELS.isdisjoint(words_of(told[row])) for row in named)
    if 2 * numbers >= len(told) or (numbers == 0 and labels):
        return named[0], told[named[0]]
    return None


def _stand_at_an_end(rows: Sequence[int], count: int) -> bool:
    """Whether rows that follow each other are the first or the last of so many."""
    follow = rows[-1] - rows[0] + 1 == len(rows)
    return follow and (rows[0] == 0 or rows[-1] == count - 1)
