"""Labels: what became of an impact, said by people; one at a time, or many from a table."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import partial
from typing import Any, Literal

from anyio.to_thread import run_sync
from pydantic import BaseModel, Field, model_validator
from starlette.responses import Response

from headimpact_service import deps
from headimpact_service.answers import CSV, answer, no_content
from headimpact_service.bodies import read_body, require_media_type
from headimpact_service.errors import Problem, not_found
from headimpact_service.ingest.impact_json import Name, Strict
from headimpact_service.ingest.label_table import LabelLine, read_labels
from headimpact_service.operation import Answer, BodyForm, Call, Routes
from headimpact_service.problem_shapes import ProblemDocument
from headimpact_service.routes.impacts import identifier
from headimpact_service.routes.preconditions import IF_MATCH, etag, if_match
from headimpact_service.store import ids, labels
from headimpact_service.store.labels import Attribution, Basis, Event, Label, NewLabel, OutcomeWord

routes = Routes("labels")

TABLE_BYTES = 16 * 1024 * 1024


class LabelBody(Strict):
    """What is said of an impact. Only `concussion` and `no_concussion` ever enter a fit."""

    outcome: OutcomeWord
    basis: Basis = Field(description="What the outcome rests on.")
    attribution: Attribution | None = Field(
        None,
        description="How a concussion was found to be this impact's: seen, or taken to be that of the highest peak "
        "angular acceleration in its session.",
    )
    event: Event | None = Field(None, description="Whether a head impact was seen to happen, as on video.")
    labelled_by: Name | None = Field(None, description="Your pseudonym for whoever says so.", examples=["clinician-3"])

    @model_validator(mode="after")
    def _is_consistent(self) -> LabelBody:
        if self.event == "false_positive" and self.outcome == "concussion":
            raise ValueError("An event that is a false positive cannot be a concussion.")
        if self.attribution is not None and self.outcome != "concussion":
            raise ValueError("Only a concussion is attributed to an impact.")
        return self


class LabelView(BaseModel):
    """What was said once; `outcome` is null where a label was taken back."""

    number: int
    outcome: OutcomeWord | None
    basis: Basis | None
    attribution: Attribution | None
    event: Event | None
    labelled_by: str | None
    diagnosis: str | None = Field(description="The diagnosis that this label comes of.")
    key: str | None = Field(description="The key that said so.")
    created_at: datetime
    superseded_at: datetime | None


class LabelWithHistory(LabelView):
    """The label of an impact, and all that was said before."""

    impact: str
    history: list[LabelView] = Field(description="Oldest first, the present label last.")


class LabelledView(BaseModel):
    """What became of a line."""

    index: int
    impact_id: str | None
    external_id: str | None
    status: Literal["labelled", "unchanged", "failed"]
    problem: ProblemDocument | None


class LabelSummary(BaseModel):
    """How many of each."""

    labelled: int
    unchanged: int
    failed: int


class LabelledTable(BaseModel):
    """What became of each line of a table."""

    data: list[LabelledView]
    summary: LabelSummary


ETAG = {"ETag": "The label's number, for If-Match."}
EXAMPLE = {
    "outcome": "concussion",
    "basis": "physician_diagnosis",
    "attribution": "observed",
    "event": "verified",
    "labelled_by": "clinician-3",
}


@routes(
    "PUT",
    "/v1/impacts/{impact_id}/label",
    "Label an impact",
    "labels:write",
    {200: Answer(LabelWithHistory, "The label as it is now.", headers=ETAG)},
    body=LabelBody,
    example=EXAMPLE,
    request_headers=IF_MATCH,
    problems=("not-found", "precondition-failed"),
)
async def put_label(call: Call) -> Response:
    """What was said before stays in the history, which is answered to keys with `labels:read`; others see the label.

    The same again changes nothing.
    """
    impact_id, number = identifier(call), if_match(call.request)
    new = said(call.body)

    def change(conn: Any) -> list[Label]:  # noqa: ANN401 - a connection of the store
        labels.put(conn, call.data_set_id, impact_id, new, call.key.id, if_match=number)
        return labels.history(conn, call.data_set_id, impact_id)

    return _answer(call, await deps.write(call.request, change))


@routes(
    "GET",
    "/v1/impacts/{impact_id}/label",
    "Read an impact's label",
    "labels:read",
    {200: Answer(LabelWithHistory, "The label with its history.", headers=ETAG)},
    problems=("not-found",),
)
async def read_label(call: Call) -> Response:
    """404 as long as nobody has ever labelled the impact; one that was taken back has `outcome` null."""
    impact_id = identifier(call)
    found = await deps.read(call.request, lambda conn: labels.history(conn, call.data_set_id, impact_id))
    if not found:
        raise not_found("label")
    return _answer(call, found)


@routes(
    "DELETE",
    "/v1/impacts/{impact_id}/label",
    "Take a label back",
    "labels:write",
    {204: Answer(None, "Taken back; the history says so.", ())},
    request_headers=IF_MATCH,
    problems=("not-found", "precondition-failed"),
)
async def withdraw_label(call: Call) -> Response:
    """The impact is unlabelled again, and enters no fit."""
    impact_id, number = identifier(call), if_match(call.request)
    await deps.write(
        call.request, lambda conn: labels.withdraw(conn, call.data_set_id, impact_id, call.key.id, if_match=number)
    )
    return no_content()


@routes(
    "POST",
    "/v1/labels",
    "Label many impacts",
    "labels:write",
    {207: Answer(LabelledTable, "What became of each line.")},
    body_forms=(BodyForm(CSV, None),),
    problems=("unreadable-file", "body-too-large", "unsupported-media-type"),
)
async def label_many(call: Call) -> Response:
    """A CSV of up to 50 000 lines: `impact_id` or `external_id`, `outcome`, `basis`, and the other fields of a label.

    Lines that can be taken are, all together; each of the others says why not. Two lines that say different things of
    one impact are both refused.
    """
    require_media_type(call.request, (CSV,))
    data = await read_body(call.request, TABLE_BYTES)
    lines = await run_sync(partial(read_labels, data, LabelBody))
    rows = await deps.write(call.request, partial(_label_all, call, lines))
    counts = {status: sum(row["status"] == status for row in rows) for status in ("labelled", "unchanged", "failed")}
    return answer({"data": rows, "summary": counts}, 207)


def _label_all(call: Call, lines: Sequence[LabelLine], conn: Any) -> list[dict[str, Any]]:  # noqa: ANN401 - a connection of the store
    return [_labelled(call, line, conn) for line in lines]


def _labelled(call: Call, line: LabelLine, conn: Any) -> dict[str, Any]:  # noqa: ANN401 - a connection of the store
    row = {"index": line.index, "impact_id": line.impact_id, "external_id": line.external_id}
    impact_id, fault = None, line.said if isinstance(line.said, Problem) else None
    if fault is None:
        impact_id = _find(call, line, conn)
        fault = not_found("impact") if impact_id is None else _contradiction(call, line, impact_id, conn)
    if fault is not None or impact_id is None or not isinstance(line.said, LabelBody):
        return row | {"status": "failed", "problem": None if fault is None else fault.as_dict()}
    _, news = labels.put(conn, call.data_set_id, impact_id, said(line.said), call.key.id)
    return row | {
        "impact_id": ids.encode("imp", impact_id),
        "status": "labelled" if news else "unchanged",
        "problem": None,
    }


def _find(call: Call, line: LabelLine, conn: Any) -> bytes | None:  # noqa: ANN401 - a connection of the store
    if line.impact_id is None:
        return labels.find_impact(conn, call.data_set_id, external_id=line.external_id)
    known = ids.decode("imp", line.impact_id)
    return None if known is None else labels.find_impact(conn, call.data_set_id, impact_id=known)


def _contradiction(call: Call, line: LabelLine, found: bytes, conn: Any) -> Problem | None:  # noqa: ANN401 - a connection of the store
    """What is wrong with a line whose two names are not of one impact: a column has slipped."""
    named = line.impact_id is not None and line.external_id is not None
    if named and found != labels.find_impact(conn, call.data_set_id, external_id=line.external_id):
        return Problem("invalid-payload", "The line's impact_id and external_id are not of one impact.")
    return None


def said(body: LabelBody) -> NewLabel:
    """A body as the store takes it. A concussion without more is taken to have been observed."""
    fields = body.model_dump()
    if body.outcome == "concussion" and body.attribution is None:
        fields["attribution"] = "observed"
    return NewLabel(**fields)


def _answer(call: Call, history: Sequence[Label]) -> Response:
    present = history[-1]
    if "labels:read" not in call.key.scopes:
        history = history[-1:]
    document = {"impact": ids.encode("imp", present.impact_id), **label_document(present)}
    return answer(document | {"history": [label_document(one) for one in history]}, headers=etag(present.number))


def label_document(label: Label) -> dict[str, Any]:
    """A label as it is answered."""
    return {
        "number": label.number,
        "outcome": label.outcome,
        "basis": label.basis,
        "attribution": label.attribution,
        "event": label.event,
        "labelled_by": label.labelled_by,
        "diagnosis": None if label.diagnosis_id is None else ids.encode("dia", label.diagnosis_id),
        "key": None if label.key_id is None else ids.encode("key", label.key_id),
        "created_at": label.created_at,
        "superseded_at": label.superseded_at,
    }
