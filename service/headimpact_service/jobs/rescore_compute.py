"""What the child process of a re-score does: score stored traces under a version, part by part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from headimpact_service.errors import Problem
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.intake.cohorts import filter_of
from headimpact_service.intake.parts import parts
from headimpact_service.intake.records import rebuild_record
from headimpact_service.intake.registry import model_of
from headimpact_service.intake.rendering import new_score
from headimpact_service.intake.scoring import TOGETHER, UNKNOWN_DEVICE, Terms, score_records, terms_of
from headimpact_service.store import cohorts, impacts, traces
from headimpact_service.store.database import Database
from headimpact_service.store.score_rows import NewScore


@dataclass(frozen=True, slots=True)
class Rescored:
    """Some impacts with the revision that was scored and its score; `last` is the id that the part ends with."""

    number: int
    last: bytes
    scores: list[tuple[bytes, int, NewScore]]
    failed: int


def compute(arguments: dict[str, Any]) -> Iterator[int | Rescored]:
    """How many impacts there are, unless that is known; then part after part, behind those that are stored."""
    database = Database(arguments["database_url"], readers=1)
    try:
        yield from _parts(database, arguments)
    finally:
        database.close()


def _parts(database: Database, arguments: dict[str, Any]) -> Iterator[int | Rescored]:
    data_set_id, wanted = arguments["data_set_id"], filter_of(arguments["cohort"])
    until, last = arguments["until"], bytes.fromhex(arguments["after"])
    with database.read() as conn:
        if arguments["total"] is None:
            yield cohorts.count(conn, data_set_id, wanted, until=until)
        terms = _terms(conn, arguments)
    number = arguments["first"]
    while True:
        with database.read() as conn:
            members = cohorts.next_ids(conn, data_set_id, wanted, after=last, until=until, limit=arguments["chunk"])
            stored = impacts.traced(conn, data_set_id, list(members))
        if not members:
            return
        last = max(members)
        yield _scored(number, last, members, stored, terms)
        number += 1


def _terms(conn: Any, arguments: dict[str, Any]) -> Terms:  # noqa: ANN401 - a connection of the store
    sent = arguments["terms"]
    model = model_of(conn, arguments["data_set_id"], arguments["version"])
    return terms_of(sent["incidence"], sent["operating_points"], model)


def _scored(
    number: int, last: bytes, revisions: dict[bytes, int], stored: dict[bytes, tuple[Any, bytes]], terms: Terms
) -> Rescored:
    """The revision that was scored tells whether an impact was corrected meanwhile."""
    records = (
        (impact, rebuild_record(stored[impact][0], traces.decode(stored[impact][1]))) for impact in sorted(stored)
    )
    scores: list[tuple[bytes, int, NewScore]] = []
    for part in parts(records, _values, TOGETHER):
        found = score_records([(record, UNKNOWN_DEVICE) for _, record in part], terms)
        scores += [
            (impact, revisions[impact], new_score(item))
            for (impact, _), item in zip(part, found, strict=True)
            if not isinstance(item, Problem)
        ]
    return Rescored(number, last, scores, len(stored) - len(scores))


def _values(member: tuple[bytes, ImpactRecord]) -> int:
    return member[1].values
