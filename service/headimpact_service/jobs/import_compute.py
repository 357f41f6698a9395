"""What the child process of an import does: read the file, score it part by part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from headimpact_service.errors import Problem
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.upload import read_upload, sample_count
from headimpact_service.intake.importing import Ready, look_up, make_ready, score_found
from headimpact_service.intake.parts import parts
from headimpact_service.intake.registry import DEFAULT, model_of
from headimpact_service.intake.scoring import Terms, terms_of
from headimpact_service.store.database import Database


@dataclass(frozen=True, slots=True)
class Chunk:
    """Some impacts of the file, ready to be stored; `first` is the index of the first of them."""

    number: int
    first: int
    ready: list[Ready]


def compute(arguments: dict[str, Any]) -> Iterator[int | Chunk]:
    """How many impacts the file holds, unless that is known; then its chunks, from the first that is not stored.

    The file is read to its end before anything of it is scored: one that breaks in its midst stores nothing, as in a
    request.
    """
    path, size = Path(arguments["path"]), arguments["chunk"]
    options = ImportOptions.from_fields(arguments["fields"], **arguments["known"])
    if not path.exists():
        raise Problem("unreadable-file", "The file that was uploaded is no longer there.")
    if arguments["total"] is None:
        yield sum(1 for _ in read_upload(path, options))
    database = Database(arguments["database_url"], readers=1)
    try:
        with database.read() as conn:
            # A job that was ordered by a version which knew one model only does not say which.
            model = model_of(conn, arguments["data_set_id"], arguments.get("model", DEFAULT.version))
        terms = terms_of(arguments["terms"]["incidence"], arguments["terms"]["operating_points"], model)
        yield from _chunks(database, read_upload(path, options), size, terms, arguments)
    finally:
        database.close()


def _chunks(
    database: Database, found: Iterator[Any], size: int, terms: Terms, arguments: dict[str, Any]
) -> Iterator[Chunk]:
    data_set_id, key_id = arguments["data_set_id"], arguments["key_id"]
    first = 0
    for number, part in enumerate(parts(found, sample_count, size)):
        if number >= arguments["first"]:
            with database.read() as conn:
                known = look_up(conn, data_set_id, part)
            yield Chunk(number, first, make_ready(score_found(part, known, terms), key_id))
        first += len(part)
