"""Operating points in a body: the rule between their fields, and what the science takes."""

from __future__ import annotations

from collections.abc import Sequence

from headimpact.risk import OperatingPointRequest
from headimpact_service.errors import PayloadError
from headimpact_service.ingest.impact_json import OperatingPointBody
from headimpact_service.ingest.json_faults import rules_problem

ASKED = ("sensitivity", "specificity", "threshold")


def requests_of(points: Sequence[OperatingPointBody]) -> tuple[OperatingPointRequest, ...]:
    """The points as requests; 422 unless each says exactly one of sensitivity, specificity and threshold."""
    wrong = [
        PayloadError(
            detail="Exactly one of sensitivity, specificity and threshold is needed.",
            code="one-of",
            pointer=f"/operating_points/{index}",
        )
        for index, point in enumerate(points)
        if sum(getattr(point, name) is not None for name in ASKED) != 1
    ]
    if wrong:
        raise rules_problem(wrong)
    return tuple(OperatingPointRequest(**point.model_dump()) for point in points)
