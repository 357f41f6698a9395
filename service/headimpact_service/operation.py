"""One operation of the API: its rules and its documentation declared once, both held from that.

Every operation does the same things in the same order: key (401), scope (403), Accept (406), parameters (422), body
(415, 413, 408, 400, 422), and only then its own work. FastAPI routes it and documents it; its request handler, which
would read a body before it looks at a key, is replaced where FastAPI provides for that (docs/adr/0008-fastapi.md).
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Coroutine, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from pydantic import BaseModel
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from headimpact_service import deps
from headimpact_service.answers import JSON, preferred
from headimpact_service.bodies import read_json
from headimpact_service.deps import Caller
from headimpact_service.errors import Problem, not_found
from headimpact_service.intake.scoring import Terms
from headimpact_service.parameters import NoQuery, Query, parse_query
from headimpact_service.store.keys import KeyRow

PUBLIC = ""
"""Access of an operation that needs no key."""
NUL = "\x00"
ANY_KEY = deps.ANY
"""Access of an operation that any valid key may use."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A success: its shape, and the media types it comes in."""

    model: type[BaseModel] | None
    description: str
    media_types: tuple[str, ...] = (JSON,)
    headers: Mapping[str, str] = field(default_factory=dict)
    """Name of each header it always carries, and what that says."""


@dataclass(frozen=True, slots=True)
class BodyForm:
    """One media type a body is read in, for the documentation; `model` None for plain bytes."""

    media_type: str
    model: type[BaseModel] | None
    example: Mapping[str, Any] | None = None
    """A whole body that is taken."""


@dataclass(frozen=True, slots=True)
class Call:
    """A request that has passed every rule its operation declares."""

    request: Request
    caller: Caller | None
    query: Any
    body: Any
    media_type: str

    @property
    def data_set_id(self) -> bytes:
        """The data set that the caller's key sees."""
        return self.key.data_set_id

    @property
    def terms(self) -> Terms:
        """What the caller's organisation has its impacts scored with."""
        return self._known_caller().terms

    @property
    def key(self) -> KeyRow:
        """The caller's key."""
        return self._known_caller().key

    def _known_caller(self) -> Caller:
        if self.caller is None:
            raise LookupError("A public operation has no caller.")
        return self.caller

    async def renewed(self) -> Call:
        """The same request, with the terms of its organisation as they are stored now."""
        return replace(self, caller=await deps.renewed(self.request))

    def path(self, name: str) -> str:
        """A part of the path that names something; 404 for what no text of the database can be."""
        text = self.given(name)
        if NUL in text:
            raise not_found("address")
        return text

    def given(self, name: str) -> str:
        """A part of the path as it was sent, which its operation holds to rules of its own."""
        return str(self.request.path_params[name])


Handler = Callable[[Call], Awaitable[Response]]


@dataclass(frozen=True, slots=True)
class Operation:
    """What one method on one path takes and answers."""

    method: str
    path: str
    handler: Handler
    tag: str
    summary: str
    access: str
    answers: Mapping[int, Answer]
    query: type[Query] = NoQuery
    body: type[BaseModel] | None = None
    body_forms: tuple[BodyForm, ...] = ()
    body_required: bool = True
    request_headers: Mapping[str, str] = field(default_factory=dict)
    problems: tuple[str, ...] = ()
    documented: bool = True

    @property
    def taken(self) -> frozenset[str]:
        """The methods that it answers: HEAD as GET."""
        return frozenset({self.method, "HEAD"} if self.method == "GET" else {self.method})

    @property
    def media_types(self) -> tuple[str, ...]:
        """The media types of its success, the preferred one first; none for an empty answer."""
        return next(iter(self.answers.values())).media_types

    def endpoint(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The function that holds the rules, then does the work."""
        access, query_model, body_model, handler = self.access, self.query, self.body, self.handler
        offered = self.media_types

        async def endpoint(request: Request) -> Response:
            caller = await deps.authorize(request, access) if access != PUBLIC else None
            media_type = preferred(request.headers.get("accept"), offered) if offered else ""
            query = parse_query(request, query_model)
            body = await read_json(request, body_model) if body_model is not None else None
            return await handler(Call(request, caller, query, body, media_type))

        endpoint.__name__ = getattr(handler, "__name__", "endpoint")
        endpoint.__doc__ = handler.__doc__
        return endpoint


class Routes:
    """The operations of one resource, in the order they are declared."""

    def __init__(self, tag: str) -> None:
        """Operations are grouped under `tag` in the documentation."""
        self.tag = tag
        self.operations: list[Operation] = []

    def __call__(
        self,
        method: str,
        path: str,
        summary: str,
        access: str,
        answers: Mapping[int, Answer],
        *,
        query: type[Query] = NoQuery,
        body: type[BaseModel] | None = None,
        example: Mapping[str, Any] | None = None,
        body_forms: Sequence[BodyForm] = (),
        body_required: bool = True,
        request_headers: Mapping[str, str] | None = None,
        problems: Sequence[str] = (),
        documented: bool = True,
    ) -> Callable[[Handler], Handler]:
        """Declare the decorated function as an operation.

        With `body` the body is read and validated here, and `example` is one that is taken; `body_forms` alone
        documents a body that the handler reads.
        """
        forms = tuple(body_forms) or ((BodyForm(JSON, body, example),) if body is not None else ())

        def declare(handler: Handler) -> Handler:
            self.operations.append(
                Operation(
                    method=method,
                    path=path,
                    handler=handler,
                    tag=self.tag,
                    summary=summary,
                    access=access,
                    answers=answers,
                    query=query,
                    body=body,
                    body_forms=forms,
                    body_required=body_required,
                    request_headers=request_headers or {},
                    problems=tuple(problems),
                    documented=documented,
                )
            )
            return handler

        return declare


class OtherMethods:
    """Whatever a path's operations do not take: 405 with all that they take in `Allow`, where FastAPI names one."""

    def __init__(self, operations: Sequence[Operation]) -> None:
        """All `operations` share one path."""
        self.allowed = ", ".join(sorted(frozenset[str]().union(*(operation.taken for operation in operations))))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:  # noqa: ARG002 - ASGI's signature
        """Refuse one request."""
        raise Problem("method-not-allowed", f"This path takes {self.allowed}.", headers={"Allow": self.allowed})


def by_path(operations: Sequence[Operation]) -> dict[str, list[Operation]]:
    """The operations of each path, in their order."""
    found: dict[str, list[Operation]] = {}
    for operation in operations:
        found.setdefault(operation.path, []).append(operation)
    return found
