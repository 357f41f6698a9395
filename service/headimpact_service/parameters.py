"""Query parameters: read strictly, because a filter that is misread answers another question in silence."""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import datetime
from functools import cache
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, WithJsonSchema
from pydantic_core import ErrorDetails
from starlette.requests import Request

from headimpact_service.broken_rules import broken_rule
from headimpact_service.errors import MAX_ERRORS, PayloadError, Problem

MAX_NAME = 100
"""An unknown parameter's name is the caller's text: it is shown, but not at any length."""

_WHOLE = re.compile(r"-?\d{1,18}", re.ASCII)
_DECIMAL = re.compile(r"-?\d{1,18}(\.\d{1,30})?([eE][-+]?\d{1,3})?", re.ASCII)
_INSTANT = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?(Z|[+-]\d\d:\d\d)", re.ASCII)


def _whole(text: object) -> object:
    if isinstance(text, str) and not _WHOLE.fullmatch(text):
        raise ValueError("must be a whole number in decimal digits")
    return text


def _instant(text: object) -> object:
    if isinstance(text, str) and not _INSTANT.fullmatch(text.upper()):
        raise ValueError("must be an RFC 3339 time with an offset, such as 2026-11-20T19:04:05Z")
    return text


def _flag(text: object) -> object:
    if isinstance(text, str) and text not in {"true", "false"}:
        raise ValueError("must be true or false")
    return text


def _decimal(text: object) -> object:
    if isinstance(text, str) and not _DECIMAL.fullmatch(text):
        raise ValueError("must be a decimal number")
    return text


# Bounds stand before the reading of the text: behind it, they would not show in the documentation.
PageSize = Annotated[int, Field(ge=1, le=1000), BeforeValidator(_whole)]
Probability = Annotated[float, Field(ge=0, le=1), BeforeValidator(_decimal)]
Instant = Annotated[datetime, BeforeValidator(_instant), WithJsonSchema({"type": "string", "format": "date-time"})]
Flag = Annotated[bool, BeforeValidator(_flag)]


class Query(BaseModel):
    """The parameters of one operation; one that is not declared is refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)


class NoQuery(Query):
    """An operation without parameters."""


Q = TypeVar("Q", bound=Query)

_OF_PARAMETERS = {
    "missing": ("missing", "This parameter is required."),
    "extra_forbidden": ("unknown-parameter", "This operation has no such parameter."),
}


class ListQuery(Query):
    """What every list takes."""

    limit: Annotated[
        PageSize, Field(description="Rows on a page. A table (CSV, NDJSON, Parquet) without it runs to the end.")
    ] = 100
    cursor: Annotated[
        str | None, Field(description="`next_cursor` of the page before, or a table's `X-Next-Cursor`, unchanged.")
    ] = None


class SyncQuery(ListQuery):
    """What a list takes whose deletions stay visible."""

    updated_since: Annotated[
        Instant | None,
        Field(
            description="Only what changed at or after this time, oldest change first; deletions appear as tombstones."
        ),
    ] = None


def parse_query(request: Request, model: type[Q]) -> Q:
    """The request's query parameters as `model`; 422 for those that are unknown, repeated or wrong."""
    if not request.scope["query_string"]:
        defaults: Q = _no_parameters(model)
        return defaults
    return validate_parameters(request.query_params.multi_items(), model)


@cache
def _no_parameters(model: type[Q]) -> Q:
    """What a request without parameters asks: the defaults, or 422 where there are none."""
    return validate_parameters((), model)


def validate_parameters(pairs: Iterable[tuple[str, Any]], model: type[Q]) -> Q:
    """Names and values as `model`; 422 for those that are unknown, repeated or wrong."""
    values: dict[str, Any] = {}
    repeated: list[PayloadError] = []
    for name, value in pairs:
        if name in values:
            repeated.append(_error(name, "May be given once.", "repeated"))
        values[name] = value
    if repeated:
        raise _problem(repeated)
    try:
        return model.model_validate(values)
    except ValidationError as error:
        faults = error.errors(include_url=False, include_input=False)
        raise _problem([_error(str(fault["loc"][0]), *_wording(fault)) for fault in faults]) from None


def _wording(fault: ErrorDetails) -> tuple[str, str]:
    own = _OF_PARAMETERS.get(fault["type"])
    code, detail = broken_rule(fault) if own is None else own
    return detail[0].upper() + detail[1:].rstrip(".") + ".", code


def _error(name: str, detail: str, code: str) -> PayloadError:
    return PayloadError(detail=detail, code=code, parameter=name[:MAX_NAME])


def _problem(errors: list[PayloadError]) -> Problem:
    first = errors[0]
    return Problem("invalid-parameter", f"{first.parameter}: {first.detail}", errors=errors[:MAX_ERRORS])
