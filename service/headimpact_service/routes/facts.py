"""What a score depends on beside the record, remembered for a moment: a busy device sends many impacts a second."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from headimpact_service import deps
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.intake.facts import Found, find
from headimpact_service.operation import Call

Key = tuple[bytes, str | None, str | None, str | None]

REMEMBER_S = 5.0
REMEMBERED = 10_000


@dataclass(slots=True)
class Facts:
    """Looks devices and athletes up and remembers them; who is not known yet is looked up again.

    A mounting is never taken from memory: it moves the score, so it must be the one that is stored now. For the rest
    the store holds their revisions against its own before it keeps a score.
    """

    remembered: dict[Key, tuple[float, Found]] = field(default_factory=dict)

    async def of(self, call: Call, record: ImpactRecord) -> Found:
        """What is stored of the record's device and athlete."""
        key = _key(call, record)
        until, found = self.remembered.get(key, (0.0, None))
        if found is None or record.needs_device_mounting or time.monotonic() > until:
            found = await deps.read(call.request, lambda conn: find(conn, *key))
            self._remember(key, found)
        return found

    def forget(self) -> None:
        """Look everything up again: a device or an athlete changed."""
        self.remembered.clear()

    def forget_those_of(self, call: Call, record: ImpactRecord) -> None:
        """Look the record's device and athlete up again."""
        self.remembered.pop(_key(call, record), None)

    def _remember(self, key: Key, found: Found) -> None:
        device, athlete = found
        _, serial, *names = key
        if (serial is not None and device.revision is None) or (any(names) and athlete is None):
            return
        if len(self.remembered) >= REMEMBERED:
            self.remembered.clear()
        self.remembered[key] = (time.monotonic() + REMEMBER_S, found)


def _key(call: Call, record: ImpactRecord) -> Key:
    return call.data_set_id, record.device_serial, record.athlete_id, record.athlete_external_id
