"""What a table says of an impact beside its samples: names, when it was, its context, how it is to be read."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from datetime import datetime
from functools import lru_cache
from typing import Annotated, Any, get_args

from pydantic import BeforeValidator, Field, ValidationError
from pydantic_core import from_json

from headimpact_service.errors import Problem
from headimpact_service.ingest.cells import is_written_number
from headimpact_service.ingest.date_order import DateOrder, year_first
from headimpact_service.ingest.decimal_commas import has_decimal_comma
from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.impact_json import (
    MAX_NAME,
    MAX_RATE_HZ,
    MIN_RATE_HZ,
    PRINTABLE,
    Axes,
    Context,
    Filter,
    Location,
    MountingBody,
    Plane,
    Strict,
)
from headimpact_service.ingest.json_faults import member_errors, payload_errors
from headimpact_service.ingest.mapping import read_from_none
from headimpact_service.ingest.times import TimeError, instant

_PRINTABLE = re.compile(PRINTABLE)
_RATE = re.compile(r"(?P<number>\S+?)\s*(?:(?P<kilo>k?)(?:hz|sps))?", re.IGNORECASE)
_BESIDE = frozenset({"axes", "filter", "sample_rate_hz"})
"""Fields of how to read an impact that may stand beside the file."""
Texts = tuple[tuple[str, str], ...]
"""Fields and their cells, those that are empty left out."""


def _json(value: Any) -> Any:  # noqa: ANN401 - validated after
    """An object in a cell is JSON; what only looks like one is refused as text."""
    if not isinstance(value, str) or not value.startswith("{"):
        return value
    try:
        made = from_json(value)
    except ValueError:
        return value
    return value if member_errors(value.encode(), made) else made


def _location(value: Any) -> Any:  # noqa: ANN401 - validated after
    """Where the signals were measured; a team's column of this name says where it played."""
    place = "_".join(value.lower().split()) if isinstance(value, str) else value
    return place if place in get_args(Location) else None


def _point(value: Any) -> Any:  # noqa: ANN401 - validated after
    """A number with a decimal comma, with a point."""
    return value.replace(",", ".") if isinstance(value, str) and has_decimal_comma(value) else value


def _rate(value: Any) -> Any:  # noqa: ANN401 - validated after
    """A number of samples per second, with its unit or without, in hertz."""
    said = _RATE.fullmatch(value.strip()) if isinstance(value, str) else None
    if said is None:
        return value
    number = _point(said["number"])
    if "," in number or not is_written_number(number):
        return value
    return float(number) * (1000.0 if said["kilo"] else 1.0)


def says_rate(text: str) -> bool:
    """Whether a cell says a sample rate."""
    return isinstance(_rate(text), float)


class Reading(Strict):
    """How an impact's samples are to be read, as its row says; each field as in the JSON of an impact."""

    axes: Axes | None = None
    filter: Annotated[Filter, BeforeValidator(_json)] | None = None
    constrained_plane: Plane | None = None
    pre_trigger_ms: Annotated[float | None, BeforeValidator(_point)] = Field(None, ge=0.0, le=60_000.0)
    location: Annotated[Location | None, BeforeValidator(_location)] = None
    mounting: Annotated[MountingBody, BeforeValidator(_json)] | None = None
    sample_rate_hz: Annotated[float | None, BeforeValidator(_rate)] = Field(None, ge=MIN_RATE_HZ, le=MAX_RATE_HZ)
    fill_gaps: bool = False


NOTHING_SAID = Reading.model_validate({})


@lru_cache(maxsize=1024)
def reading_of(texts: Texts) -> Reading:
    """The cells as they are meant; 422 for one that breaks the rule of its field."""
    try:
        return Reading.model_validate(dict(texts), strict=False)
    except ValidationError as error:
        raise _cell_problem(error, "reading") from None


@lru_cache(maxsize=1024)
def context_of(texts: Texts) -> dict[str, Any]:
    """The context that the cells make."""
    try:
        return Context.model_validate(dict(texts), strict=False).model_dump(exclude_none=True)
    except ValidationError as error:
        raise _cell_problem(error, "context") from None


def _cell_problem(error: ValidationError, table: str) -> Problem:
    """What is wrong with a cell of a mapping's table of fields, and how to leave its column alone."""
    faults = error.errors(include_url=False, include_input=False)
    fault, field = payload_errors(faults[:1], None)[0], str(faults[0]["loc"][0])
    stands = field == "sample_rate_hz" and fault.code == "out-of-range"  # a rate that one beside it would contradict
    beside = f"give {field} beside the file, or " if field in _BESIDE and not stands else ""
    return file_fault(
        f"The column of {field}: {fault.detail} If it says something else, {beside}read no {field} from it "
        f"({json.dumps(read_from_none(table, field))} in a mapping).",
        fault.code,
        parameter=field,
    )


def checked_name(text: str | None, field: str) -> str | None:
    """A name as the sender gives it, unless it breaks the rules of names."""
    if text is not None and (len(text) > MAX_NAME or _PRINTABLE.match(text) is None):
        raise file_fault(f"A name has 1 to {MAX_NAME} printable characters.", "name-form", parameter=field)
    return text


def moment(parts: Mapping[str, str | None], time_zone: str | None, order: DateOrder | None) -> datetime | None:
    """The instant of one cell, or of a date's and a time's, by the headings of their columns."""
    date, *time = parts.values()
    if not (date or any(time)):
        return None
    try:
        return instant("T".join(map(str, (year_first(date or "", order), *time))), time_zone)
    except TimeError as error:
        raise _time_problem(error, list(parts)) from None


def _time_problem(error: TimeError, headings: list[str]) -> Problem:
    """What is wrong with a time, and where it can be mended: beside the file, or in the mapping that says its order."""
    if error.code not in {"date-order", "date-order-missing"}:
        detail = f"{error} If the file's own time is broken, give occurred_at beside the file."
        return file_fault(detail, error.code, parameter=error.field)
    named = dict(zip(("date", "time"), headings, strict=False))
    shown = json.dumps({"occurred_at": named | {"order": "dmy"}}, ensure_ascii=False)
    detail = f"{error} Say the order in a mapping: {shown}, or mdy or ymd; or give occurred_at beside the file."
    return file_fault(detail, error.code, parameter="mapping", pointer="/occurred_at/order")
