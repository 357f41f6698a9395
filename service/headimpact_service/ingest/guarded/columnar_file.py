"""Parquet and Arrow IPC, which share their library and so their process."""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

from headimpact_service.ingest.guarded import arrow_file, parquet_file
from headimpact_service.ingest.guarded.contents import Content


def contents(stream: BinaryIO) -> Iterator[Content]:
    """What a file of either format holds."""
    stream.seek(0)
    is_parquet = stream.read(len(parquet_file.MAGIC)) == parquet_file.MAGIC
    stream.seek(0)
    yield from parquet_file.contents(stream) if is_parquet else arrow_file.contents(stream)


def warm_up() -> None:
    """Read files of our own, so that every library is loaded."""
    parquet_file.warm_up()
    arrow_file.warm_up()
