"""JSON files: one impact, a list of them, or an object that holds the list under `data` or `impacts`."""

from __future__ import annotations

import codecs
from collections.abc import Iterator

from pydantic_core import from_json

from headimpact.recording import SIGNALS
from headimpact_service.errors import Problem
from headimpact_service.ingest.impact_json import MAX_NAME, FileImpactBody, Kinematics, SignalBody
from headimpact_service.ingest.impact_reading import to_record
from headimpact_service.ingest.json_faults import require_bounded, validated
from headimpact_service.ingest.json_items import items
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.overrides import with_options
from headimpact_service.ingest.record import ImpactRecord, RefusedImpact
from headimpact_service.ingest.source import Source

MAX_DOCUMENT = 32 * 1024 * 1024
"""The text of a JSON document is held whole; more impacts come as NDJSON."""
MAX_IMPACT = 8 * 1024 * 1024
"""As a JSON body."""


def read_json(source: Source, options: ImportOptions) -> Iterator[ImpactRecord | Problem]:
    """The impacts of a JSON file; pointers in a problem start at the impact."""
    refuse_table_options(options, "JSON")
    count = 0
    for text in items(source.read(MAX_DOCUMENT).removeprefix(codecs.BOM_UTF8)):
        count += 1
        if count > options.max_impacts:
            raise Problem("import-too-large", f"An import may hold at most {options.max_impacts} impacts.")
        try:
            yield read_impact_text(text, options, "impact")
        except Problem as problem:
            if problem.slug == "malformed-request":  # then the file is no JSON either
                raise Problem("unreadable-file", problem.detail) from None
            yield RefusedImpact(problem, sent_name(text))
    if count == 0:
        raise Problem("unreadable-file", "The file holds no impact.")


def read_impact_text(text: bytes, options: ImportOptions, what: str) -> ImpactRecord:
    """One impact of a file, under the same rules as a body.

    Raises
    ------
    Problem
        400 where the text is no JSON, 422 for what is too long or breaks a rule.
    """
    if len(text) > MAX_IMPACT:
        raise Problem("unreadable-file", f"The {what} may have at most {MAX_IMPACT} bytes.")
    try:
        require_bounded(text, what)
    except Problem as problem:
        raise Problem("unreadable-file", problem.detail) from None
    body = validated(text, FileImpactBody, what=what)
    _complete(body.kinematics, options)
    return with_options(to_record(body, time_zone=options.time_zone, what=what), options)


def _complete(kinematics: Kinematics, options: ImportOptions) -> None:
    """Put in what a signal needs and the sender says beside the file: a rate where it has no times, filled gaps."""
    if options.fill_gaps:
        kinematics.fill_gaps = True
    for name in SIGNALS if options.sample_rate_hz is not None else ():
        signal: SignalBody | None = getattr(kinematics, name)
        if signal is not None and signal.sample_rate_hz is None and signal.time_ms is None:
            signal.sample_rate_hz = options.sample_rate_hz


def sent_name(text: bytes) -> str | None:
    """What the sender calls an impact that is refused, if that much of it can be told."""
    if len(text) > MAX_IMPACT:
        return None
    try:
        require_bounded(text, "impact")
        item = from_json(text)
    except (Problem, ValueError):
        return None
    name = item.get("external_id") if isinstance(item, dict) else None
    return name if isinstance(name, str) and len(name) <= MAX_NAME else None


def refuse_table_options(options: ImportOptions, kind: str) -> None:
    """422 where a preset or mapping came with a file that names its own fields."""
    if options.preset is not None or options.mapping is not None:
        raise Problem("unreadable-file", f"A {kind} file names its own fields: it takes neither preset nor mapping.")
