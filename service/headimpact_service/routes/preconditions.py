"""If-Match and ETag: a change names the revision it was made against."""

from __future__ import annotations

import re

from starlette.requests import Request

from headimpact_service.errors import Problem, invalid_parameter
from headimpact_service.store.revision import ANY

IF_MATCH = {"If-Match": 'The ETag of the revision that is changed, `"1"`; `*` for whichever it is, if there is one.'}
_REVISION = re.compile(r'"(0|[1-9]\d{0,8})"', re.ASCII)
_ETAG = re.compile(r'(W/)?"[^"]*"')


def etag(revision: int) -> dict[str, str]:
    """The header that names a revision."""
    return {"ETag": f'"{revision}"'}


def if_match(request: Request, *, required: bool = False) -> int | None:
    """The revision that If-Match names, `ANY` of those there are, or None where it is absent.

    428 if it is required and absent, 412 if it cannot match.
    """
    text = request.headers.get("if-match")
    if text is None:
        if required:
            raise Problem("precondition-required", "This change needs If-Match with the ETag of the present revision.")
        return None
    text = text.strip()
    if text == "*":
        return ANY
    revision = _REVISION.fullmatch(text)
    if revision:
        return int(revision[1])
    if _ETAG.fullmatch(text):  # a tag, but none that we ever gave
        raise Problem("precondition-failed", "The resource has changed since the revision that If-Match names.")
    raise invalid_parameter("If-Match", "Must be one ETag as it was given, or *.", "etag")
