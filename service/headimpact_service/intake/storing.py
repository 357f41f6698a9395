"""A scored record as the rows of the store."""

from __future__ import annotations

from collections.abc import Sequence

from headimpact_service.intake.records import arrays, describe
from headimpact_service.intake.rendering import new_score
from headimpact_service.intake.scoring import Scored
from headimpact_service.store import ids, traces
from headimpact_service.store.impact_rows import NewImpact, Seen

_COLUMNS = ("session_id", "activity", "sport", "position")


def new_impact(scored: Scored, sent_content_digest: bytes, key_id: bytes | None, seen: Seen | None = None) -> NewImpact:
    """What is stored of a record and its score, with what it was `seen` under."""
    trace = traces.encode(arrays(scored.record.recording))
    return _new(scored, sent_content_digest, key_id, trace, seen)


def new_impacts(scored: Sequence[tuple[Scored, bytes]], key_id: bytes | None) -> list[NewImpact]:
    """The same of many, each with the digest of what was sent."""
    encoded = traces.encode_many([arrays(item.record.recording) for item, _ in scored])
    return [_new(item, digest, key_id, trace, None) for (item, digest), trace in zip(scored, encoded, strict=True)]


def _new(
    scored: Scored, sent_content_digest: bytes, key_id: bytes | None, trace: bytes, seen: Seen | None
) -> NewImpact:
    record = scored.record
    context = record.context
    rest = {name: value for name, value in context.items() if name not in _COLUMNS}
    return NewImpact(
        content_digest=sent_content_digest,
        input_digest=scored.input_digest,
        document=describe(record),
        trace=trace,
        score=new_score(scored),
        external_id=record.external_id,
        athlete_id=None if record.athlete_id is None else (ids.decode("ath", record.athlete_id) or UNKNOWN_ATHLETE),
        athlete_external_id=record.athlete_external_id,
        device_serial=record.device_serial,
        occurred_at=record.occurred_at,
        session_id=context.get("session_id"),
        activity=context.get("activity"),
        sport=context.get("sport"),
        position=context.get("position"),
        context=rest or None,
        key_id=key_id,
        seen=seen,
        mounted_by_device=scored.sent_digest != scored.input_digest,
    )


# A malformed athlete id is no athlete's, like an unknown one: it takes the same way to the same answer.
UNKNOWN_ATHLETE = bytes(ids.LENGTH)
