"""What a score depends on beside the record: its device's mounting and ranges, its athlete's population."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

from headimpact.quality import QualityNote
from headimpact_service.ingest.impact_json import MountingBody
from headimpact_service.ingest.impact_reading import mounting
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.intake.scoring import UNKNOWN_DEVICE, DeviceFacts
from headimpact_service.store import athletes, devices, ids
from headimpact_service.store.athletes import Athlete

ADULT = 18
OUTSIDE_POPULATION = QualityNote(
    "outside_model_population",
    "note",
    "The published model rests on adult men; this athlete is outside them, so its probabilities are extrapolated.",
)

Found = tuple[DeviceFacts, Athlete | None]


def find(conn: Any, data_set_id: bytes, serial: str | None, athlete_id: str | None, external_id: str | None) -> Found:  # noqa: ANN401 - a connection of the store
    """The device of a serial and the athlete of an id or an external id, as far as they are known."""
    return _device_in(conn, data_set_id, serial), _athlete_in(conn, data_set_id, athlete_id, external_id)


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
