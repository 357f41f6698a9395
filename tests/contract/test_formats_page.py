"""docs/formats.md is held to the presets, the mapping and the columns of the code."""

from __future__ import annotations

import json

from documents import blocks, spans, table, text

from headimpact_service.ingest.impact_json import Context
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.presets import presets
from headimpact_service.intake.exporting import SAMPLE_COLUMNS
from headimpact_service.routes.impact_shapes import COLUMNS
from headimpact_service.store.tables import CRITERION_COLUMNS

PAGE = "docs/formats.md"


def test_every_preset_is_listed_with_what_it_reads_and_what_must_be_added() -> None:
    listed = [
        (spans(name)[0], title, seen == "yes", spans(added)) for name, title, seen, added in table(PAGE, "## Presets")
    ]
    known = [(p.name, p.title, p.recognised, list(p.requires)) for p in presets().values()]
    assert listed == sorted(known)


def test_the_example_of_a_mapping_is_one_that_is_taken() -> None:
    [example] = [json.loads(block) for block in blocks(PAGE)]
    Mapping.model_validate(example)


def test_the_columns_of_exported_samples_are_listed_in_their_order() -> None:
    listed = [name for names, _ in table(PAGE, "### Impacts with their samples") for name in spans(names)]
    assert tuple(listed) == SAMPLE_COLUMNS


def test_the_columns_of_exported_scores_are_those_that_there_are() -> None:
    listed = [name for names, _ in table(PAGE, "### Impacts with their scores") for name in spans(names)]
    whole = {name for name in listed if not name.startswith("...")}
    assert whole <= set(COLUMNS)
    criteria = {name for name in COLUMNS if name.removesuffix("_probability") in CRITERION_COLUMNS or _axis(name)}
    assert set(COLUMNS) - whole <= criteria | set(Context.model_fields)


def _axis(name: str) -> bool:
    return any(name in columns for columns in CRITERION_COLUMNS.values())


def test_every_field_of_a_mapping_that_is_named_exists() -> None:
    for name in ("drop_rows", "context", "reading", "unscorable", "time_base", "group_by"):
        assert f"`{name}`" in text(PAGE) or f'"{name}"' in text(PAGE)
        assert name in Mapping.model_fields
