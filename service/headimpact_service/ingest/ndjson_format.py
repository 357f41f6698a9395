"""NDJSON: one impact a line. A bad line is that line's problem, not the file's."""

from __future__ import annotations

import codecs
from collections.abc import Iterable, Iterator
from typing import BinaryIO

from headimpact_service.errors import Problem
from headimpact_service.ingest.json_format import MAX_IMPACT, read_impact_text, refuse_table_options, sent_name
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.record import ImpactRecord, RefusedImpact
from headimpact_service.ingest.source import Source

_PIECE = 64 * 1024


def read_ndjson(source: Source, options: ImportOptions) -> Iterator[ImpactRecord | Problem]:
    """The impacts of an NDJSON file; empty lines are passed over."""
    refuse_table_options(options, "NDJSON")
    return read_lines(_lines(source), options)


def read_lines(lines: Iterable[tuple[int, bytes]], options: ImportOptions) -> Iterator[ImpactRecord | Problem]:
    """The impacts of lines with their numbers."""
    count = 0
    for number, line in lines:
        count += 1
        if count > options.max_impacts:
            raise Problem("import-too-large", f"An import may hold at most {options.max_impacts} impacts.")
        try:
            yield _read_line(line, number, options)
        except Problem as problem:
            yield RefusedImpact(problem, sent_name(line))
    if count == 0:
        raise Problem("unreadable-file", "The file holds no impact.")


def _read_line(line: bytes, number: int, options: ImportOptions) -> ImpactRecord:
    try:
        return read_impact_text(line, options, f"impact in line {number}")
    except Problem as problem:
        if problem.slug == "malformed-request":
            raise Problem("unreadable-file", problem.detail) from None
        raise


def _lines(source: Source) -> Iterator[tuple[int, bytes]]:
    """The lines that are not empty, with their numbers; of one that is too long only the beginning."""
    with source.open() as stream:
        if stream.read(len(codecs.BOM_UTF8)) != codecs.BOM_UTF8:
            stream.seek(0)
        number = 0
        while line := stream.readline(MAX_IMPACT + 1):
            number += 1
            if len(line) > MAX_IMPACT:
                _pass_over(stream, line)
                if not line.isspace():
                    yield number, line
            elif stripped := line.strip():
                yield number, stripped


def _pass_over(stream: BinaryIO, begun: bytes) -> None:
    """Read the rest of a line that is too long."""
    while begun and not begun.endswith(b"\n"):
        begun = stream.readline(_PIECE)
