"""The routes and the OpenAPI document, both made by FastAPI from the operations' declarations."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Coroutine, Mapping, Sequence
from typing import Annotated, Any

from fastapi import Body, Path, Security
from fastapi.openapi.utils import get_openapi
from fastapi.responses import JSONResponse
from fastapi.routing import APIRoute
from fastapi.security import HTTPBearer
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from headimpact_service import __version__
from headimpact_service.answers import CSV, JSON, NEXT_CURSOR, PROBLEM_JSON
from headimpact_service.errors import PROBLEMS
from headimpact_service.operation import ANY_KEY, PUBLIC, Answer, BodyForm, Operation, OtherMethods, by_path
from headimpact_service.problem_shapes import ProblemDocument

KEY = HTTPBearer(scheme_name="key", description="A key of this service.", auto_error=False)
"""How a key is documented; :mod:`headimpact_service.deps` looks it up."""
_REF = "#/components/schemas/{model}"
_NAME_IN_PATH = re.compile(r"{(\w+)(?::path)?}")
_ALWAYS = ("not-acceptable", "invalid-parameter", "internal-error", "unavailable")
_WITH_KEY = ("unauthenticated", "insufficient-scope", "too-many-requests")
_WITH_BODY = (
    "malformed-request",
    "request-timeout",
    "body-too-large",
    "unsupported-media-type",
    "invalid-payload",
)
_HEADER_SCHEMAS = {
    "If-Match": {"type": "string", "pattern": r'^("(0|[1-9][0-9]{0,8})"|\*)$'},
    "Idempotency-Key": {"type": "string", "pattern": r"^[!-~]{1,200}$"},
    "Prefer": {"type": "string", "enum": ["respond-async"]},
}
_PROBLEM_HEADERS = {401: "WWW-Authenticate", 429: "Retry-After", 503: "Retry-After"}
_ABOUT = """\
Head-impact traces in; brain angles, injury criteria and concussion probabilities out, after Laksari, Fanton et al.,
"Multi-directional dynamic model for traumatic brain injury detection" (J. Neurotrauma 2020).

For research use. The published model rests on adult men; it is no diagnosis.

Every answer carries `X-Request-Id`, the request's own if it sent a usable one. Every error is a problem document
(RFC 9457) whose `type` is a page of this service; `/problems` lists them. A path answers a method that it does not take
with 405 and all that it takes in `Allow`; HEAD is answered as GET is, without the body. Request bodies may be gzip
(`Content-Encoding: gzip`).
"""


class StrictRoute(APIRoute):
    """FastAPI's route: matched and documented by FastAPI, handled in the operation's own order of rules."""

    def __init__(self, operation: Operation) -> None:
        """The route of one operation."""
        self.operation = operation
        status, answer = next(iter(operation.answers.items()))
        super().__init__(
            operation.path,
            _declared(operation),
            methods=[operation.method],
            operation_id=operation.handler.__name__,
            tags=[operation.tag],
            summary=operation.summary,
            description=_description(operation),
            status_code=status,
            response_model=answer.model,
            response_class=_response_class(answer),
            response_description=answer.description,
            responses=_responses(operation),
            dependencies=[] if operation.access == PUBLIC else [Security(KEY)],
            include_in_schema=operation.documented,
            openapi_extra=_extra(operation),
        )

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The operation itself, instead of FastAPI's reading of parameters and bodies."""
        return self.operation.endpoint()


def routes(operations: Sequence[Operation]) -> list[BaseRoute]:
    """The routes of all operations; after those of each path one for every other method.

    What is read with GET answers HEAD with the same headers; the server leaves the body out.
    """
    found: list[BaseRoute] = []
    for path, same_path in by_path(operations).items():
        for operation in same_path:
            route = StrictRoute(operation)
            route.methods = set(operation.taken)
            found.append(route)
        found.append(Route(path, OtherMethods(same_path), include_in_schema=False))
    return found


def document(operations: Sequence[Operation]) -> dict[str, Any]:
    """The whole document."""
    specification = get_openapi(
        title="Headimpact",
        version=__version__,
        description=_ABOUT,
        routes=[StrictRoute(operation) for operation in operations],
        servers=[{"url": "/"}],
        tags=[{"name": tag} for tag in dict.fromkeys(o.tag for o in operations if o.documented)],
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
    )
    problem_document = {"ProblemDocument": ProblemDocument.model_json_schema(ref_template=_REF)}
    specification["components"]["schemas"] |= problem_document
    # a path's own pattern for the rest of a path is no part of its name
    specification["paths"] = {path.replace(":path}", "}"): item for path, item in specification["paths"].items()}
    return specification


def as_text(specification: Mapping[str, Any]) -> str:
    """The document as the committed file holds it."""
    return json.dumps(specification, indent=2, ensure_ascii=False) + "\n"


