"""Impacts: stored once, corrected with their revisions kept, deleted with only a tombstone left.

Every function that writes runs inside the writer's transaction, so what it reads cannot change before it commits.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import BindParameter, Connection, and_, bindparam, select, update

from headimpact_service.errors import Problem, not_found
from headimpact_service.store import athletes as athlete_store
from headimpact_service.store import devices as device_store
from headimpact_service.store import duplicates, erasure, ids, labels
from headimpact_service.store.clock import later_than, next_change
from headimpact_service.store.impact_inserts import content_members, first_row, insert_revisions, insert_rows
from headimpact_service.store.impact_known import Known, look_up
from headimpact_service.store.impact_lists import (
    ImpactFilters,
    Trace,
    find_same_content,
    get,
    get_any,
    page,
    revisions,
    trace,
    traced,
)
from headimpact_service.store.impact_rows import (
    Impact,
    NewImpact,
    Outcome,
    Revision,
    ScoreOutdated,
    external_id_digest,
    former_content,
    former_event,
)
from headimpact_service.store.prepared import Prepared
from headimpact_service.store.revision import ANY, require_revision
from headimpact_service.store.score_rows import stored
from headimpact_service.store.scores import next_number
from headimpact_service.store.tables import former_contents, impact_revisions, impacts

__all__ = [
    "Impact",
    "ImpactFilters",
    "NewImpact",
    "Outcome",
    "Revision",
    "Trace",
    "add",
    "correct",
    "delete",
    "find_same_content",
    "get",
    "get_any",
    "page",
    "revisions",
    "trace",
    "traced",
]

_DATA_SET: BindParameter[bytes] = bindparam("data_set_id")
_SAME_EVENT = Prepared(
    select(impacts.c.id)
    .where(
        impacts.c.data_set_id == _DATA_SET,
        impacts.c.input_digest == bindparam("input_digest"),
        impacts.c.athlete_id.is_not_distinct_from(bindparam("athlete_id")),
        impacts.c.occurred_at.is_not_distinct_from(bindparam("occurred_at")),
    )
    .limit(1)
)
_SAME_DELIVERY = Prepared(
    select(impacts.c.id)
    .join(
        impact_revisions,
        and_(impact_revisions.c.impact_id == impacts.c.id, impact_revisions.c.revision == impacts.c.revision),
    )
    .where(
        impacts.c.data_set_id == _DATA_SET,
        impacts.c.athlete_id.is_not_distinct_from(bindparam("athlete_id")),
        impacts.c.occurred_at.is_not_distinct_from(bindparam("occurred_at")),
        impact_revisions.c.content_digest == bindparam("content_digest"),
    )
    .limit(1)
)
_FORMER = Prepared(
    select(impacts.c.id, impacts.c.deleted_at)
    .join(former_contents, former_contents.c.impact_id == impacts.c.id)
    .where(
        impacts.c.data_set_id == _DATA_SET,
        former_contents.c.data_set_id == _DATA_SET,
        former_contents.c.digest == bindparam("former_content"),
    )
    .order_by(impacts.c.deleted_at.is_not(None))
    .limit(1)
)
_INTERNAL = frozenset({"data_set_id", "external_id_digest", "score_number"})
_UPDATE = update(impacts).where(impacts.c.data_set_id == bindparam("of_data_set"), impacts.c.id == bindparam("impact"))
_SUPERSEDE = update(impact_revisions).where(
    impact_revisions.c.impact_id == bindparam("impact"), impact_revisions.c.revision == bindparam("before")
)


def add(conn: Connection, data_set_id: bytes, new: NewImpact, *, same_event_is_unchanged: bool = False) -> Outcome:
    """Store an impact with its trace and score, or find that it is there.

    A redelivery of an external id with the content of any kept revision is `unchanged`; with other content it is an
    `external-id-conflict` problem, and `impact-deleted` after a deletion. An athlete id that is none of the data set's
    is a `not-found` problem, and a score that was made under what has changed since is :class:`ScoreOutdated`. With
    `same_event_is_unchanged` (imports), an impact of the same athlete, instant and input is `unchanged` too, under
    whatever name that is not taken, and so is what was corrected since; what was deleted does not come back.
    """
    known = look_up(conn, data_set_id, new)
    if known.same_external_id is not None:
        return _redelivery(conn, data_set_id, new, known, known.same_external_id)
    if same_event_is_unchanged:
        there = _same_event(conn, data_set_id, new, known) or _former(conn, data_set_id, new, known)
        if there is not None:
            return Outcome("unchanged", there)
    _require_present(new, known)
    return Outcome("created", _insert(conn, data_set_id, new, known))


def _require_present(new: NewImpact, known: Known) -> None:
    """Refuse a score that was made under what has changed since, in this process or in another."""
    if new.seen is not None and new.seen != known.seen:
        raise ScoreOutdated


def _same_event(conn: Connection, data_set_id: bytes, new: NewImpact, known: Known) -> Impact | None:
    """The stored impact of the same athlete, instant and input, or delivered just so before its device was remounted.

    Raises
    ------
    Problem
        409 `conflict` where it says otherwise whether it is valid, or whether the device was worn.
    """
    if known.same_content is None and not new.mounted_by_device:
        return None
    athlete_id = known.athlete
    if athlete_id is None and new.athlete_external_id is not None:
        return None  # an athlete never seen before has no impacts
    parameters = {"data_set_id": data_set_id, "athlete_id": athlete_id, "occurred_at": new.occurred_at}
    found = _SAME_EVENT.first(conn, parameters | {"input_digest": new.input_digest})
    if found is None and new.mounted_by_device:
        found = _SAME_DELIVERY.first(conn, parameters | {"content_digest": new.content_digest})
    same = None if found is None else get(conn, data_set_id, found[0])
    if same is not None:
        _require_same_marks(new, same)
    return same


def _require_same_marks(new: NewImpact, present: Impact) -> None:
    """Refuse to take for unchanged what is now said not to be valid, or not to have been worn, or so no more."""
    marks = [
        (bool((document or {}).get("unscorable")), (context or {}).get("worn"))
        for document, context in ((new.document, new.context), (present.document, present.context))
    ]
    if marks[0] != marks[1]:
        raise Problem(
            "conflict",
            f"The same signals are stored as {ids.encode('imp', present.id)} with another mark of their validity, or "
            "of whether the device was worn: correct that impact, or delete it and send this one to POST /v1/impacts.",
        )


def _former(conn: Connection, data_set_id: bytes, new: NewImpact, known: Known) -> Impact | None:
    """The impact that was delivered just so and was corrected since.

    Raises
    ------
    Problem
        409 `impact-deleted` where it, or the same event of the same athlete, was deleted.
    """
    digests = [former_content(data_set_id, new.content_digest)]
    if known.athlete is not None or new.athlete_external_id is None:
        digests.append(former_event(data_set_id, known.athlete, new.occurred_at, new.input_digest))
    parameters = ({"data_set_id": data_set_id, "former_content": digest} for digest in digests)
    found = next(filter(None, (_FORMER.first(conn, asked) for asked in parameters)), None)
    if found is None:
        return None
    if found[1] is not None:
        raise Problem("impact-deleted", "This impact was deleted; to store it again, send it to POST /v1/impacts.")
    return get(conn, data_set_id, found[0])


def _redelivery(conn: Connection, data_set_id: bytes, new: NewImpact, known: Known, impact_id: bytes) -> Outcome:
    """The stored impact of the same external id, if the content is that of one of its revisions."""
    stored_impact = get(conn, data_set_id, impact_id)
    if stored_impact is None:
        raise Problem("impact-deleted", "The impact with this external_id was deleted.")
    if any(kept.content_digest == new.content_digest for kept in revisions(conn, data_set_id, impact_id)):
        return Outcome("unchanged", stored_impact)
    if _is_the_same_by_another_name(new, known, stored_impact):
        return Outcome("unchanged", stored_impact)
    raise Problem("external-id-conflict", "An impact with this external_id exists with other content.")


def _is_the_same_by_another_name(new: NewImpact, known: Known, present: Impact) -> bool:
    """Whether only the athlete is called otherwise: by our id, or as they are called now."""
    if known.athlete is None or new.document != present.document:
        return False
    content = content_members(new, known.athlete, known.device)
    return new.device_serial == present.device_serial and all(
        getattr(present, name) == value for name, value in content.items() if name != "device_id"
    )


def _insert(conn: Connection, data_set_id: bytes, new: NewImpact, known: Known) -> Impact:
    """Three rows: the impact, its first revision with the trace, its score."""
    now = later_than(known.last_change)
    athlete_id, device_id = _athlete_and_device(conn, data_set_id, new, known)
    row = first_row(data_set_id, new, athlete_id, device_id, now) | {"duplicate_of": known.same_content}
    insert_rows(conn, [(new, row)])
    return Impact(
        **{name: value for name, value in row.items() if name not in _INTERNAL},
        athlete_external_id=_athlete_external_id(conn, data_set_id, new, known),
        device_serial=new.device_serial,
        document=new.document,
        score=stored(new.score, row["id"], 1, 1, now),
    )


def _athlete_external_id(conn: Connection, data_set_id: bytes, new: NewImpact, known: Known) -> str | None:
    """What the impact's athlete is called: as it was sent, unless it was sent by our id or that athlete was merged."""
    if new.athlete_id is not None:
        return known.athlete_external_id
    if known.merged_into is None:
        return new.athlete_external_id
    return athlete_store.require(conn, data_set_id, known.merged_into).external_id


