"""`POST /v1/score`: one impact scored, nothing stored."""

from __future__ import annotations

from starlette.responses import Response

from headimpact_service import examples
from headimpact_service.answers import answer
from headimpact_service.ingest.impact_json import ScoreBody
from headimpact_service.ingest.impact_reading import to_record
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.intake.facts import Found, with_population_note
from headimpact_service.intake.rendering import new_score, score_document, scored_traces
from headimpact_service.intake.scoring import UNKNOWN_DEVICE, Scored
from headimpact_service.operation import Answer, Call, Routes
from headimpact_service.routes.score_shapes import ScoreView
from headimpact_service.store.impact_rows import Seen

routes = Routes("scores")

RECORD_PROBLEMS = ("invalid-trace", "improper-rotation", "mounting-missing", "operating-point-unreachable")


@routes(
    "POST",
    "/v1/score",
    "Score an impact",
    "score",
    {200: Answer(ScoreView, "The score.")},
    body=ScoreBody,
    example=examples.score(),
    problems=RECORD_PROBLEMS,
)
async def score_impact(call: Call) -> Response:
    """Nothing is stored; a device named by its serial lends its mounting, if it is known."""
    record = to_record(call.body)
    scored, _ = await score(call, record)
    document = score_document(new_score(scored))
    if "traces" in record.include:
        document["traces"] = scored_traces(scored)
    return answer(document)


async def score(call: Call, record: ImpactRecord) -> tuple[Scored, Seen]:
    """The record scored under the terms of the caller's organisation, and under which revisions of what that was."""
    device, athlete = await facts_of(call, record)
    noted = with_population_note(record, athlete)
    scored: Scored = await call.request.app.state.scorer.score(noted, call.terms, device)
    key = call.key
    return scored, Seen(
        key.settings_revision, key.model, None if athlete is None else athlete.revision, device.revision
    )


async def facts_of(call: Call, record: ImpactRecord) -> Found:
    """What is known of the record's device and athlete."""
    if record.device_serial is None and record.athlete_id is None and record.athlete_external_id is None:
        return UNKNOWN_DEVICE, None
    found: Found = await call.request.app.state.facts.of(call, record)
    return found
