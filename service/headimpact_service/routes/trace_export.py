"""Impacts with their samples: what is exported here can be imported elsewhere, to the same scores."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterable, Sequence
from functools import partial
from typing import Any

from headimpact_service import deps
from headimpact_service.answers import NDJSON, PARQUET
from headimpact_service.ingest.formula_cells import guarded_name
from headimpact_service.intake.exporting import (
    NAMED,
    SAMPLE_COLUMNS,
    SAMPLE_FLAGS,
    SAMPLE_NUMBERS,
    Part,
    Traced,
    importable,
    parts,
)
from headimpact_service.operation import Call
from headimpact_service.routes.tables import Cell, CsvForm, Form, Kind, NdjsonForm, ParquetForm, Repeated
from headimpact_service.store import impacts, traces
from headimpact_service.store.impacts import Impact

AT_ONCE = 20
"""Impacts whose samples are held together."""

_KINDS: dict[str, Kind] = {
    **dict.fromkeys(SAMPLE_NUMBERS, "number"),
    **dict.fromkeys(SAMPLE_FLAGS, "flag"),
    "occurred_at": "instant",
}


def trace_form(media_type: str) -> Form:
    """One line an impact as NDJSON; one row a sample as CSV and Parquet."""
    if media_type == NDJSON:
        return NdjsonForm(importable)
    if media_type == PARQUET:
        return _Samples()
    return CsvForm(SAMPLE_COLUMNS, _rows)


def _rows(traced: Traced) -> Iterable[Sequence[Cell]]:
    for part in parts(traced):
        yield from zip(*(Repeated(part.column(name), part.rows).cells() for name in SAMPLE_COLUMNS), strict=True)


class _Samples(ParquetForm):
    """Samples as rows of Parquet."""

    def __init__(self) -> None:
        super().__init__(SAMPLE_COLUMNS, _KINDS, _cells)

    def encode(self, part: Sequence[Any]) -> bytes:
        return super().encode([samples for traced in part for samples in parts(traced)])


def _cells(part: Part) -> list[Repeated]:
    return [Repeated(_kept(part.column(name), name), part.rows) for name in SAMPLE_COLUMNS]


def _kept(cell: Any, column: str) -> Any:  # noqa: ANN401 - an array, or the cell that all rows have
    """A name that a reader would take for nothing is guarded; how samples are read is none of the sender's text."""
    return guarded_name(cell) if isinstance(cell, str) and column in NAMED else cell


async def with_samples(call: Call, rows: Sequence[Impact]) -> AsyncIterator[Sequence[Traced]]:
    """Impacts with their samples, some at a time; tombstones have none."""
    present = [impact for impact in rows if impact.deleted_at is None]
    for first in range(0, len(present), AT_ONCE):
        some = present[first : first + AT_ONCE]
        wanted = [impact.id for impact in some]
        found = await deps.read(call.request, partial(impacts.traced, data_set_id=call.data_set_id, impact_ids=wanted))
        yield [
            Traced(impact, found[impact.id][0], traces.decode(found[impact.id][1]))
            for impact in some
            if impact.id in found
        ]
