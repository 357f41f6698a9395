"""Devices: what they are, and how their signals come to the head."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any
from urllib.parse import quote

from pydantic import BaseModel, Field, TypeAdapter, ValidationError, WithJsonSchema
from starlette.responses import Response

from headimpact_service import deps, examples
from headimpact_service.answers import answer
from headimpact_service.errors import invalid_parameter, not_found
from headimpact_service.ingest.impact_json import PRINTABLE, MountingBody, Name, Strict, Text, Word
from headimpact_service.ingest.impact_reading import mounting
from headimpact_service.operation import Answer, Call, Routes
from headimpact_service.parameters import SyncQuery
from headimpact_service.routes.lists import MEDIA_TYPES, Listing, answer_list
from headimpact_service.routes.preconditions import IF_MATCH, etag, if_match
from headimpact_service.routes.tables import Cell
from headimpact_service.store import devices, ids
from headimpact_service.store.devices import Device, DeviceFields

routes = Routes("devices")


Metadata = Annotated[
    dict[Word, Text],
    Field(max_length=50),
    # pydantic would describe the values of well-formed keys only, and leave every other key open.
    WithJsonSchema(
        {
            "type": "object",
            "maxProperties": 50,
            "propertyNames": {"minLength": 1, "maxLength": 64, "pattern": PRINTABLE},
            "additionalProperties": {"type": "string", "minLength": 1, "maxLength": 2000, "pattern": PRINTABLE},
        }
    ),
]


class DeviceBody(Strict):
    """What a device is, whole: a field that is left out is cleared."""

    maker: Word | None = Field(None, examples=["Prevent Biometrics"])
    model: Word | None = Field(None, examples=["MG-2"])
    firmware: Word | None = None
    linear_acceleration_range_g: float | None = Field(None, gt=0, le=10_000, description="Full scale [g].")
    angular_velocity_range_rad_s: float | None = Field(None, gt=0, le=10_000, description="Full scale [rad/s].")
    trigger_threshold_g: float | None = Field(None, ge=0, le=10_000, description="Starts a record [g].")
    mounting: MountingBody | None = Field(None, description="Used where an impact says `sensor` and brings none.")
    metadata: Metadata = Field(default_factory=dict, description="Anything else, as text.")


class DeviceView(BaseModel):
    """A device."""

    id: str
    serial: str
    maker: str | None
    model: str | None
    firmware: str | None
    linear_acceleration_range_g: float | None
    angular_velocity_range_rad_s: float | None
    trigger_threshold_g: float | None
    mounting: MountingBody | None
    metadata: dict[str, str]
    revision: int
    created_at: datetime
    updated_at: datetime


class DeviceList(BaseModel):
    """A page of devices."""

    data: list[DeviceView]
    next_cursor: str | None


class DeviceQuery(SyncQuery):
    """Which devices."""


_FIELDS = tuple(DeviceBody.model_fields)
_SERIAL: TypeAdapter[str] = TypeAdapter(Name)
ETAG = {"ETag": "The revision, for If-Match."}


@routes(
    "PUT",
    "/v1/devices/{serial:path}",
    "Describe a device",
    "impacts:write",
    {
        200: Answer(DeviceView, "The device as it is now.", headers=ETAG),
        201: Answer(DeviceView, "The new device.", headers=ETAG | {"Location": "Its address."}),
    },
    body=DeviceBody,
    example=examples.device(),
    request_headers=IF_MATCH,
    problems=("not-found", "precondition-failed", "improper-rotation"),  # no route holds a line feed in a serial
)
async def put_device(call: Call) -> Response:
    """A new mounting serves the impacts that are sent or corrected from now on.

    Stored scores keep the one they were made with; `PUT /v1/impacts/{id}` with the impact's body takes the new one.
    """
    serial, revision = _serial(call), if_match(call.request)
    body: DeviceBody = call.body
    if body.mounting is not None:
        mounting(body.mounting, "/mounting")  # refused here rather than at the first impact
    fields = DeviceFields(**body.model_dump())
    device, made = await deps.write(
        call.request, lambda conn: devices.put(conn, call.data_set_id, serial, fields, if_match=revision)
    )
    call.request.app.state.facts.forget()
    location = {"Location": f"/v1/devices/{quote(serial, safe='')}"} if made else {}
    return answer(document(device), 201 if made else 200, etag(device.revision) | location)


@routes(
    "GET",
    "/v1/devices",
    "List devices",
    "impacts:read",
    {200: Answer(DeviceList, "A page of devices, newest first.", MEDIA_TYPES)},
    query=DeviceQuery,
    problems=("bad-cursor",),
)
async def list_devices(call: Call) -> Response:
    """With `updated_since` in the order of change."""
    query: DeviceQuery = call.query
    listing = Listing(
        "devices",
        lambda conn, after, limit: devices.page(
            conn, call.data_set_id, updated_since=query.updated_since, limit=limit, after=after
        ),
        document,
        ("id", "serial", *_SCALARS, "revision", "created_at", "updated_at"),
        _cells,
        numbers=_NUMBERS,
    )
    return await answer_list(call, listing, query)


@routes(
    "GET",
    "/v1/devices/{serial:path}",
    "Read a device",
    "impacts:read",
    {200: Answer(DeviceView, "The device.", headers=ETAG)},
    problems=("not-found",),
)
async def read_device(call: Call) -> Response:
    """By its serial."""
    serial = call.path("serial")
    found = await deps.read(call.request, lambda conn: devices.get(conn, call.data_set_id, serial))
    if found is None:
        raise not_found("device")
    return answer(document(found), headers=etag(found.revision))


def _serial(call: Call) -> str:
    """The serial in the path, held to the same rules as in an impact."""
    try:
        return _SERIAL.validate_python(call.given("serial"))
    except ValidationError:
        raise invalid_parameter(
            "serial", "Must have 1 to 200 characters without control characters.", "serial"
        ) from None


_SCALARS = tuple(name for name in _FIELDS if name not in {"mounting", "metadata"})


_NUMBERS = frozenset({"linear_acceleration_range_g", "angular_velocity_range_rad_s", "trigger_threshold_g"})


def document(device: Device) -> dict[str, Any]:
    """A device as it is answered."""
    return {
        "id": ids.encode("dev", device.id),
        "serial": device.serial,
        **{name: getattr(device, name) for name in _FIELDS},
        "revision": device.revision,
        "created_at": device.created_at,
        "updated_at": device.updated_at,
    }


def _cells(device: Device) -> list[Cell]:
    fields = [getattr(device, name) for name in _SCALARS]
    times = (device.created_at, device.updated_at)
    return [ids.encode("dev", device.id), device.serial, *fields, device.revision, *times]
