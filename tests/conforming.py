"""Every answer that a test gets is held against the OpenAPI document: its status, its type, its shape, its headers."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import httpx
from jsonschema import Draft202012Validator
from referencing import Registry, Resource
from referencing.jsonschema import DRAFT202012

from headimpact_service import openapi
from headimpact_service.app import OPERATIONS

ROOT = "urn:headimpact:openapi"


@cache
def document() -> dict[str, Any]:
    """The OpenAPI document, made once."""
    return openapi.document(OPERATIONS)


@cache
def _registry() -> Registry[Any]:
    return Registry().with_resource(ROOT, Resource.from_contents(document(), default_specification=DRAFT202012))


@cache
def _paths() -> list[tuple[re.Pattern[str], str]]:
    """Paths as patterns; the more specific first."""
    paths = sorted(document()["paths"], key=lambda path: (path.count("{"), -len(path)))
    return [(re.compile(_pattern(path)), path) for path in paths]


def _pattern(path: str) -> str:
    """A serial may hold slashes, an identifier may not."""
    return re.sub(r"{\w+}", "[^/]+", path.replace("{serial}", ".+"))


@cache
def _validator(pointer: str) -> Draft202012Validator:
    return Draft202012Validator({"$ref": f"{ROOT}#{pointer}"}, registry=_registry())


def assert_conforms(method: str, path: str, answer: httpx.Response) -> None:
    """The answer is one that the document describes."""
    template = next((name for pattern, name in _paths() if pattern.fullmatch(path)), None)
    operation = None if template is None else document()["paths"][template].get(method.lower())
    if operation is None:  # an unknown path, or a method that is not taken
        assert answer.status_code in {307, 404, 405} or path.startswith("/assets/")
        return
    described = operation["responses"].get(str(answer.status_code))
    assert described is not None, f"{method} {template} answered {answer.status_code}, which is not documented"
    for name, header in described.get("headers", {}).items():
        present = name in answer.headers or not header.get("required", False)
        assert present, f"{method} {template} {answer.status_code} without {name}"
    content = described.get("content")
    if content is None:
        assert not answer.content
        return
    media_type = answer.headers["content-type"].partition(";")[0]
    assert media_type in content, f"{method} {template} answered {media_type}, which is not documented"
    if media_type in {"application/json", "application/problem+json"}:
        steps = (
            "paths",
            template,
            method.lower(),
            "responses",
            str(answer.status_code),
            "content",
            media_type,
            "schema",
        )
        _validator("".join("/" + step.replace("~", "~0").replace("/", "~1") for step in steps)).validate(answer.json())
