"""Parquet, Arrow IPC, npz, MATLAB and xlsx: what the guarded process makes of them, through mappings and presets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from headimpact_service.errors import Problem
from headimpact_service.ingest.apart import Apart
from headimpact_service.ingest.guard import GuardedLines, GuardedTable, guarded
from headimpact_service.ingest.json_format import refuse_table_options
from headimpact_service.ingest.mapping import Mapping, merge
from headimpact_service.ingest.ndjson_format import read_lines
from headimpact_service.ingest.no_signal import is_no_signal
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.source import Source
from headimpact_service.ingest.tabular import read_table

Impacts = Iterator[ImpactRecord | Problem]
SUMMARY = "summary"
"""A sheet of this name holds no samples."""
STANFORD = "stanford_mat"
STANFORD_TIME = "t"


def read_parquet(source: Source, options: ImportOptions) -> Impacts:
    """The impacts of a Parquet file."""
    return _read("parquet", source, options)


def read_arrow(source: Source, options: ImportOptions) -> Impacts:
    """The impacts of an Arrow IPC file or stream."""
    return _read("arrow", source, options)


def read_npz(source: Source, options: ImportOptions) -> Impacts:
    """The impacts of a NumPy archive."""
    return _read("npz", source, options)


def read_mat(source: Source, options: ImportOptions) -> Impacts:
    """The impacts of a MATLAB file of version 5 to 7.2."""
    return _read("mat", source, options)


def read_xlsx(source: Source, options: ImportOptions) -> Impacts:
    """The impacts of a workbook: one or more in each sheet."""
    return _read("xlsx", source, options)


def is_npz(names: list[str]) -> bool:
    """Whether a zip archive's files are NumPy's arrays."""
    return any(name.endswith(".npy") for name in names)


def is_xlsx(names: list[str]) -> bool:
    """Whether a zip archive's files are those of a workbook."""
    return "xl/workbook.xml" in names


def _read(kind: str, source: Source, options: ImportOptions) -> Impacts:
    """The impacts of every table of a file, or of its rows in the shape of our JSON."""
    reading = _Reading(kind, options)
    with guarded(kind, source) as contents:
        for content in contents:
            if isinstance(content, GuardedLines):
                yield from reading.lines(content)
            else:
                yield from reading.table(content)
    reading.require_impacts()


class _Reading:
    """One file's tables, and what became of them."""

    def __init__(self, kind: str, options: ImportOptions) -> None:
        self._kind, self._options = kind, options
        self._count = 0
        self._unknown: Problem | None = None
        self._refused: Problem | None = None
        self._apart = Apart("sheets")

    def lines(self, lines: GuardedLines) -> Impacts:
        """Rows in the shape of our JSON."""
        refuse_table_options(self._options, f"{self._kind} file with a column kinematics:")
        for item in read_lines(enumerate(lines, 1), self._options):
            self._count += 1
            yield item if isinstance(item, Problem) else _labelled(item, format=self._kind)

    def table(self, table: GuardedTable) -> Impacts:
        """A table, or nothing where one among others holds no signals; what is wrong with one sheet is its own."""
        if table.name is not None and table.name.strip().lower() == SUMMARY:
            return
        options = replace(self._options, max_impacts=self._options.max_impacts - self._count)
        try:
            for item in read_table(table, _as_preset_means(table, options), format_name=self._kind):
                self._count += 1
                labels = {} if table.name is None else {"sheet": table.name}
                if table.name is not None:
                    self._apart.add(table.name, [item])
                yield item if isinstance(item, Problem) else _labelled(item, **labels)
        except Problem as problem:
            if is_no_signal(problem):
                self._unknown = self._unknown or problem
            elif table.name is None or problem.slug != "unreadable-file":
                raise
            else:
                self._refused = self._refused or problem
                yield Problem(problem.slug, f"Sheet {table.name}: {problem.detail}", errors=problem.errors)

    def require_impacts(self) -> None:
        """Refuse a file of which no table was read, and one whose sheets hold a sensor each."""
        if self._count == 0:
            raise self._refused or self._unknown or Problem("unreadable-file", "The file holds no impact.")
        self._apart.require_none()


def _as_preset_means(table: GuardedTable, options: ImportOptions) -> ImportOptions:
    """Stanford's rate and trigger are those of its plain arrays; its structs have times of their own."""
    if options.preset != STANFORD or STANFORD_TIME not in table.headings:
        return options
    own = Mapping.model_validate({"sample_rate_hz": None, "pre_trigger_ms": None})
    return replace(options, mapping=merge(own, options.mapping))


def _labelled(record: ImpactRecord, **labels: str) -> ImpactRecord:
    return replace(record, metadata={**record.metadata, **labels}) if labels else record
