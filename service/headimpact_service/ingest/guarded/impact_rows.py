"""Arrow rows that have the shape of our JSON (a column `kinematics` of structs), as lines of that JSON."""

from __future__ import annotations

import decimal
import json
from collections.abc import Iterable, Iterator
from typing import Any

import pyarrow as pa

from headimpact_service.ingest.guarded.arrow_columns import words

ROWS_AT_ONCE = 64
_INDEX = "__index_level_"
"""Columns that pandas adds for its index."""


def has_impact_rows(schema: pa.Schema) -> bool:
    """Whether the rows of a schema are impacts as JSON has them."""
    place = schema.get_field_index("kinematics")
    return place >= 0 and bool(pa.types.is_struct(schema.field(place).type))


def lines(batches: Iterable[pa.RecordBatch]) -> Iterator[bytes]:
    """Each row as a line of JSON, without the members that are null."""
    for batch in batches:
        for start in range(0, batch.num_rows, ROWS_AT_ONCE):
            rows = _with_text_for_times(batch.slice(start, ROWS_AT_ONCE)).to_pylist()
            yield b"".join(json.dumps(_without_nulls(row), default=_as_json).encode() + b"\n" for row in rows)


def _with_text_for_times(batch: pa.RecordBatch) -> pa.RecordBatch:
    """Times as RFC 3339 has them: as Python's they would need the system's file of their zone."""
    for place, field in enumerate(batch.schema):
        if pa.types.is_timestamp(field.type):
            texts = [text or None for text in words(batch.column(place))]
            batch = batch.set_column(place, field.name, pa.array(texts, pa.string()))
    return batch


def _without_nulls(row: Any) -> Any:  # noqa: ANN401 - any JSON
    if not isinstance(row, dict):
        return row
    kept = {name: _without_nulls(value) for name, value in row.items() if value is not None}
    return {name: value for name, value in kept.items() if not name.startswith(_INDEX)}


def _as_json(value: Any) -> Any:  # noqa: ANN401 - any cell
    if isinstance(value, decimal.Decimal):
        return float(value)
    raise TypeError(f"A cell of {type(value).__name__} has no place in JSON.")
