"""What a score depends on beside the record: its device's mounting and ranges, its athlete's population."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache, partial
from typing import Any

from headimpact.quality import QualityNote, population_reason
from headimpact_service.ingest.impact_json import MountingBody
from headimpact_service.ingest.impact_reading import mounting
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.intake.scoring import UNKNOWN_DEVICE, DeviceFacts
from headimpact_service.store import athletes, devices, ids
from headimpact_service.store.athletes import Athlete

Found = tuple[DeviceFacts, Athlete | None]


def find(conn: Any, data_set_id: bytes, serial: str | None, athlete_id: str | None, external_id: str | None) -> Found:  # noqa: ANN401 - a connection of the store
    """The device of a serial and the athlete of an id or an external id, as far as they are known."""
    return _device_in(conn, data_set_id, serial), _athlete_in(conn, data_set_id, athlete_id, external_id)


def facts_of(
    conn: Any,  # noqa: ANN401 - a connection of the store
    data_set_id: bytes,
    records: Sequence[ImpactRecord],
) -> Callable[[ImpactRecord], tuple[ImpactRecord, DeviceFacts]]:
    """The same for some records: their devices and athletes are looked up together."""
    serials = {record.device_serial for record in records if record.device_serial is not None}
    names = {record.athlete_external_id for record in records if record.athlete_external_id is not None}
    known = {serial: _device(device) for serial, device in devices.get_many(conn, data_set_id, serials).items()}
    found = athletes.find_many(conn, data_set_id, names)
    named = {name: _as_merged(conn, data_set_id, athlete) for name, athlete in found.items()}
    by_id = cache(partial(_athlete_in, conn, data_set_id, external_id=None))

    def look_up(record: ImpactRecord) -> tuple[ImpactRecord, DeviceFacts]:
        athlete = named.get(record.athlete_external_id or "") if record.athlete_id is None else by_id(record.athlete_id)
        return with_population_note(record, athlete), known.get(record.device_serial or "", UNKNOWN_DEVICE)

    return look_up


def _device_in(conn: Any, data_set_id: bytes, serial: str | None) -> DeviceFacts:  # noqa: ANN401 - a connection of the store
    return UNKNOWN_DEVICE if serial is None else _device(devices.get(conn, data_set_id, serial))


def _athlete_in(conn: Any, data_set_id: bytes, athlete_id: str | None, external_id: str | None) -> Athlete | None:  # noqa: ANN401 - a connection of the store
    raw = None if athlete_id is None else ids.decode("ath", athlete_id)
    if raw is not None:
        return athletes.present(conn, data_set_id, raw)
    found = None if external_id is None else athletes.find(conn, data_set_id, external_id)
    return None if found is None else _as_merged(conn, data_set_id, found)


def _as_merged(conn: Any, data_set_id: bytes, athlete: Athlete) -> Athlete | None:  # noqa: ANN401 - a connection of the store
    """Who an athlete is now: of one that was merged, the one who stayed."""
    return athlete if athlete.merged_into is None else athletes.get(conn, data_set_id, athlete.merged_into)


def _device(device: devices.Device | None) -> DeviceFacts:
    if device is None:
        return UNKNOWN_DEVICE
    sent = None if device.mounting is None else MountingBody.model_validate(device.mounting)
    return DeviceFacts(
        mounting=None if sent is None else mounting(sent),
        linear_acceleration_range_g=device.linear_acceleration_range_g,
        angular_velocity_range_rad_s=device.angular_velocity_range_rad_s,
        revision=device.revision,
    )


def with_population_note(record: ImpactRecord, athlete: Athlete | None) -> ImpactRecord:
    """The record, with a note if its athlete is none of those that the published model rests on.

    What is stored of the athlete is asked first; what it does not say, the impact's context may.
    """
    context = record.context
    reason = population_reason(
        (athlete and athlete.sex) or context.get("sex"),
        _age_years(record, athlete),
        (athlete and athlete.level) or context.get("level"),
    )
    if reason is None:
        return record
    detail = (
        f"This athlete is none of the adult men that the published model rests on ({reason}): its probabilities are "
        "extrapolated, and so are a fitted model's whose cohort had no such athletes."
    )
    return replace(record, notes=(*record.notes, QualityNote("outside_model_population", "note", detail)))


def _age_years(record: ImpactRecord, athlete: Athlete | None) -> float | None:
    """The age at the impact, of a birth year at most: a year's last birthday counts.

    Of an impact of no known time it is at most the age now, and what the context says if that is less.
    """
    said: float | None = record.context.get("age_years")
    if athlete is None or athlete.birth_year is None:
        return said
    if record.occurred_at is not None:
        return float(record.occurred_at.year - athlete.birth_year)
    now = float(datetime.now(UTC).year - athlete.birth_year)
    return now if said is None else min(now, said)
