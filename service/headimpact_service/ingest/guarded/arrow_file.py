"""Arrow IPC, as a file (Feather version 2) or as a stream: record batch by record batch, each looked through first."""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import partial
from typing import BinaryIO

import numpy as np
import pyarrow as pa

from headimpact_service.ingest.guarded import arrow_columns, impact_rows
from headimpact_service.ingest.guarded.contents import Content, Lines, NamedTable

_FILE = b"ARROW1"


def contents(stream: BinaryIO) -> Iterator[Content]:
    """The one table, or its impacts as JSON."""
    schema = _schema(stream)
    if impact_rows.has_impact_rows(schema):
        yield Lines(impact_rows.lines(_checked(stream, None)))
        return
    yield NamedTable(None, arrow_columns.ArrowTable(schema, partial(_batches, stream)))


def warm_up() -> None:
    """Read a file of our own, so that every library is loaded."""
    pa.set_io_thread_count(1)
    pa.set_cpu_count(1)
    batch = pa.record_batch({"a": np.zeros(3), "b": ["x", "y", None], "c": [[1.0, 2.0], [3.0], None]})
    for open_writer in (pa.ipc.new_file, pa.ipc.new_stream):
        buffer = io.BytesIO()
        with open_writer(buffer, batch.schema) as writer:
            writer.write_batch(batch)
        buffer.seek(0)
        for content in contents(buffer):
            if isinstance(content, NamedTable):
                list(content.table.blocks([2], [1]))


def _is_file(stream: BinaryIO) -> bool:
    stream.seek(0)
    magic = stream.read(len(_FILE))
    stream.seek(0)
    return magic == _FILE


def _schema(stream: BinaryIO) -> pa.Schema:
    is_file = _is_file(stream)
    source = pa.PythonFile(stream, mode="r")
    schema = (pa.ipc.open_file(source) if is_file else pa.ipc.open_stream(source)).schema
    stream.seek(0)
    return schema


def _batches(stream: BinaryIO, places: list[int]) -> Iterator[pa.RecordBatch]:
    for batch in _checked(stream, places):
        for start in range(0, batch.num_rows, arrow_columns.ROWS_AT_ONCE):
            yield batch.slice(start, arrow_columns.ROWS_AT_ONCE)


def _checked(stream: BinaryIO, places: list[int] | None) -> Iterator[pa.RecordBatch]:
    """Batches of these columns; offsets that lead out of a buffer are found before anything follows them."""
    options = pa.ipc.IpcReadOptions(use_threads=False, included_fields=places)
    source = pa.PythonFile(stream, mode="r")
    if _is_file(stream):
        file = pa.ipc.open_file(source, options=options)
        batches = (file.get_batch(number) for number in range(file.num_record_batches))
    else:
        batches = iter(pa.ipc.open_stream(source, options=options))
    for batch in batches:
        batch.validate(full=True)
        yield batch
