"""One entry for every file: what it is, and the impacts in it.

A new format is a reader and a place in this module: in :data:`READERS` if its content tells it, in
:data:`ARCHIVES` if it comes as a zip.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
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
from headimpact_service.ingest.csv_format import read_csv
from headimpact_service.ingest.detect import HEAD, READ, Kind, detect
from headimpact_service.ingest.dts import PRESET as DTS
from headimpact_service.ingest.dts import is_dts, read_dts
from headimpact_service.ingest.iso_mme import is_iso_mme, read_iso_mme
from headimpact_service.ingest.json_format import read_json
from headimpact_service.ingest.ndjson_format import read_ndjson
from headimpact_service.ingest.nhtsa import is_nhtsa, read_nhtsa
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.presets import preset_named
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.source import Source
from headimpact_service.ingest.zip_guard import GuardedZip

Impacts = Iterator[ImpactRecord | Problem]
TABLES = frozenset({".csv", ".tsv"})
MAX_TABLE = 16 * 1024 * 1024
"""Bytes of a table in an archive, which is held whole."""


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


def _read_csv(source: Source, options: ImportOptions) -> Impacts:
    """A table, or a laboratory's rows of properties above its samples."""
    if options.preset in {None, DTS} and (options.preset == DTS or is_dts(source.head(HEAD))):
        return read_dts(source, options)
    return read_csv(source, options)


def _read_zip(source: Source, options: ImportOptions) -> Impacts:
    with source.open() as stream:
        archive = GuardedZip(stream)
        for fits, read in ARCHIVES:
            if fits(archive.names):
                yield from read(archive, options)
                return
        names = archive.names
    for fits, read_whole in ZIPPED:
        if fits(names):
            yield from read_whole(source, options)
            return
    raise Problem("unsupported-media-type", f"The zip archive holds none of the files that are read: {READ}.")


def _holds_tables(names: list[str]) -> bool:
    return any(map(_is_table, names))


def _is_table(name: str) -> bool:
    return PurePosixPath(name).suffix.lower() in TABLES


def _read_tables(archive: GuardedZip, options: ImportOptions) -> Impacts:
    """Each table of a folder as the file that it is; one that cannot be read as a whole is refused alone."""
    left = options.max_impacts
    for name in sorted(filter(_is_table, archive.names)):
        called = PurePosixPath(name).name
        if archive.size(name) > MAX_TABLE:
            detail = f"A table in an archive may have at most {MAX_TABLE} bytes: send {called} alone."
            raise Problem("import-too-large", detail)
        try:
            source = Source(archive.read(name))
            found = list(_read_csv(source, replace(options, filename=called, max_impacts=left)))
        except Problem as problem:
            if problem.slug == "import-too-large":
                raise
            found = [Problem(problem.slug, f"{called}: {problem.detail}", errors=problem.errors)]
        left -= len(found)
        yield from found


READERS: dict[Kind, Callable[[Source, ImportOptions], Impacts]] = {
    Kind.CSV: _read_csv,
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
    (_holds_tables, _read_tables),
)
ZIPPED: tuple[tuple[Callable[[list[str]], bool], Callable[[Source, ImportOptions], Impacts]], ...] = (
    (is_xlsx, read_xlsx),
    (is_npz, read_npz),
)
"""Formats that are zip archives themselves."""
