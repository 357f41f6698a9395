"""One entry for every file: what it is, and the impacts in it.

A new format is a reader and a place in this module: in :data:`READERS` if its content tells it, in
:data:`ARCHIVES` if it comes as a zip.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath

from headimpact_service.errors import Problem
from headimpact_service.ingest.binary_formats import (
    is_npz,
    is_xlsx,
    read_arrow,
    read_mat,
    read_npz,
    read_parquet,
    read_xlsx,
)
from headimpact_service.ingest.detect import HEAD, READ, Kind, detect
from headimpact_service.ingest.iso_mme import is_iso_mme, read_iso_mme
from headimpact_service.ingest.json_format import read_json
from headimpact_service.ingest.ndjson_format import read_ndjson
from headimpact_service.ingest.nhtsa import is_nhtsa, read_nhtsa
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.presets import preset_named
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.source import Source
from headimpact_service.ingest.text_tables import holds_tables, read_folder, read_text_table, tables_beside
from headimpact_service.ingest.zip_guard import GuardedZip

ALONE = frozenset({".parquet", ".feather", ".arrow", ".mat", ".xlsx", ".npz", ".json", ".ndjson", ".jsonl"})
MAX_SHOWN = 100
Impacts = Iterator[ImpactRecord | Problem]


def read_upload(content: bytes | Path, options: ImportOptions) -> Impacts:
    """The impacts of a file in its order; a fault of one impact stands in its place as a :class:`Problem`.

    The file is in memory or on disk; from disk, tables and lines are read block by block.

    Nothing is read before the first item is asked for.

    Raises
    ------
    Problem
        The file as a whole cannot be read (413, 415 or 422); also in the midst of it, so store nothing before the end.
    """
    if options.preset is not None:
        preset_named(options.preset)
    source = Source(content)
    kind = detect(source.head(HEAD), filename=options.filename, content_type=options.content_type)
    yield from READERS[kind](source, options)


def sample_count(item: ImpactRecord | Problem) -> int:
    """The samples of all channels of an impact."""
    return 0 if isinstance(item, Problem) else item.values


def _read_zip(source: Source, options: ImportOptions) -> Impacts:
    with source.open() as stream:
        archive = GuardedZip(stream)
        if is_nhtsa(archive.names) and is_iso_mme(archive.names):
            detail = "The zip archive holds a test of NHTSA's and a set of ISO-MME: send each in an archive of its own."
            raise Problem("unreadable-file", detail)
        for fits, read in ARCHIVES:
            if fits(archive.names):
                yield from read(archive, options)
                if read is not read_folder:
                    yield from tables_beside(archive.names)
                return
        names = archive.names
    for fits, read_whole in ZIPPED:
        if fits(names):
            yield from read_whole(source, options)
            return
    if (alone := next(filter(_is_read_alone, names), None)) is not None:
        raise Problem("unsupported-media-type", f"Of an archive, {alone[:MAX_SHOWN]} is not read: send it by itself.")
    raise Problem("unsupported-media-type", f"The zip archive holds none of the files that are read: {READ}.")


def _is_read_alone(name: str) -> bool:
    """Whether a file in an archive is one of those that are read by themselves."""
    return PurePosixPath(name).suffix.lower() in ALONE


READERS: dict[Kind, Callable[[Source, ImportOptions], Impacts]] = {
    Kind.CSV: read_text_table,
    Kind.JSON: read_json,
    Kind.NDJSON: read_ndjson,
    Kind.ZIP: _read_zip,
    Kind.PARQUET: read_parquet,
    Kind.ARROW: read_arrow,
    Kind.MAT: read_mat,
}
ARCHIVES: tuple[tuple[Callable[[list[str]], bool], Callable[[GuardedZip, ImportOptions], Impacts]], ...] = (
    (is_nhtsa, read_nhtsa),
    (is_iso_mme, read_iso_mme),
    (holds_tables, read_folder),
)
ZIPPED: tuple[tuple[Callable[[list[str]], bool], Callable[[Source, ImportOptions], Impacts]], ...] = (
    (is_xlsx, read_xlsx),
    (is_npz, read_npz),
)
"""Formats that are zip archives themselves."""