def _declared(operation: Operation) -> Callable[..., None]:
    """A function with the signature that FastAPI documents: the names in the path and the JSON body."""

    def endpoint() -> None:
        """Never called: the route's handler is the operation."""

    keyword = inspect.Parameter.KEYWORD_ONLY
    parameters = [
        inspect.Parameter(name, keyword, annotation=Annotated[str, Path(min_length=1)])
        for name in _NAME_IN_PATH.findall(operation.path)
    ]
    for form in operation.body_forms:
        if form.model is not None:
            model: Any = form.model
            parameters.append(
                inspect.Parameter("body", keyword, annotation=Annotated[model, Body(media_type=form.media_type)])
            )
    endpoint.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined] # as inspect documents it
    endpoint.__name__ = operation.handler.__name__
    return endpoint


def _response_class(answer: Answer) -> type[Response]:
    """What its main media type is documented by."""
    if answer.media_types[:1] == (JSON,):
        return JSONResponse
    return type("Documented", (Response,), {"media_type": next(iter(answer.media_types), None)})


def _extra(operation: Operation) -> dict[str, Any]:
    """What FastAPI does not read off a signature: strict parameters, and bodies in several media types."""
    parameters = [*_query_parameters(operation), *_header_parameters(operation)]
    extra: dict[str, Any] = {"parameters": parameters} if parameters else {}
    if operation.access == PUBLIC:
        extra["security"] = []
    if operation.body_forms:
        extra["requestBody"] = {
            "required": operation.body_required,
            "content": {form.media_type: _body(form) for form in operation.body_forms},
        }
    return extra


def _description(operation: Operation) -> str:
    text = (operation.handler.__doc__ or "").strip()
    if operation.access in {PUBLIC, ANY_KEY}:
        return text
    return f"{text}\n\nScope: `{operation.access}`."


def _query_parameters(operation: Operation) -> list[dict[str, Any]]:
    schema = operation.query.model_json_schema()
    required = schema.get("required", ())
    return [
        _query_parameter(name, dict(described), required=name in required)
        for name, described in schema.get("properties", {}).items()
    ]


def _query_parameter(name: str, schema: dict[str, Any], *, required: bool) -> dict[str, Any]:
    schema.pop("title", None)
    description = schema.pop("description", "")
    alternatives = [kind for kind in schema.pop("anyOf", ()) if kind != {"type": "null"}]
    if alternatives:  # a parameter that may be left out is never the word null
        schema = {**alternatives[0], **{key: value for key, value in schema.items() if value is not None}}
    if schema.get("default", ...) is None:
        del schema["default"]
    return {"name": name, "in": "query", "required": required, "description": description, "schema": schema}


def _header_parameters(operation: Operation) -> list[dict[str, Any]]:
    return [
        {"name": name, "in": "header", "required": False, "description": description, "schema": _HEADER_SCHEMAS[name]}
        for name, description in operation.request_headers.items()
    ]


def _body(form: BodyForm) -> dict[str, Any]:
    """What FastAPI does not say of a body by itself."""
    # A file is described by its media type alone: OpenAPI 3.1 leaves the schema of raw bytes out, so any bytes fit.
    return {} if form.example is None else {"example": form.example}


def _responses(operation: Operation) -> dict[int | str, dict[str, Any]]:
    return {status: _success(answer) for status, answer in operation.answers.items()} | _problems(operation)


def _success(answer: Answer) -> dict[str, Any]:
    described: dict[str, Any] = {"description": answer.description}
    if answer.model is not None:
        described["model"] = answer.model
    if answer.headers:
        described["headers"] = {
            name: {"description": text, "required": True, "schema": {"type": "string"}}
            for name, text in answer.headers.items()
        }
    if CSV in answer.media_types:
        text = "Of a table with `limit`: the cursor of the next page, if there is one."
        described.setdefault("headers", {})[NEXT_CURSOR] = {"description": text, "schema": {"type": "string"}}
    if answer.media_types:
        described["content"] = {
            media_type: {"schema": {"type": "object"} if media_type == JSON else {"type": "string"}}
            for media_type in answer.media_types
            if media_type != JSON or answer.model is None
        }
    return described


def _slugs(operation: Operation) -> list[str]:
    slugs = [*_ALWAYS, *operation.problems]
    if operation.access != PUBLIC:
        slugs += _WITH_KEY
    if operation.body_forms:
        slugs += _WITH_BODY
    return list(dict.fromkeys(slugs))


def _problems(operation: Operation) -> dict[int | str, dict[str, Any]]:
    by_status: dict[int, list[str]] = {}
    for slug in _slugs(operation):
        by_status.setdefault(PROBLEMS[slug].status, []).append(slug)
    return {status: _problem(status, slugs) for status, slugs in sorted(by_status.items())}


def _problem(status: int, slugs: Sequence[str]) -> dict[str, Any]:
    described: dict[str, Any] = {
        "description": "; ".join(f"`{slug}`: {PROBLEMS[slug].title}" for slug in slugs) + ".",
        "content": {PROBLEM_JSON: {"schema": {"$ref": _REF.format(model="ProblemDocument")}}},
    }
    if header := _PROBLEM_HEADERS.get(status):
        described["headers"] = {header: {"required": True, "schema": {"type": "string"}}}
    return described
