"""Devices: known by their serial, made on first sight, with the mounting that takes their signals to the head."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, RowMapping, bindparam, insert, select, update

from headimpact_service.store import ids
from headimpact_service.store.clock import next_change
from headimpact_service.store.many import in_parts
from headimpact_service.store.paging import Page, Position, keyset, page_of
from headimpact_service.store.revision import require_revision
from headimpact_service.store.tables import devices


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceFields:
    """What a client says of a device; `mounting` is the `mounting` object of the API as it was sent."""

    maker: str | None = None
    model: str | None = None
    firmware: str | None = None
    linear_acceleration_range_g: float | None = None
    angular_velocity_range_rad_s: float | None = None
    trigger_threshold_g: float | None = None
    mounting: Mapping[str, Any] | None = None
    metadata: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Device(DeviceFields):
    """A device as stored."""

    id: bytes
    serial: str
    revision: int
    created_at: datetime
    updated_at: datetime


_COLUMNS = [column for column in devices.c if column.name != "data_set_id"]
_DEVICE = select(*_COLUMNS).where(devices.c.data_set_id == bindparam("data_set_id"))
_BY_SERIAL = _DEVICE.where(devices.c.serial == bindparam("serial"))
_BY_SERIALS = _DEVICE.where(devices.c.serial.in_(bindparam("asked", expanding=True)))
_UPDATE = update(devices).where(devices.c.id == bindparam("device_id"))


def get(conn: Connection, data_set_id: bytes, serial: str) -> Device | None:
    """The device of a serial."""
    row = conn.execute(_BY_SERIAL, {"data_set_id": data_set_id, "serial": serial}).mappings().first()
    return None if row is None else _device(row)


def get_many(conn: Connection, data_set_id: bytes, serials: Iterable[str]) -> dict[str, Device]:
    """The devices of serials, as far as they are known."""
    found: dict[str, Device] = {}
    for asked in in_parts(serials):
        rows = conn.execute(_BY_SERIALS, {"data_set_id": data_set_id, "asked": asked}).mappings()
        found |= {row["serial"]: _device(row) for row in rows}
    return found


def put(
    conn: Connection, data_set_id: bytes, serial: str, new: DeviceFields, *, if_match: int | None = None
) -> tuple[Device, bool]:
    """The device of a serial with exactly these fields, and whether it was made now.

    The revision grows only if something changes.
    """
    present = get(conn, data_set_id, serial)
    if present is None:
        require_revision(0, if_match, exists=False)
        return _create(conn, data_set_id, serial, new), True
    require_revision(present.revision, if_match)
    changed = replace(present, **asdict(new))
    if changed == present:
        return present, False
    now = next_change(conn, devices, data_set_id)
    changed = replace(changed, revision=present.revision + 1, updated_at=now)
    values = asdict(changed)
    conn.execute(_UPDATE, values | {"device_id": values.pop("id")})
    return changed, False


def ensure(conn: Connection, data_set_id: bytes, serial: str) -> bytes:
    """The id of the device of a serial, made on first sight."""
    return (get(conn, data_set_id, serial) or _create(conn, data_set_id, serial, DeviceFields())).id


def page(
    conn: Connection,
    data_set_id: bytes,
    *,
    serial: str | None = None,
    updated_since: datetime | None = None,
    limit: int = 100,
    after: Position | None = None,
) -> Page[Device]:
    """A page of the list: newest first, or by change if `updated_since` is given."""
    query = _DEVICE if serial is None else _DEVICE.where(devices.c.serial == serial)
    query = keyset(query, devices, updated_since=updated_since, after=after, limit=limit)
    rows = conn.execute(query, {"data_set_id": data_set_id}).mappings()
    return page_of([_device(row) for row in rows], limit)


def _create(conn: Connection, data_set_id: bytes, serial: str, new: DeviceFields) -> Device:
    now = next_change(conn, devices, data_set_id)
    made = Device(**asdict(new), id=ids.new(), serial=serial, revision=1, created_at=now, updated_at=now)
    conn.execute(insert(devices), asdict(made) | {"data_set_id": data_set_id})
    return made


def _device(row: RowMapping) -> Device:
    return Device(**row)
