"""Tables as text: one file, a CSV or a laboratory's export, or a folder of them as zip."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import PurePosixPath

from headimpact_service.errors import Problem
from headimpact_service.ingest.apart import Apart
from headimpact_service.ingest.csv_format import read_csv
from headimpact_service.ingest.detect import HEAD
from headimpact_service.ingest.dts import PRESET as DTS
from headimpact_service.ingest.dts import is_dts, read_dts
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.source import Source
from headimpact_service.ingest.zip_guard import GuardedZip

Impacts = Iterator[ImpactRecord | Problem]
TABLES = frozenset({".csv", ".tsv"})
ABOUT = frozenset({".md", ".pdf", ".html", ".rtf", ".doc", ".docx", ".png", ".jpg", ".jpeg", ".svg", ".xml", ".cff"})
MAX_PATH = 200
MAX_TABLE = 16 * 1024 * 1024
"""Bytes of a table in an archive, which is held whole."""


def read_text_table(source: Source, options: ImportOptions) -> Impacts:
    """A table, or a laboratory's rows of properties above its samples."""
    if options.preset in {None, DTS} and (options.preset == DTS or is_dts(source.head(HEAD))):
        return read_dts(source, options)
    return read_csv(source, options)


def holds_tables(names: list[str]) -> bool:
    """Whether an archive is a folder with tables in it."""
    return any(map(_is_table, names))


def _is_table(name: str) -> bool:
    return PurePosixPath(name).suffix.lower() in TABLES


def read_folder(archive: GuardedZip, options: ImportOptions) -> Impacts:
    """Each table of a folder as the file that it is; one that cannot be read as a whole is refused alone."""
    left, apart = options.max_impacts, Apart("files")
    for name in sorted(archive.names):
        found = _read_member(archive, name, replace(options, filename=name[-MAX_PATH:], max_impacts=left))
        left -= len(found)
        apart.add(name, found)
        yield from found
    apart.require_none()


def _read_member(archive: GuardedZip, name: str, options: ImportOptions) -> list[ImpactRecord | Problem]:
    if not _is_table(name):
        return [] if _is_about_it(name) else [_not_read(name)]
    if archive.size(name) > MAX_TABLE:
        raise Problem(
            "import-too-large", f"A table in an archive may have at most {MAX_TABLE} bytes: send {name} alone."
        )
    try:
        return list(read_text_table(Source(archive.read(name)), options))
    except Problem as problem:
        if problem.slug == "import-too-large":
            raise
        return [Problem(problem.slug, f"{name}: {problem.detail}", errors=problem.errors)]


def tables_beside(names: list[str]) -> Iterator[Problem]:
    """Of an archive that is a laboratory's test, the tables that are in it too: each is refused by name."""
    for name in filter(_is_table, sorted(names)):
        detail = f"{name} was not read: of an archive with a laboratory's test only this is. Send it alone."
        yield Problem("unsupported-media-type", detail)


def _is_about_it(name: str) -> bool:
    """Whether a file says something of the others: a licence, a page, a picture."""
    path = PurePosixPath(name.lower())
    return path.suffix in ABOUT or path.stem.startswith(("readme", "licen", "notice", "citation", "changelog"))


def _not_read(name: str) -> Problem:
    return Problem(
        "unsupported-media-type", f"{name} was not read: of a folder of CSV files only these are. Send it alone."
    )
