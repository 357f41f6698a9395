"""Columns of each axis' peak (PLA x) whose headings could be those of the samples of an axis.

Beside three columns that are clear without them they are passed over, as long as they say one value an impact.
"""

from __future__ import annotations

from collections.abc import Collection

from headimpact.quality import words
from headimpact.recording import AXES, SIGNALS, SignalName
from headimpact_service.errors import Problem
from headimpact_service.ingest.headings import Headings, Vocabulary, layout_problem
from headimpact_service.ingest.spelling import compact, vocabulary


def axis_peaks(spoken: Vocabulary, headings: Headings) -> dict[int, SignalName]:
    """The columns that are called peaks of a signal whose three axes other headings name, each with the signal."""
    found: dict[int, SignalName] = {}
    meanings = spoken.meanings(headings)
    for signal in SIGNALS:
        axes = {place: meaning.axis for place, meaning in enumerate(meanings) if meaning and meaning.signal == signal}
        peaks = [column for column in axes if _is_peak(signal, headings.written[column])]
        if {axes[column] for column in axes.keys() - set(peaks)} == set(AXES):
            found |= dict.fromkeys(peaks, signal)
    return found


def _is_peak(signal: SignalName, heading: str) -> bool:
    return any(word in compact(heading) for word in vocabulary()[signal]["peaks"])


def without(headings: Headings, columns: Collection[int]) -> Headings:
    """The headings of a table but for those of some columns."""
    if not columns:
        return headings
    written = ["" if column in columns else heading for column, heading in enumerate(headings.written)]
    units = {column: unit for column, unit in headings.units.items() if column not in columns}
    return Headings(written, units, headings.dated, headings.lone)


def unclear_axis(column: str, signal: SignalName) -> Problem:
    """The 422 for a column, as a message names it, that is called a peak and changes from sample to sample."""
    return layout_problem(
        f"{column} changes from sample to sample, as a component of the {words(signal)} does, of which others are "
        "there: say in a mapping which to take.",
        code="heading-twice",
        pointer=f"/{signal}",
    )
