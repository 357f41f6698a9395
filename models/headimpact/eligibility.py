"""Which impacts may enter a cohort: an adjudicated outcome, an event that was one, consent, and each recording once.

An impact without an adjudicated outcome is not one without injury: it stays out.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Literal

from headimpact.errors import CalibrationError

Inclusion = Literal["unverified", "false_positive", "not_worn"]
INCLUSIONS: tuple[Inclusion, ...] = ("unverified", "false_positive", "not_worn")
"""What enters only where it is asked for."""

OUTCOMES = {"concussion": 1.0, "no_concussion": 0.0, "1": 1.0, "0": 0.0, "1.0": 1.0, "0.0": 0.0}
UNDECIDED = frozenset({"", "unknown"})
DUPLICATE = "duplicate_content"
"""Why an impact stays out whose recording entered as another impact of its athlete."""


def outcome_of(text: str) -> float | None:
    """1 or 0 for an adjudicated outcome, None for an undecided or absent one.

    Raises
    ------
    CalibrationError
        It is no outcome at all.
    """
    word = text.strip()
    if word in UNDECIDED:
        return None
    if word not in OUTCOMES:
        raise CalibrationError("outcome", "An outcome is 0, 1, concussion, no_concussion, unknown or empty.")
    return OUTCOMES[word]


def exclusion_reason(
    outcome: float | None,
    *,
    event: str = "",
    consent: str = "",
    worn: bool | None = None,
    include: frozenset[str] = frozenset(),
) -> str | None:
    """Why an impact stays out of a cohort; None where it enters.

    Parameters
    ----------
    outcome
        As :func:`outcome_of` gives it.
    event
        What the label says of the event itself: ``verified``, ``unverified``, ``false_positive`` or nothing.
    consent
        The athlete's: ``withdrawn`` keeps every impact out, whatever is asked for.
    worn
        Whether the device was on the head; None where that is not known.
    include
        Some of :data:`INCLUSIONS`.
    """
    if outcome is None:
        return "no_outcome"
    if consent == "withdrawn":
        return "consent_withdrawn"
    if event in {"unverified", "false_positive"} and event not in include:
        return event
    if worn is False and "not_worn" not in include:
        return "not_worn"
    return None


def first_of_each(recordings: Sequence[Hashable | None]) -> list[int]:
    """The position of the first impact with the same recording, which is an impact's own where there is no earlier.

    Parameters
    ----------
    recordings
        What is equal where two impacts are one recording of one athlete; None where that is not known.
    """
    first: dict[Hashable, int] = {}
    return [i if one is None else first.setdefault(one, i) for i, one in enumerate(recordings)]


def contradiction(firsts: Sequence[int], outcomes: Sequence[float], names: Sequence[str]) -> CalibrationError | None:
    """The fault of a cohort in which one recording has both outcomes: nobody could say which one holds.

    Parameters
    ----------
    firsts
        As :func:`first_of_each` gives them.
    outcomes, names
        Of the same impacts.
    """
    for i, first in enumerate(firsts):
        if outcomes[i] != outcomes[first]:
            return CalibrationError(
                "contradictory-outcomes",
                f"{names[first]} and {names[i]} are the same recording of one athlete with both outcomes. Take one "
                "label back, or delete one of them.",
            )
    return None
