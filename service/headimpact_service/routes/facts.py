"""What a score depends on beside the record, remembered for a moment: a busy device sends many impacts a second."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

from headimpact_service import deps
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.intake.facts import Found, find, with_population_note
from headimpact_service.intake.scoring import DeviceFacts
from headimpact_service.operation import Call

REMEMBER_S = 5.0
REMEMBERED = 10_000


@dataclass(slots=True)
class Facts:
    """Looks devices and athletes up and remembers them.

    A mounting is never taken from memory: it moves the score, so it must be the one that is stored now.
    """

    remembered: dict[tuple[Any, ...], tuple[float, Found]] = field(default_factory=dict)

    async def of(self, call: Call, record: ImpactRecord) -> tuple[DeviceFacts, ImpactRecord]:
        """The device's facts, and the record with what its athlete adds."""
        key = (call.data_set_id, record.device_serial, record.athlete_id, record.athlete_external_id)
        until, found = self.remembered.get(key, (0.0, None))
        if found is None or record.needs_device_mounting or time.monotonic() > until:
            found = await deps.read(call.request, lambda conn: find(conn, *key))
            self._remember(key, found)
        device, athlete = found
        return device, with_population_note(record, athlete)

    def forget(self) -> None:
        """Look everything up again: a device or an athlete changed."""
        self.remembered.clear()

    def _remember(self, key: tuple[Any, ...], found: Found) -> None:
        if len(self.remembered) >= REMEMBERED:
            self.remembered.clear()
        self.remembered[key] = (time.monotonic() + REMEMBER_S, found)
