"""How one table is read."""

from __future__ import annotations

from dataclasses import dataclass

from headimpact_service.ingest.facts_beside import NOTHING_ABOVE, FactsAbove
from headimpact_service.ingest.file_names import NOT_NAMED, NamedFacts
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.options import ImportOptions


@dataclass(frozen=True, slots=True)
class Plan:
    """How one table is read: its mapping, where that came from, and what the sender overrides."""

    mapping: Mapping
    preset: str | None
    required: frozenset[str]
    options: ImportOptions
    format: str
    named: NamedFacts = NOT_NAMED
    above: FactsAbove = NOTHING_ABOVE
