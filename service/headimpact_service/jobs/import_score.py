"""What the child process of an import does with the impacts that it has read: score them, part by part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from headimpact_service.ingest.upload import sample_count
from headimpact_service.intake.importing import Ready, look_up, make_ready, score_found
from headimpact_service.intake.parts import parts
from headimpact_service.intake.registry import DEFAULT, model_of
from headimpact_service.intake.scoring import terms_of
from headimpact_service.store.database import Database


@dataclass(frozen=True, slots=True)
class Chunk:
    """Some impacts of the file, ready to be stored; `first` is the index of the first of them."""

    number: int
    first: int
    ready: list[Ready]


def scored(found: Iterator[Any], arguments: dict[str, Any]) -> Iterator[Chunk]:
    """The chunks of a file, from the first that is not stored."""
    data_set_id, key_id = arguments["data_set_id"], arguments["key_id"]
    database = Database(arguments["database_url"], readers=1)
    try:
        with database.read() as conn:
            # A job that was ordered by a version which knew one model only does not say which.
            model = model_of(conn, data_set_id, arguments.get("model", DEFAULT.version))
        terms = terms_of(arguments["terms"]["incidence"], arguments["terms"]["operating_points"], model)
        first = 0
        for number, part in enumerate(parts(found, sample_count, arguments["chunk"])):
            if number >= arguments["first"]:
                with database.read() as conn:
                    known = look_up(conn, data_set_id, part)
                yield Chunk(number, first, make_ready(score_found(part, known, terms), key_id))
            first += len(part)
    finally:
        database.close()
