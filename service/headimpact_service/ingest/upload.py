"""One entry for every file: what it is, and the impacts in it.

A new format is a reader and a place in this module: in :data:`READERS` if its content tells it, in
:data:`ARCHIVES` if it comes as a zip.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from headimpact_service.errors import Problem
from headimpact_service.ingest.csv_format import read_csv
from headimpact_service.ingest.detect import READ, Kind, detect
from headimpact_service.ingest.json_format import read_json
from headimpact_service.ingest.ndjson_format import read_ndjson
from headimpact_service.ingest.nhtsa import is_nhtsa, read_nhtsa
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.presets import preset_named
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.zip_guard import GuardedZip

Impacts = Iterator[ImpactRecord | Problem]


def read_upload(data: bytes, options: ImportOptions) -> Impacts:
    """The impacts of a file in its order; a fault of one impact stands in its place as a :class:`Problem`.

    Nothing is read before the first item is asked for.

    Raises
    ------
    Problem
        The file as a whole cannot be read (413, 415 or 422); also in the midst of it, so store nothing before the end.
    """
    if options.preset is not None:
        preset_named(options.preset)
    kind = detect(data, filename=options.filename, content_type=options.content_type)
    yield from READERS[kind](data, options)


def _read_zip(data: bytes, options: ImportOptions) -> Impacts:
    archive = GuardedZip(data)
    for fits, read in ARCHIVES:
        if fits(archive.names):
            return read(archive, options)
    raise Problem("unsupported-media-type", f"The zip archive holds none of the files that are read: {READ}.")


READERS: dict[Kind, Callable[[bytes, ImportOptions], Impacts]] = {
    Kind.CSV: read_csv,
    Kind.JSON: read_json,
    Kind.NDJSON: read_ndjson,
    Kind.ZIP: _read_zip,
}
ARCHIVES: tuple[tuple[Callable[[list[str]], bool], Callable[[GuardedZip, ImportOptions], Impacts]], ...] = (
    (is_nhtsa, read_nhtsa),
)