def _athlete_and_device(
    conn: Connection, data_set_id: bytes, new: NewImpact, known: Known
) -> tuple[bytes | None, bytes | None]:
    """Their ids; each is made if it is new."""
    athlete_id = known.athlete
    if athlete_id is None and new.athlete_external_id is not None:
        athlete_id = athlete_store.ensure(conn, data_set_id, new.athlete_external_id)
    device_id = known.device
    if device_id is None and new.device_serial is not None:
        device_id = device_store.ensure(conn, data_set_id, new.device_serial)
    return athlete_id, device_id


def correct(
    conn: Connection, data_set_id: bytes, impact_id: bytes, new: NewImpact, *, if_match: int | None = None
) -> Outcome:
    """Replace an impact's content; the revision before is kept with its trace and score, and what was said of it.

    Only the label of a diagnosis is taken back from an impact that is no more of that athlete and session.

    What it is already is `unchanged`, also when `if_match` is the revision before: a correction that is sent twice was
    done once. A name that is another athlete's now is a correction, whatever was sent before.
    """
    present = _require(conn, data_set_id, impact_id)
    known = look_up(conn, data_set_id, new)
    _require_present(new, known)
    sent_again = if_match in {None, ANY} or present.revision - if_match in {0, 1}
    if sent_again and _is_already(conn, data_set_id, present, new, known):
        return Outcome("unchanged", present)
    require_revision(present.revision, if_match)
    content = content_members(new, *_athlete_and_device(conn, data_set_id, new, known))
    changed = _name(data_set_id, present, new, known) | content
    if new.input_digest != present.input_digest:
        duplicates.release(conn, data_set_id, [impact_id])
    now = next_change(conn, impacts, data_set_id)
    changed |= {
        "duplicate_of": find_same_content(conn, data_set_id, new.input_digest, exclude=impact_id),
        "revision": present.revision + 1,
        "score_number": next_number(conn, impact_id),
        "updated_at": now,
    }
    conn.execute(_UPDATE, changed | {"of_data_set": data_set_id, "impact": impact_id})
    conn.execute(_SUPERSEDE, {"impact": impact_id, "before": present.revision, "superseded_at": now})
    erasure.remember(conn, data_set_id, [impact_id])
    insert_revisions(conn, [(new, changed | {"data_set_id": data_set_id, "id": impact_id})])
    labels.withdraw_of_another(conn, data_set_id, impact_id, new.key_id)
    return Outcome("corrected", _require(conn, data_set_id, impact_id))


