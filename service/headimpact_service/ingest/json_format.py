"""JSON files: one impact, a list of them, or an object that holds the list under `data` or `impacts`."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from typing import Any

from pydantic import ValidationError
from pydantic_core import from_json

from headimpact_service.errors import Problem
from headimpact_service.ingest.impact_json import MAX_NAME, FileImpactBody
from headimpact_service.ingest.impact_reading import to_record
from headimpact_service.ingest.json_faults import MAX_MEMBERS, members, payload_errors, rules_problem, too_many_members
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.overrides import with_options
from headimpact_service.ingest.record import ImpactRecord, RefusedImpact
from headimpact_service.ingest.source import Source

_LISTS = ("data", "impacts")
MAX_DOCUMENT = 32 * 1024 * 1024
"""A JSON document is held whole; more impacts come as NDJSON."""


def read_json(source: Source, options: ImportOptions) -> Iterator[ImpactRecord | Problem]:
    """The impacts of a JSON file; pointers in a problem start at the impact."""
    refuse_table_options(options, "JSON")
    for item in _items(_document(source.read(MAX_DOCUMENT)), options.max_impacts):
        try:
            yield read_item(item, options)
        except Problem as problem:
            yield RefusedImpact(problem, sent_name(item))


def read_item(item: Any, options: ImportOptions) -> ImpactRecord:  # noqa: ANN401 - any JSON
    """One impact of a parsed file, under the same rules as a body."""
    if members(item) > MAX_MEMBERS:
        raise Problem("unreadable-file", too_many_members("impact").detail)
    try:
        body = FileImpactBody.model_validate(item)
    except ValidationError as error:
        faults = error.errors(include_url=False, include_input=False)
        raise rules_problem(payload_errors(faults, item), what="impact", count=len(faults)) from None
    return with_options(to_record(body, time_zone=options.time_zone, what="impact"), options)


def sent_name(item: Any) -> str | None:  # noqa: ANN401 - any JSON
    """What the sender calls an impact that is refused, if that much of it can be told."""
    name = item.get("external_id") if isinstance(item, dict) else None
    return name if isinstance(name, str) and len(name) <= MAX_NAME else None


def refuse_table_options(options: ImportOptions, kind: str) -> None:
    """422 where a preset or mapping came with a file that names its own fields."""
    if options.preset is not None or options.mapping is not None:
        raise Problem("unreadable-file", f"A {kind} file names its own fields: it takes neither preset nor mapping.")


def _document(data: bytes) -> Any:  # noqa: ANN401 - any JSON
    try:
        return from_json(data.removeprefix(codecs.BOM_UTF8))
    except ValueError as error:
        # The parser's words say what and where, and hold nothing of the text itself.
        raise Problem("unreadable-file", f"The file is not JSON: {error}.") from None


def _items(document: Any, max_impacts: int) -> list[Any]:  # noqa: ANN401 - any JSON
    items = _listed(document)
    if not items:
        raise Problem("unreadable-file", "The file holds no impact.")
    if len(items) > max_impacts:
        raise Problem("import-too-large", f"An import may hold at most {max_impacts} impacts.")
    return items


def _listed(document: Any) -> list[Any]:  # noqa: ANN401 - any JSON
    if isinstance(document, list):
        return document
    if isinstance(document, dict) and len(document) == 1:
        held = next((document[name] for name in _LISTS if name in document), None)
        if isinstance(held, list):
            return held
    return [document]
