"""Every way a request can fail: one table of problem types (RFC 9457), and the exception that carries one.

Nothing here knows of the web: the store and the importers raise :class:`Problem` too, and the edge renders it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

MAX_ERRORS = 20
"""A payload problem lists at most this many errors."""


@dataclass(frozen=True, slots=True)
class ProblemType:
    """One row of the registry: what its page in the documentation says."""

    status: int
    title: str
    meaning: str
    remedy: str


@dataclass(frozen=True, slots=True)
class PayloadError:
    """One fault of a request: where it is (a JSON pointer or a parameter's name) and what rule it breaks.

    `detail` names the rule and its bound, never the offending value.
    """

    detail: str
    code: str
    pointer: str | None = None
    parameter: str | None = None

    def as_dict(self) -> dict[str, str]:
        """The error as problem details show it."""
        place: dict[str, str] = {}
        if self.pointer is not None:
            place["pointer"] = self.pointer
        if self.parameter is not None:
            place["parameter"] = self.parameter
        return {**place, "detail": self.detail, "code": self.code}


PROBLEMS: Mapping[str, ProblemType] = MappingProxyType(
    {
        "malformed-request": ProblemType(
            400,
            "The request cannot be read",
            "The body or a header breaks the rules of its own format: text that is not JSON or not UTF-8, a gzip body "
            "that does not inflate, a multipart body without its boundary, JSON nested too deeply.",
            "Check how the client encodes the request; `errors` says where reading stopped, if that is known.",
        ),
        "bad-cursor": ProblemType(
            400,
            "The cursor is not one of ours",
            "`cursor` was not made by this list with these filters.",
            "Pass `next_cursor` unchanged with the same filters, or start again without a cursor.",
        ),
        "unauthenticated": ProblemType(
            401,
            "A valid key is needed",
            "The request has no `Authorization: Bearer` header, or its key is unknown, expired or revoked.",
            "Send a key made by `headimpact keys create` or `POST /v1/keys`.",
        ),
        "insufficient-scope": ProblemType(
            403,
            "The key lacks a scope",
            "The key is valid but was not given the scope that this operation needs; `detail` names it.",
            "Use a key that has the scope.",
        ),
        "not-found": ProblemType(
            404,
            "Nothing is here",
            "No such page, or no such resource in the data set of this key: the id may be malformed, unknown, deleted, "
            "or another organisation's; the answer is the same.",
            "Check the id and that the key is one of the right organisation and mode (live or test).",
        ),
        "method-not-allowed": ProblemType(
            405,
            "This path does not take that method",
            "The path exists; the method is not among those that it takes.",
            "Use one of the methods in the `Allow` header.",
        ),
        "not-acceptable": ProblemType(
            406,
            "No representation matches Accept",
            "The `Accept` header names no media type that this resource can be answered in.",
            "Ask for one of the media types that `detail` names, or send no `Accept` header.",
        ),
        "request-timeout": ProblemType(
            408,
            "The request did not arrive in time",
            "The client stopped sending before the body was complete.",
            "Send the request again; sending an impact again with the same `external_id` is safe.",
        ),
        "conflict": ProblemType(
            409,
            "The request does not fit the present state",
            "What was asked for contradicts what is stored; `detail` says how.",
            "Read the resource and decide again.",
        ),
        "label-conflict": ProblemType(
            409,
            "The label contradicts another",
            "What is said of an impact does not fit what is said of it, or of its session, already; `detail` says how.",
            "Read the label and its history, decide which of both holds, and take the other back first.",
        ),
        "external-id-conflict": ProblemType(
            409,
            "This external_id is taken",
            "A resource with this `external_id` exists with other content.",
            "Correct an impact with `PUT` and `If-Match`, or give the new one an `external_id` of its own.",
        ),
        "cohort-changed": ProblemType(
            409,
            "The cohort changed while it was fitted",
            "An impact of the cohort was deleted, corrected, labelled anew, or its athlete withdrew consent, before "
            "the model could be registered. It is the `problem` of a job, not an answer; nothing was registered.",
            "Order the fit again.",
        ),
        "cohort-unfit": ProblemType(
            409,
            "The cohort allows no fit",
            "Too little is labelled, all outcomes are of one kind, a predictor is constant or separates the outcomes; "
            "`detail` says what is missing. It is the `problem` of a job, not an answer.",
            "Label more impacts, widen the cohort, or choose `bias_correction: firth` where outcomes are separated.",
        ),
        "impact-deleted": ProblemType(
            409,
            "This impact was deleted",
            "The impact with this `external_id`, or of an import one with all of this content, was deleted; sending it "
            "again does not bring it back.",
            "If it is meant to be a new impact, send it to `POST /v1/impacts`, under another `external_id` or none.",
        ),
        "idempotency-conflict": ProblemType(
            409,
            "This idempotency key is taken",
            "The `Idempotency-Key` was sent before with another request: another file, or other fields beside it.",
            "Send the same request to be told of the same job, or a new key for a new one.",
        ),
        "job-cancelled": ProblemType(
            409,
            "The job was cancelled",
            "Somebody cancelled the job. It is the `problem` of a job, not an answer: what the job had stored until "
            "then stays stored, and `result` counts it.",
            "Order it again if it should go on: what is stored already is found, not stored twice.",
        ),
        "precondition-failed": ProblemType(
            412,
            "The resource has changed",
            "`If-Match` names a revision that is no longer the present one.",
            "Read the resource again, apply the change to what it is now, and send its new `ETag`.",
        ),
        "body-too-large": ProblemType(
            413,
            "The body is too large",
            "The body, as sent or inflated, is larger than this operation takes; `detail` names the bound.",
            "Send less in one request; large files go to `POST /v1/imports`.",
        ),
        "import-too-large": ProblemType(
            413,
            "The import is too large for one answer",
            "The file holds more impacts or bytes than an import takes at once; `detail` names the bound.",
            "Split the file.",
        ),
        "unsupported-media-type": ProblemType(
            415,
            "The body has a media type that is not taken here",
            "`Content-Type` is missing or names a type that this operation does not read, or `Content-Encoding` is "
            "neither `identity` nor `gzip`.",
            "Send one of the media types that `detail` names.",
        ),
        "invalid-payload": ProblemType(
            422,
            "The body breaks a rule",
            "The body is readable, but `errors` lists what in it is missing, unknown, of the wrong kind or out of "
            "bounds. Nothing was stored.",
            "Correct what the pointers in `errors` name.",
        ),
        "invalid-parameter": ProblemType(
            422,
            "A parameter breaks a rule",
            "A query parameter, form field or header is unknown, repeated, of the wrong kind or out of bounds.",
            "Correct what `parameter` in `errors` names.",
        ),
        "invalid-trace": ProblemType(
            422,
            "The record cannot be used",
            "The signals are well formed, but break a rule for records: their rate, their times, their length or "
            "their range. Nothing was stored.",
            "`errors` says which signal and channel, and which bound.",
        ),
        "improper-rotation": ProblemType(
            422,
            "A mounting is not a rotation",
            "A rotation of the mounting is not orthonormal with determinant +1 (within 1e-3): it would mirror or "
            "stretch the motion.",
            "Send the matrix that takes sensor axes to head axes; a mirrored axis map shows as determinant -1.",
        ),
        "mounting-missing": ProblemType(
            422,
            "The mounting is not known",
            "The signals are those of the sensor (`location: sensor`), but neither the request nor its device gives "
            "the mounting that takes them to the head.",
            "Send `mounting` in the kinematics, or store it with `PUT /v1/devices/{serial}`.",
        ),
        "operating-point-unreachable": ProblemType(
            422,
            "The model has no such operating point",
            "The model cannot give a threshold for the sensitivity or specificity that was asked for.",
            "Ask for one that `GET /v1/models/{version}` lists or that lies between those, or give a `threshold`.",
        ),
        "unreadable-file": ProblemType(
            422,
            "The file cannot be read",
            "The file is not what its type or preset says, or a part of it cannot be understood; `detail` says where.",
            "Check the file, the preset and the mapping; `dry_run=true` shows what is understood.",
        ),
        "precondition-required": ProblemType(
            428,
            "If-Match is needed",
            "A correction must say which revision it corrects.",
            "Read the resource and send its `ETag` as `If-Match`.",
        ),
        "too-many-requests": ProblemType(
            429,
            "Too many requests",
            "The key has used up the rate that this installation is configured for.",
            "Wait for the seconds in `Retry-After`.",
        ),
        "internal-error": ProblemType(
            500,
            "Something failed here",
            "A fault of the service. It is logged under the id in `detail`.",
            "Send the request again; if it stays, report the id to whoever runs the service.",
        ),
        "job-crashed": ProblemType(
            500,
            "The job was given up",
            "The process that worked on the job ended three times without getting any further. It is the `problem` of "
            "a job, not an answer: what the job had stored until then stays stored, and `result` counts it.",
            "Look into the log for why the process ended, such as too little memory; then order the job again.",
        ),
        "unavailable": ProblemType(
            503,
            "The service cannot answer now",
            "The database cannot be reached or is overloaded, or the service is shutting down. Nothing was stored "
            "that was not acknowledged.",
            "Send the request again after the seconds in `Retry-After`.",
        ),
    }
)


class Problem(Exception):  # noqa: N818 - the name of RFC 9457; it is an answer, not a fault
    """A request that fails, as one problem type.

    `detail` is a sentence for people that never holds the offending value. `extra` are further members of the
    problem document, `headers` go with the answer.
    """

    def __init__(
        self,
        slug: str,
        detail: str,
        *,
        errors: Sequence[PayloadError] = (),
        headers: Mapping[str, str] | None = None,
        extra: Mapping[str, Any] | None = None,
    ) -> None:
        """Look the slug up at once: an unknown one is a mistake of the code."""
        super().__init__(detail)
        self.slug = slug
        self.kind = PROBLEMS[slug]
        self.detail = detail
        self.errors = tuple(errors)[:MAX_ERRORS]
        self.headers = dict(headers or {})
        self.extra = dict(extra or {})

    def __reduce__(self) -> tuple[Any, ...]:
        """As another process gets it, also one of a subclass."""
        return _again, (self.slug, self.detail, self.errors, self.headers, self.extra)

    @property
    def status(self) -> int:
        """The HTTP status."""
        return self.kind.status

    def as_dict(self) -> dict[str, Any]:
        """The problem document of RFC 9457."""
        document: dict[str, Any] = {
            "type": f"/problems/{self.slug}",
            "title": self.kind.title,
            "status": self.kind.status,
            "detail": self.detail,
        }
        if self.errors:
            document["errors"] = [error.as_dict() for error in self.errors]
        return document | self.extra


def _again(
    slug: str, detail: str, errors: tuple[PayloadError, ...], headers: Mapping[str, str], extra: Mapping[str, Any]
) -> Problem:
    return Problem(slug, detail, errors=errors, headers=headers, extra=extra)


def not_found(what: str) -> Problem:
    """The 404 that every id gets which is none of the caller's."""
    return Problem("not-found", f"There is no such {what}.")


def invalid_parameter(parameter: str, detail: str, code: str) -> Problem:
    """The 422 for one query parameter, form field or header."""
    error = PayloadError(detail=detail, code=code, parameter=parameter)
    return Problem("invalid-parameter", detail, errors=[error])
