"""Failed validation as payload errors: where, which rule with its bound, and never the offending value."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator, Sequence
from itertools import islice
from math import isfinite
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails, from_json

from headimpact_service.broken_rules import RULES, broken_rule
from headimpact_service.errors import MAX_ERRORS, PayloadError, Problem
from headimpact_service.ingest.json_members import repeated_members

Body = TypeVar("Body", bound=BaseModel)

MAX_MEMBERS = 5000
"""Of one body: an impact has about sixty. Every unknown one costs a kilobyte of error."""

MAX_VALUES = 400_000
"""Of one body: the longest record has 240 000 samples and times."""

_FEW_BYTES = 3 * MAX_MEMBERS
"""A shorter text cannot hold so many: `[],` is the shortest that becomes an object."""

MAX_POINTER = 200
"""Characters of a pointer that is given back: keys in it come from the caller."""

_SAMPLES = frozenset({"x", "y", "z", "time_ms"})
_OF_SAMPLES = frozenset({"float_type", "finite_number"})


def parse(data: bytes, model: type[Body], *, what: str = "body") -> Body:
    """`data` as `model`: 400 unless it is JSON, 422 with every broken rule (up to 20) unless it fits."""
    require_bounded(data, what)
    return validated(data, model, what=what)


def validated(data: bytes, model: type[Body], *, what: str) -> Body:
    """The same of a text that is known to be bounded."""
    try:
        body = model.model_validate_json(data)
    except ValidationError as error:
        raise validation_problem(error, data, what=what) from None
    if twice := member_errors(data, body):
        raise rules_problem(twice, what=what)
    return body


def member_errors(data: bytes, made: object) -> list[PayloadError]:
    """The first 20 members of a JSON text that stand in their object before, of which only the last was taken."""
    steps = islice(repeated_members(data, made), MAX_ERRORS)
    return [PayloadError("This member stands twice in its object.", "member-twice", pointer(place)) for place in steps]


def require_bounded(data: bytes, what: str) -> None:
    """Refuse a text of which parsing would make more objects than any request needs; none is made to see it.

    Every member has its colon, every list and object its bracket, every further value its comma.
    """
    if len(data) <= _FEW_BYTES:
        return
    if data.count(b":") > MAX_MEMBERS or data.count(b"[") + data.count(b"{") > MAX_MEMBERS:
        raise too_many_members(what)
    if data.count(b",") > MAX_VALUES:
        raise Problem("malformed-request", f"The {what} has more than {MAX_VALUES} values, which no request needs.")


def validation_problem(error: ValidationError, data: bytes, *, what: str = "body") -> Problem:
    """The problem that a failed validation of the JSON text `data` is."""
    faults = error.errors(include_url=False, include_input=False)
    if faults[0]["type"] == "json_invalid":
        if not data.strip():
            return Problem("malformed-request", f"The {what} is empty.")
        if data.startswith(_MARKS):
            return Problem(
                "malformed-request", f"The {what} begins with a byte order mark: JSON is UTF-8, and has none."
            )
        return Problem("malformed-request", f"The {what} is not JSON: {_reason(faults[0])}.")
    return rules_problem(payload_errors(faults, from_json(data)), what=what, count=len(faults))


def too_many_members(what: str) -> Problem:
    """The 400 for so many members, or ones so deeply nested, that naming what is wrong would be the attack."""
    detail = f"The {what} has more than {MAX_MEMBERS} members, lists or objects, which no request needs."
    return Problem("malformed-request", detail)


def rules_problem(errors: Sequence[PayloadError], *, what: str = "body", count: int = 0) -> Problem:
    """The 422 for rules that a readable body breaks."""
    number = max(count, len(errors))
    least = "at least " if len(errors) == MAX_ERRORS else ""  # of a list of samples only so many are counted
    broken = "a rule" if number == 1 else f"{least}{number} rules"
    return Problem("invalid-payload", f"The {what} breaks {broken}.", errors=errors)


def payload_errors(faults: Sequence[ErrorDetails], document: Any) -> list[PayloadError]:  # noqa: ANN401 - any JSON
    """The first 20 faults, each at the pointer where `document` has it."""
    errors: list[PayloadError] = []
    for fault in faults:
        if len(errors) >= MAX_ERRORS:
            break
        errors.append(_payload_error(fault, document))
        if fault["type"] in _OF_SAMPLES:
            errors += islice(_later_samples(_steps(fault, document), document), MAX_ERRORS - len(errors))
    return errors


def pointer(steps: Sequence[object]) -> str:
    """A JSON pointer (RFC 6901) of bounded length."""
    escaped = (str(step).replace("~", "~0").replace("/", "~1") for step in steps)
    return "".join(f"/{step}" for step in escaped)[:MAX_POINTER]


def _payload_error(fault: ErrorDetails, document: Any) -> PayloadError:  # noqa: ANN401 - any JSON
    steps = _steps(fault, document)
    code, detail = broken_rule(fault)
    if code in {"too-short", "too-long"} and steps and steps[-1] in _SAMPLES:
        detail = detail.replace("entries", "samples")
    return PayloadError(detail=detail, code=code, pointer=pointer(steps))


def _later_samples(steps: list[object], document: Any) -> Iterator[PayloadError]:  # noqa: ANN401 - any JSON
    """The other bad samples of a list, of which validation tells the first only."""
    if len(steps) < 2 or steps[-2] not in _SAMPLES or not isinstance(steps[-1], int):
        return
    samples = document
    for step in steps[:-1]:
        samples = samples[step]
    for index in range(steps[-1] + 1, len(samples)):
        kind = _fault_of_sample(samples[index])
        if kind is not None:
            code, sentence = RULES[kind]
            yield PayloadError(detail=sentence, code=code, pointer=pointer([*steps[:-1], index]))


def _fault_of_sample(value: object) -> str | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "float_type"
    try:
        return None if isfinite(value) else "finite_number"
    except OverflowError:
        return "finite_number"


def _steps(fault: ErrorDetails, document: Any) -> list[object]:  # noqa: ANN401 - any JSON
    """The fault's place in the document: pydantic's location also names the branch of a union, which is no place."""
    steps: list[object] = []
    node, last = document, len(fault["loc"]) - 1
    for index, step in enumerate(fault["loc"]):
        if _holds(node, step):
            node = node[step]
        elif not (fault["type"] == "missing" and index == last):
            continue
        steps.append(step)
    return steps


def _holds(node: Any, step: object) -> bool:  # noqa: ANN401 - any JSON
    if isinstance(node, dict):
        return step in node
    return isinstance(node, list) and isinstance(step, int) and step < len(node)


_MARKS = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_REASONS = (
    ("recursion limit", "it is nested too deeply"),
    ("EOF", "it ends before it is complete"),
    ("trailing characters", "something stands behind its end"),
    ("trailing comma", "a comma stands before a closing bracket"),
    ("key must be a string", "a member's name is no text in double quotes"),
    ("control character", "a text holds a control character that is not escaped"),
    ("surrogate", "a text holds half a surrogate pair"),
    ("end of hex escape", "a text holds half a surrogate pair"),
    ("escape", "a text holds an escape that JSON does not have"),
    ("unicode", "a text is not UTF-8"),
    ("number", "a number is not written as JSON has it"),
    ("expected `,`", "a comma or a closing bracket is missing"),
    ("expected `:`", "a colon is missing"),
    ("expected", "there is no value where one is expected"),
)
"""What the parser's messages hold, and what is said for it."""
_PLACE = re.compile(r"at line (\d+) column (\d+)", re.ASCII)


def _reason(fault: ErrorDetails) -> str:
    """What is wrong with the text, and where."""
    told = str(fault.get("ctx", {}).get("error", ""))
    reason = next((words for part, words in _REASONS if part in told), "it is not well formed")
    place = _PLACE.search(told)
    return reason if place is None else f"{reason} (line {place[1]}, column {place[2]})"
