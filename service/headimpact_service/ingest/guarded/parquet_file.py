"""Parquet files, row group by row group and no more of each than a batch at a time.

Nothing that the file says of its own sizes is believed: its footer has a bound of its own, and what pages inflate to is
counted by the limits of the process.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import partial
from typing import BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from headimpact_service.ingest.guarded import arrow_columns, impact_rows
from headimpact_service.ingest.guarded.contents import Content, Lines, NamedTable, unreadable

MAX_FOOTER = 4 * 1024 * 1024
MAX_ITEMS = 100_000
"""Of one list in the footer: columns, row groups."""
BUFFER = 64 * 1024
MAGIC = b"PAR1"


def contents(stream: BinaryIO) -> Iterator[Content]:
    """The file's one table, or its impacts as JSON."""
    _require_small_footer(stream)
    file = pq.ParquetFile(
        pa.PythonFile(stream, mode="r"),
        buffer_size=BUFFER,
        pre_buffer=False,
        thrift_string_size_limit=MAX_FOOTER,
        thrift_container_size_limit=MAX_ITEMS,
    )
    schema = file.schema_arrow
    if impact_rows.has_impact_rows(schema):
        yield Lines(impact_rows.lines(file.iter_batches(impact_rows.ROWS_AT_ONCE, use_threads=False)))
        return
    yield NamedTable(None, arrow_columns.ArrowTable(schema, partial(_batches, file)))


def warm_up() -> None:
    """Read a file of our own, so that every library is loaded and every pool of threads started."""
    pa.set_io_thread_count(1)
    pa.set_cpu_count(1)
    buffer = io.BytesIO()
    table = pa.table({"a": np.zeros(3), "b": ["x", "y", None], "c": [[1.0, 2.0], [3.0], None]})
    pq.write_table(table, buffer)
    buffer.seek(0)
    for content in contents(buffer):
        if isinstance(content, NamedTable):
            list(content.table.blocks([2], [1]))


def _batches(file: pq.ParquetFile, places: list[int]) -> Iterator[pa.RecordBatch]:
    schema = file.schema_arrow
    names = [schema.names[place] for place in places]
    for group in range(file.num_row_groups):
        for batch in file.iter_batches(_batch_size(file, group), row_groups=[group], columns=names, use_threads=False):
            yield batch.select(names)


def _batch_size(file: pq.ParquetFile, group: int) -> int:
    """Rows of a batch: as many as hold a block of samples, if the row group's own counts are true."""
    counts = file.metadata.row_group(group)
    values = max((counts.column(place).num_values for place in range(counts.num_columns)), default=1)
    per_row = max(1, int(values) // max(1, int(counts.num_rows)))
    return max(1, arrow_columns.ROWS_AT_ONCE // per_row)


def _require_small_footer(stream: BinaryIO) -> None:
    """The footer is parsed whole: a million columns end here."""
    size = stream.seek(0, io.SEEK_END)
    stream.seek(max(0, size - 8))
    ending = stream.read(8)
    if ending[4:] != MAGIC:
        raise unreadable("The Parquet file is cut off: it has no footer.")
    if int.from_bytes(ending[:4], "little") > MAX_FOOTER:
        raise unreadable(f"The footer of a Parquet file may have at most {MAX_FOOTER} bytes: write fewer columns.")
    stream.seek(0)
