"""The OpenAPI document, made from the operations: what they declare is what they hold."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import JsonSchemaMode, models_json_schema

from headimpact_service import __version__
from headimpact_service.answers import JSON, PROBLEM_JSON
from headimpact_service.errors import PROBLEMS
from headimpact_service.operation import ANY_KEY, PUBLIC, Answer, BodyForm, Operation
from headimpact_service.problem_shapes import ProblemDocument

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
    "If-Match": {"type": "string", "pattern": r'^("[1-9][0-9]{0,8}"|\*)$'},
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
with 405 and all that it takes in `Allow`. Request bodies may be gzip (`Content-Encoding: gzip`).
"""


def document(operations: Sequence[Operation]) -> dict[str, Any]:
    """The whole document."""
    operations = [operation for operation in operations if operation.documented]
    references, schemas = _schemas(operations)
    paths: dict[str, dict[str, Any]] = {}
    for operation in operations:
        path = paths.setdefault(operation.path.replace(":path}", "}"), {})
        path[operation.method.lower()] = _operation(operation, references)
    return {
        "openapi": "3.1.0",
        "info": {
            "title": "Headimpact",
            "version": __version__,
            "description": _ABOUT,
            "license": {"name": "Apache-2.0", "identifier": "Apache-2.0"},
        },
        "servers": [{"url": "/"}],
        "tags": [{"name": tag} for tag in dict.fromkeys(operation.tag for operation in operations)],
        "paths": paths,
        "components": {
            "schemas": schemas,
            "securitySchemes": {"key": {"type": "http", "scheme": "bearer", "description": "A key of this service."}},
        },
    }


def as_text(specification: Mapping[str, Any]) -> str:
    """The document as the committed file holds it."""
    return json.dumps(specification, indent=2, ensure_ascii=False) + "\n"


Shape = tuple[type[BaseModel], JsonSchemaMode]
References = Mapping[Any, dict[str, Any]]
"""By shape."""


def _schemas(operations: Iterable[Operation]) -> tuple[References, dict[str, Any]]:
    shapes: dict[Shape, None] = {(ProblemDocument, "validation"): None}
    for operation in operations:
        shapes.update({(form.model, "validation"): None for form in operation.body_forms if form.model})
        shapes.update({(answer.model, "serialization"): None for answer in operation.answers.values() if answer.model})
    references, definitions = models_json_schema(list(shapes), ref_template=_REF)
    return references, dict(sorted(definitions["$defs"].items()))


def _operation(operation: Operation, references: References) -> dict[str, Any]:
    described: dict[str, Any] = {
        "operationId": operation.handler.__name__,
        "tags": [operation.tag],
        "summary": operation.summary,
        "description": _description(operation),
        "parameters": [*_path_parameters(operation), *_query_parameters(operation), *_header_parameters(operation)],
        "responses": _responses(operation, references),
        "security": [] if operation.access == PUBLIC else [{"key": []}],
    }
    if operation.body_forms:
        described["requestBody"] = {
            "required": operation.body_required,
            "content": {form.media_type: _body(form, references) for form in operation.body_forms},
        }
    return described


def _description(operation: Operation) -> str:
    text = (operation.handler.__doc__ or "").strip()
    if operation.access in {PUBLIC, ANY_KEY}:
        return text
    return f"{text}\n\nScope: `{operation.access}`."


def _path_parameters(operation: Operation) -> list[dict[str, Any]]:
    return [
        {"name": name, "in": "path", "required": True, "schema": {"type": "string", "minLength": 1}}
        for name in _NAME_IN_PATH.findall(operation.path)
    ]


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


def _body(form: BodyForm, references: References) -> dict[str, Any]:
    if form.model is None:
        schema: dict[str, Any] = {"type": "string"}
        if form.media_type != "text/csv":
            schema["format"] = "binary"
        return {"schema": schema}
    described = {"schema": references[form.model, "validation"]}
    return described if form.example is None else {**described, "example": form.example}


def _responses(operation: Operation, references: References) -> dict[str, Any]:
    successes = {str(status): _success(answer, references) for status, answer in operation.answers.items()}
    return successes | _problems(operation)


def _success(answer: Answer, references: References) -> dict[str, Any]:
    described: dict[str, Any] = {"description": answer.description}
    if answer.headers:
        described["headers"] = {
            name: {"description": text, "required": True, "schema": {"type": "string"}}
            for name, text in answer.headers.items()
        }
    content: dict[str, Any] = {}
    for media_type in answer.media_types:
        content[media_type] = {"schema": _answer_schema(answer, media_type, references)}
    if content:
        described["content"] = content
    return described


def _answer_schema(answer: Answer, media_type: str, references: References) -> dict[str, Any]:
    if media_type != JSON:
        return {"type": "string"}
    return {"type": "object"} if answer.model is None else references[answer.model, "serialization"]


def _slugs(operation: Operation) -> list[str]:
    slugs = [*_ALWAYS, *operation.problems]
    if operation.access != PUBLIC:
        slugs += _WITH_KEY
    if operation.body_forms:
        slugs += _WITH_BODY
    return list(dict.fromkeys(slugs))


def _problems(operation: Operation) -> dict[str, Any]:
    by_status: dict[int, list[str]] = {}
    for slug in _slugs(operation):
        by_status.setdefault(PROBLEMS[slug].status, []).append(slug)
    return {str(status): _problem(status, slugs) for status, slugs in sorted(by_status.items())}


def _problem(status: int, slugs: Sequence[str]) -> dict[str, Any]:
    described: dict[str, Any] = {
        "description": "; ".join(f"`{slug}`: {PROBLEMS[slug].title}" for slug in slugs) + ".",
        "content": {PROBLEM_JSON: {"schema": {"$ref": _REF.format(model="ProblemDocument")}}},
    }
    if header := _PROBLEM_HEADERS.get(status):
        described["headers"] = {header: {"required": True, "schema": {"type": "string"}}}
    return described
