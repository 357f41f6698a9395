"""What leaves the service: JSON from bytes, problem documents, and the choice among media types."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pydantic_core import to_json
from starlette.responses import Response

from headimpact_service.errors import Problem

JSON = "application/json"
CSV = "text/csv"
NEXT_CURSOR = "X-Next-Cursor"
"""The header of a table that is a page."""
NDJSON = "application/x-ndjson"
PARQUET = "application/vnd.apache.parquet"
HTML = "text/html"
SVG = "image/svg+xml"
PROBLEM_JSON = "application/problem+json"


def json_bytes(content: object) -> bytes:
    """`content` as JSON that never holds NaN or Infinity."""
    return to_json(content, inf_nan_mode="null")


def answer(content: object, status: int = 200, headers: Mapping[str, str] | None = None) -> Response:
    """A JSON answer; `content` may be bytes that are JSON already."""
    body = content if isinstance(content, bytes) else json_bytes(content)
    return Response(body, status_code=status, headers=headers, media_type=JSON)


def no_content() -> Response:
    """The 204 of a deletion."""
    return Response(status_code=204)


def problem_answer(problem: Problem) -> Response:
    """A problem document."""
    return Response(
        json_bytes(problem.as_dict()), status_code=problem.status, headers=problem.headers, media_type=PROBLEM_JSON
    )


def preferred(accept: str | None, offered: Sequence[str]) -> str:
    """The media type of `offered` that `Accept` ranks highest (the first wins a tie); 406 if it excludes all."""
    if accept is None or accept.strip() in {"", "*/*"}:
        return offered[0]
    ranges = _media_ranges(accept)
    best, best_quality = None, 0.0
    for media_type in offered:
        quality = _quality(media_type, ranges)
        if quality > best_quality:
            best, best_quality = media_type, quality
    if best is None:
        raise Problem("not-acceptable", f"This resource can be answered as {', '.join(offered)}.")
    return best


def _media_ranges(accept: str) -> dict[str, float]:
    ranges = {}
    for part in accept.lower().split(","):
        media_range, *parameters = (piece.strip() for piece in part.split(";"))
        quality = next((parameter[2:] for parameter in parameters if parameter.startswith("q=")), "1")
        ranges[media_range] = _bounded(quality)
    return ranges


def _bounded(quality: str) -> float:
    try:
        return min(max(float(quality), 0.0), 1.0)
    except ValueError:
        return 0.0


def _quality(media_type: str, ranges: Mapping[str, float]) -> float:
    family = media_type.partition("/")[0] + "/*"
    for media_range in (media_type, family, "*/*"):  # the more specific range decides (RFC 9110, 12.5.1)
        if media_range in ranges:
            return ranges[media_range]
    return 0.0