def _is_already(conn: Connection, data_set_id: bytes, present: Impact, new: NewImpact, known: Known) -> bool:
    """Whether a correction would leave the impact as it is: content, name, whose it is, and what its device adds."""
    if new.external_id is not None and new.external_id != present.external_id:
        return False
    if (known.athlete, known.device) != (present.athlete_id, present.device_id):
        return False
    if present.input_digest != new.input_digest or _ranges(present.document) != _ranges(new.document):
        return False
    return revisions(conn, data_set_id, present.id)[-1].content_digest == new.content_digest


def _ranges(document: Mapping[str, Any] | None) -> dict[str, float | None]:
    """What each signal's sensor can show: no digest holds it, and the device's page may say it."""
    signals = (document or {}).get("signals", {})
    return {name: signal["declared_range"] for name, signal in signals.items()}


def _name(data_set_id: bytes, present: Impact, new: NewImpact, known: Known) -> dict[str, Any]:
    """The external id after a correction: kept, or given now to an impact that had none."""
    if new.external_id is None or new.external_id == present.external_id:
        return {}
    if present.external_id is not None:
        raise Problem("conflict", "The external_id of an impact cannot be changed.")
    if known.same_external_id is not None:
        raise Problem("external-id-conflict", "Another impact has, or had, this external_id.")
    return {"external_id": new.external_id, "external_id_digest": external_id_digest(data_set_id, new.external_id)}


def delete(conn: Connection, data_set_id: bytes, impact_id: bytes, *, if_match: int | None = None) -> Impact:
    """Delete an impact's content and keep its tombstone, with its external id, which stays taken."""
    present = _require(conn, data_set_id, impact_id)
    require_revision(present.revision, if_match)
    erasure.erase_impacts(conn, data_set_id, [impact_id], external_ids=False)
    return get_any(conn, data_set_id, impact_id) or present


def _require(conn: Connection, data_set_id: bytes, impact_id: bytes) -> Impact:
    found = get(conn, data_set_id, impact_id)
    if found is None:
        raise not_found("impact")
    return found
