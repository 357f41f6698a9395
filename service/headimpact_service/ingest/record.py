"""One impact as it was read, whatever it was read from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from headimpact.quality import QualityNote
from headimpact.recording import Recording, SignalName
from headimpact.risk import OperatingPointRequest
from headimpact_service.errors import Problem


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactRecord:
    """One impact, well formed but not yet prepared: the traces in their own units, rates and frame.

    Parameters
    ----------
    recording
        The signals, and how they are to be read.
    external_id
        The sender's name for the impact.
    athlete_id, athlete_external_id
        The athlete, by our id or by the sender's; at most one of them.
    occurred_at
        When, in UTC.
    device_serial
        Which device recorded it.
    context
        Session, activity, sport, position and the optional fields of CHAMP 2022.
    metadata
        Where the record came from: format, preset, what the file's laboratory says of it. Not part of its content.
    notes
        What the reading had to note about the record.
    unscorable
        Why the record must be stored without a score; empty for one that can be scored.
    left_out
        Components that were not sent, being outside the plane of the motion: their samples are zeros.
    needs_device_mounting
        The signals are those of the sensor and no mounting came with them: the device's must be looked up.
    operating_points
        The points asked for; None where the organisation's default applies.
    include, extra_criteria
        What else the answer should hold.
    """

    recording: Recording
    external_id: str | None = None
    athlete_id: str | None = None
    athlete_external_id: str | None = None
    occurred_at: datetime | None = None
    device_serial: str | None = None
    context: Mapping[str, Any] = field(default_factory=dict)
    metadata: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[QualityNote, ...] = ()
    unscorable: tuple[str, ...] = ()
    left_out: tuple[tuple[SignalName, str], ...] = ()
    needs_device_mounting: bool = False
    operating_points: tuple[OperatingPointRequest, ...] | None = None
    include: tuple[str, ...] = ()
    extra_criteria: tuple[str, ...] = ()

    @property
    def values(self) -> int:
        """The samples of all its channels."""
        return sum(signal.values.size for _, signal in self.recording.signals())


class RefusedImpact(Problem):
    """The problem of one impact of a file, with the sender's name for it where that could be read."""

    def __init__(self, problem: Problem, external_id: str | None) -> None:
        """The same problem as `problem`."""
        super().__init__(
            problem.slug, problem.detail, errors=problem.errors, headers=problem.headers, extra=problem.extra
        )
        self.external_id = external_id
