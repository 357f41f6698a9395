"""What a score depends on beside the record: its device's mounting and ranges, its athlete's population."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Any

from headimpact.quality import QualityNote
from headimpact_service import deps
from headimpact_service.ingest.impact_json import MountingBody
from headimpact_service.ingest.impact_reading import mounting
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.intake.scoring import UNKNOWN_DEVICE, DeviceFacts
from headimpact_service.operation import Call
from headimpact_service.store import athletes, devices, ids
from headimpact_service.store.athletes import Athlete

REMEMBER_S = 5.0
REMEMBERED = 10_000
ADULT = 18
OUTSIDE_POPULATION = QualityNote(
    "outside_model_population",
    "note",
    "The published model rests on adult men; this athlete is outside them, so its probabilities are extrapolated.",
)

Found = tuple[DeviceFacts, Athlete | None]


@dataclass(slots=True)
class Facts:
    """Looks devices and athletes up and remembers them for a moment: a busy device sends many impacts a second.

    A mounting is never taken from memory: it moves the score, so it must be the one that is stored now.
    """

    remembered: dict[tuple[Any, ...], tuple[float, Found]] = field(default_factory=dict)

    async def of(self, call: Call, record: ImpactRecord) -> tuple[DeviceFacts, ImpactRecord]:
        """The device's facts, and the record with what its athlete adds."""
        key = (call.data_set_id, record.device_serial, record.athlete_id, record.athlete_external_id)
        until, found = self.remembered.get(key, (0.0, None))
        if found is None or record.needs_device_mounting or time.monotonic() > until:
            found = await deps.read(call.request, _query(*key))
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


def _query(
    data_set_id: bytes, serial: str | None, athlete_id: str | None, external_id: str | None
) -> Callable[[Any], Found]:
    def query(conn: Any) -> Found:  # noqa: ANN401 - a connection of the store
        return _device_in(conn, data_set_id, serial), _athlete_in(conn, data_set_id, athlete_id, external_id)

    return query


def facts_in(conn: Any, data_set_id: bytes) -> Callable[[ImpactRecord], tuple[ImpactRecord, DeviceFacts]]:  # noqa: ANN401
    """The same for the records of one file: each device and athlete is looked up once."""
    device_of = cache(partial(_device_in, conn, data_set_id))
    athlete_of = cache(partial(_athlete_in, conn, data_set_id))

    def look_up(record: ImpactRecord) -> tuple[ImpactRecord, DeviceFacts]:
        athlete = athlete_of(record.athlete_id, record.athlete_external_id)
        return with_population_note(record, athlete), device_of(record.device_serial)

    return look_up


def _device_in(conn: Any, data_set_id: bytes, serial: str | None) -> DeviceFacts:  # noqa: ANN401
    return UNKNOWN_DEVICE if serial is None else _device(devices.get(conn, data_set_id, serial))


def _athlete_in(conn: Any, data_set_id: bytes, athlete_id: str | None, external_id: str | None) -> Athlete | None:  # noqa: ANN401
    raw = None if athlete_id is None else ids.decode("ath", athlete_id)
    if raw is not None:
        return athletes.get(conn, data_set_id, raw)
    return None if external_id is None else athletes.find(conn, data_set_id, external_id)


def _device(device: devices.Device | None) -> DeviceFacts:
    if device is None:
        return UNKNOWN_DEVICE
    sent = None if device.mounting is None else MountingBody.model_validate(device.mounting)
    return DeviceFacts(
        mounting=None if sent is None else mounting(sent),
        linear_acceleration_range_g=device.linear_acceleration_range_g,
        angular_velocity_range_rad_s=device.angular_velocity_range_rad_s,
    )


def with_population_note(record: ImpactRecord, athlete: Athlete | None) -> ImpactRecord:
    """The record, with a note if its athlete is none of those that the published model rests on."""
    if athlete is None or not _outside(record, athlete):
        return record
    return replace(record, notes=(*record.notes, OUTSIDE_POPULATION))


def _outside(record: ImpactRecord, athlete: Athlete) -> bool:
    if athlete.sex is not None and athlete.sex != "male":
        return True
    if athlete.birth_year is None or record.occurred_at is None:
        return False
    return record.occurred_at.year - athlete.birth_year < ADULT
