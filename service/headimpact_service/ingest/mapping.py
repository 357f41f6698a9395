"""A mapping: which column of a table is which component of which signal, in which unit.

Presets are mappings kept as files; a request may bring one of its own, or correct a preset's in part. Nothing is
guessed: a signal whose unit is in no heading, preset or mapping is refused.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from headimpact.recording import SIGNALS, SignalName
from headimpact_service.ingest.date_order import DateOrder
from headimpact_service.ingest.impact_json import (
    MAX_RATE_HZ,
    MIN_RATE_HZ,
    Axes,
    Filter,
    Location,
    MountingBody,
    Plane,
    Strict,
)

MAX_SPELLINGS = 20
TIME_UNITS = {"s": 1e3, "ms": 1.0, "us": 1e-3, "ns": 1e-6}
"""Units of a time column, in milliseconds."""
DATES_IN = "us"
"""What dates with times of day are read in, whatever unit is said of them."""


def _as_list(value: Any) -> Any:  # noqa: ANN401 - validated after
    """One alternative may be written without its list."""
    return value if isinstance(value, list) else [value]


Heading = Annotated[str, Field(min_length=1, max_length=200)]
Spellings = Annotated[list[Heading], Field(min_length=1, max_length=MAX_SPELLINGS), BeforeValidator(_as_list)]


class TimeColumn(Strict):
    """A column of stamps; of those that are dates with times of day the unit is of no account."""

    column: Heading
    unit: Literal["s", "ms", "us", "ns"]


Times = Annotated[list[TimeColumn], Field(min_length=1, max_length=MAX_SPELLINGS), BeforeValidator(_as_list)]


class SignalColumns(Strict):
    """The columns of one signal; a `-` before a heading turns the component's sign.

    `time` and `sample_rate_hz` are for a sensor that has its own. Of several columns of times with one heading, a
    signal's is the nearest before its own. The rows of such a sensor end where its samples, and its time if it has a
    column of it, are empty. `resultant` and `peak` are the device's own, a value a sample and one an impact, to be
    compared with those of the samples; they are in the signal's unit, unless their heading names another.
    """

    unit: str | None = None
    x: Spellings | None = None
    y: Spellings | None = None
    z: Spellings | None = None
    time: Times | None = None
    sample_rate_hz: float | None = Field(None, ge=MIN_RATE_HZ, le=MAX_RATE_HZ)
    range: float | None = Field(None, gt=0, description="Full scale of the sensor, in `unit`.")
    resultant: Spellings | None = None
    peak: Spellings | None = None


class LinearAccelerationColumns(SignalColumns):
    """Columns of linear acceleration."""

    unit: Literal["g", "m/s^2", "mg", "cm/s^2", "mm/s^2", "ft/s^2"] | None = None


class AngularVelocityColumns(SignalColumns):
    """Columns of angular velocity."""

    unit: Literal["rad/s", "deg/s", "mrad/s", "mdeg/s", "rpm"] | None = None


class AngularAccelerationColumns(SignalColumns):
    """Columns of angular acceleration."""

    unit: Literal["rad/s^2", "deg/s^2", "krad/s^2", "kdeg/s^2"] | None = None


class DateAndTime(Strict):
    """An instant that is spread over two columns, a date and a time of day, or in one, `date`, with both.

    `order` says what the numbers of a date are that does not begin with its year: 25/03/2026 is `dmy`.
    """

    date: Spellings
    time: Spellings | None = None
    order: DateOrder | None = None


ContextField = Literal[
    "session_id",
    "activity",
    "sport",
    "position",
    "event_definition",
    "video_verified",
    "worn",
    "sensor_type",
    "firmware",
    "linear_acceleration_range_g",
    "angular_velocity_range_rad_s",
    "trigger_threshold_g",
    "post_trigger_ms",
    "on_board_filter",
    "level",
    "sex",
    "age_years",
]
ReadingField = Literal[
    "axes", "filter", "constrained_plane", "pre_trigger_ms", "location", "mounting", "sample_rate_hz", "fill_gaps"
]


class Mapping(Strict):
    """How a table is read. Every field is optional: a request's mapping may complete or correct a preset's.

    `zero` says what the stamps count from: `record_start` (their first is the record's start), `trigger` (time zero is
    the trigger). Left out, stamps that run from before zero to after it count from the trigger, others from the start.

    `sample_number` counts the samples of an impact one by one: a number that is left out or out of order is refused.

    `context` and `reading` are columns of what an impact says of itself: its context, and how its samples are to be
    read, each as in the JSON of an impact; the impact's first row counts. A field that is null is read from no column.
    `time_base` parts the rows of an impact whose signals do not share their times: rows with one value in it go
    together, and a signal is in one part only.
    """

    linear_acceleration: LinearAccelerationColumns | None = None
    angular_velocity: AngularVelocityColumns | None = None
    angular_acceleration: AngularAccelerationColumns | None = None
    time: Times | None = None
    zero: Literal["record_start", "trigger"] | None = None
    sample_rate_hz: float | None = Field(None, ge=MIN_RATE_HZ, le=MAX_RATE_HZ)
    pre_trigger_ms: float | None = Field(None, ge=0.0, le=60_000.0)
    group_by: Annotated[list[Spellings], Field(max_length=8), BeforeValidator(_as_list)] | None = None
    external_id: Spellings | None = None
    athlete: Spellings | None = None
    device: Spellings | None = None
    session_id: Spellings | None = None
    context: dict[ContextField, Spellings | None] | None = None
    reading: dict[ReadingField, Spellings | None] | None = None
    unscorable: Spellings | None = None
    time_base: Spellings | None = None
    sample_number: Spellings | None = None
    occurred_at: Spellings | DateAndTime | None = None
    axes: Axes | None = None
    location: Location | None = None
    mounting: MountingBody | None = None
    constrained_plane: Plane | None = None
    filter: Filter | None = None
    fill_gaps: bool | None = None
    skip_rows: int | None = Field(None, ge=0, le=1000, description="Lines above the headings.")
    drop_rows: int | None = Field(None, ge=0, le=1000, description="Samples to drop at the start of each impact.")

    def columns_of(self, signal: SignalName) -> SignalColumns | None:
        """The columns of one signal."""
        columns: SignalColumns | None = getattr(self, signal)
        return columns


def read_from_none(*way: str) -> dict[str, Any]:
    """The mapping, as JSON, that reads no column for the field that a way of names leads to."""
    *tables, field = way
    made: dict[str, Any] = {field: None}
    for name in reversed(tables):
        made = {name: made}
    return made


def merge(base: Mapping, over: Mapping | None) -> Mapping:
    """`base` with everything that `over` gives put in its place; within a signal and a table of fields, one by one."""
    if over is None:
        return base
    given: dict[str, Any] = {name: getattr(over, name) for name in over.model_fields_set}
    for signal in SIGNALS:
        below, above = base.columns_of(signal), over.columns_of(signal)
        if below is not None and above is not None:
            fields = {name: getattr(above, name) for name in above.model_fields_set}
            given[signal] = below.model_copy(update=fields)
    for name in ("context", "reading"):
        if given.get(name) is not None:
            rest = (getattr(base, name) or {}).items()
            given[name] = given[name] | {field: spelled for field, spelled in rest if field not in given[name]}
    if "session_id" in (over.context or {}):  # which has a field of its own beside
        given.setdefault("session_id", None)
    return base.model_copy(update=given)
