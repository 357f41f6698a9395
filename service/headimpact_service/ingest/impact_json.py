"""The JSON form of an impact: strict models that validate a body in one pass from its bytes.

The models say what a field alone can say; rules between fields are in :mod:`.impact_rules`, the reading of a body into
a record in :mod:`.impact_reading`.
"""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag

from headimpact.published import QUALITY_LIMITS
from headimpact_service.ingest.times import instant, known_zone

MIN_SAMPLES = 3
MAX_SAMPLES = 20_000
MIN_RATE_HZ = 500.0
MAX_RATE_HZ = 1_000_000.0
MAX_OPERATING_POINTS = 20
MIN_CUT_OFF_HZ = 1.0
"""A lower one leaves nothing of an impact, and far below it the filter's equations are singular."""

# No control characters: they have no place in a name, and PostgreSQL stores no NUL. And no blanks alone, which in a
# table are no name.
PRINTABLE = r"^[^\u0000-\u001f\u007f]*[^\u0000-\u001f\u007f\s][^\u0000-\u001f\u007f]*$"

MAX_NAME = 200


def _zone(name: str) -> str:
    known_zone(name)
    return name


def _moment(value: object) -> object:
    """The instant of a time with its offset; whatever is no text is left to be refused."""
    return instant(value) if isinstance(value, str) else value


Name = Annotated[str, Field(min_length=1, max_length=MAX_NAME, pattern=PRINTABLE)]
Text = Annotated[str, Field(min_length=1, max_length=2000, pattern=PRINTABLE)]
Word = Annotated[str, Field(min_length=1, max_length=64, pattern=PRINTABLE)]
# The first bad sample ends a list's validation: a list of 20 000 strings would cost a megabyte of errors a thousand.
Samples = Annotated[list[float], Field(min_length=MIN_SAMPLES, max_length=MAX_SAMPLES, fail_fast=True)]
# Null is a missing sample, which is taken only where it is to be filled or the record is not to be scored.
Components = Annotated[list[float | None], Field(min_length=MIN_SAMPLES, max_length=MAX_SAMPLES, fail_fast=True)]
Zone = Annotated[str, Field(max_length=64), AfterValidator(_zone)]
Moment = Annotated[datetime, BeforeValidator(_moment)]
Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Matrix = Annotated[list[Vector], Field(min_length=3, max_length=3)]
Fraction = Annotated[float, Field(gt=0.0, lt=1.0)]
Incidence = Annotated[float, Field(ge=1e-9, le=1.0 - 1e-9)]
"""So far from 0 and 1 that no probability at it becomes either."""
Axes = Literal["anatomical", "sae_j211"]
Location = Literal["head_cg", "sensor"]
Plane = Literal["sagittal", "coronal", "axial"]
CriterionKey = Literal[
    "peak_angular_acceleration",
    "delta_angular_velocity",
    "bric",
    "ric",
    "peak_linear_acceleration",
    "hic15",
    "hic36",
    "si",
    "hip",
    "hip3d",
    "gambit",
    "vtcp",
    "bam",
]


class Strict(BaseModel):
    """What every body of an impact has in common: no unknown fields, no coercion, no NaN and no Infinity."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, hide_input_in_errors=True)


class AthleteRef(Strict):
    """Whose head it was: exactly one of the two."""

    id: Name | None = Field(None, description="Our id of a known athlete.", examples=["ath_01kab3fz8c9vqt5n2m7d4xw6ye"])
    external_id: Name | None = Field(
        None, description="Your pseudonymous id; the athlete is made on first sight.", examples=["p-17"]
    )


class DeviceRef(Strict):
    """Which device recorded it; an unknown serial is made."""

    serial: Name = Field(description="The device's serial number.", examples=["mg-0042"])


class Context(Strict):
    """What was going on, and what CHAMP 2022 asks to record; every field is optional."""

    session_id: Name | None = Field(None, description="The game, training or test.", examples=["g-2026-11-20"])
    activity: Word | None = Field(None, description="What kind of session it was.", examples=["game"])
    sport: Word | None = Field(None, description="The sport.", examples=["american_football"])
    position: Word | None = Field(None, description="The athlete's position in play.", examples=["LB"])
    event_definition: Text | None = Field(None, description="What the study counts as a head-impact event.")
    video_verified: bool | None = Field(None, description="Whether video showed the impact.")
    worn: bool | None = Field(None, description="Whether the device reports that it was worn.")
    sensor_type: Word | None = Field(None, description="Kind of sensor.", examples=["mouthguard"])
    firmware: Word | None = Field(None, description="The device's firmware at the time.")
    linear_acceleration_range_g: float | None = Field(None, gt=0, description="Full scale of the accelerometer [g].")
    angular_velocity_range_rad_s: float | None = Field(None, gt=0, description="Full scale of the gyroscope [rad/s].")
    trigger_threshold_g: float | None = Field(None, ge=0, description="Acceleration that starts a record [g].")
    post_trigger_ms: float | None = Field(None, ge=0, description="Recorded time after the trigger [ms].")
    on_board_filter: Text | None = Field(None, description="Filtering done before the data left the device.")
    level: Word | None = Field(None, description="Level of play, where no athlete says it.", examples=["collegiate"])
    sex: Literal["male", "female", "other"] | None = Field(None, description="Of the person, where no athlete says it.")
    age_years: float | None = Field(None, ge=0, le=120, description="Of the person at the time, likewise.")


class SignalBody(Strict):
    """One three-axis signal; `sample_rate_hz` or `time_ms`, exactly one of them."""

    sample_rate_hz: float | None = Field(
        None, ge=MIN_RATE_HZ, le=MAX_RATE_HZ, description="Samples per second [Hz].", examples=[1000]
    )
    time_ms: Samples | None = Field(
        None, description="One stamp per sample [ms], strictly increasing.", examples=[[0.0, 1.0, 2.0]]
    )
    x: Components | None = Field(
        None,
        description="Samples along (or about) x, forward. Null only outside a constrained plane; a null "
        "sample is a gap, which `fill_gaps` fills.",
        examples=[[0.1, 3.2, 0.4]],
    )
    y: Components | None = Field(None, description="Samples along (or about) y.", examples=[[0.0, -1.1, 0.2]])
    z: Components | None = Field(None, description="Samples along (or about) z.", examples=[[0.9, 7.5, 1.2]])
    range: float | None = Field(None, gt=0, description="Full scale of the sensor, in `unit`: tells clipping.")
    peak_resultant: float | None = Field(
        None, ge=0, description="The peak that the device itself reports, in `unit`: checked against the samples."
    )


class LinearAccelerationBody(SignalBody):
    """Linear acceleration."""

    unit: Literal["g", "m/s^2"] = Field(description="Required: units are never guessed.")


class AngularVelocityBody(SignalBody):
    """Angular velocity."""

    unit: Literal["rad/s", "deg/s"] = Field(description="Required: units are never guessed.")


class AngularAccelerationBody(SignalBody):
    """Angular acceleration as the device gives it; it is used unfiltered."""

    unit: Literal["rad/s^2", "deg/s^2"] = Field(description="Required: units are never guessed.")


Delay = Annotated[
    float,
    Field(
        ge=-1000.0,
        le=1000.0,
        description="How much later than the motion its samples are stamped [ms]; shown where it is not zero.",
        exclude_if=lambda delay: delay == 0.0,
    ),
]


MAX_OFFSET_MM = 1000.0 * QUALITY_LIMITS["mounting"]["maximum_offset_m"]
Offset = Annotated[float, Field(ge=-MAX_OFFSET_MM, le=MAX_OFFSET_MM)]


class AccelerometerMounting(Strict):
    """How the accelerometer sits on the head."""

    rotation: Matrix = Field(
        description="Sensor axes to anatomical head axes: orthonormal with determinant +1 within 1e-3.",
        examples=[[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]],
    )
    offset_mm: Annotated[list[Offset], Field(min_length=3, max_length=3)] = Field(
        description="Its position from the head's centre of gravity, in anatomical head axes [mm].",
        examples=[[70.0, 0.0, -60.0]],
    )
    delay_ms: Delay = 0.0


class GyroscopeMounting(Strict):
    """How the gyroscope sits on the head; where it sits makes no difference."""

    rotation: Matrix = Field(
        description="Sensor axes to anatomical head axes: orthonormal with determinant +1 within 1e-3.",
        examples=[[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]],
    )
    delay_ms: Delay = 0.0


class MountingBody(Strict):
    """Sensor to head."""

    accelerometer: AccelerometerMounting
    gyroscope: GyroscopeMounting | None = Field(
        None, description="Left out where it shares the accelerometer's axes and delay, as in one chip."
    )


def _json_kind(value: Any) -> str | None:  # noqa: ANN401 - whatever the JSON held
    if isinstance(value, bool):
        return None
    if isinstance(value, str):
        return "name"
    if isinstance(value, int | float):
        return "hertz"
    return "table" if isinstance(value, dict | BaseModel) else None


CutOff = Annotated[
    Annotated[Annotated[float, Field(ge=MIN_CUT_OFF_HZ, le=MAX_RATE_HZ)], Tag("hertz")]
    | Annotated[Literal["CFC60", "CFC180", "CFC600", "CFC1000"], Tag("name")],
    Discriminator(
        _json_kind,
        custom_error_type="cut_off_form",
        custom_error_message="A filter is a cut-off in Hz, CFC60, CFC180, CFC600, CFC1000 or null",
    ),
]


class FilterBody(Strict):
    """A low-pass filter for each recorded signal; null or left out: none."""

    linear_acceleration: CutOff | None = Field(None, examples=[300])
    angular_velocity: CutOff | None = Field(None, examples=["CFC180"])


Filter = Annotated[
    Annotated[Literal["paper", "none"], Tag("name")] | Annotated[FilterBody, Tag("table")],
    Discriminator(
        _json_kind,
        custom_error_type="filter_form",
        custom_error_message='A filter is "paper", "none" or an object with a cut-off for each signal',
    ),
]


class Kinematics(Strict):
    """The traces and how they are to be read."""

    axes: Axes = Field(
        "anatomical",
        description="`anatomical`: x forward, y left, z up. `sae_j211`: x forward, y right, z down: every signal is "
        "taken to (x, -y, -z) first, before a mounting's rotations.",
    )
    location: Location = Field("head_cg", description="`sensor` needs a mounting, inline or of the device.")
    mounting: MountingBody | None = None
    constrained_plane: Plane | None = Field(
        None,
        description="The motion outside this plane of the head is zero. Components outside it may be left out: of a "
        "sensor, those that its mounting's rotation keeps out of it.",
    )
    pre_trigger_ms: float | None = Field(
        None,
        ge=0.0,
        le=60_000.0,
        description="From the first sample to the trigger [ms]; null: not known. Where it is absent and `time_ms` "
        "goes from below zero to zero or above, zero is the trigger.",
        examples=[10],
    )
    filter: Filter = Field("paper", description="`paper` is 300 Hz on acceleration and 184 Hz on angular velocity.")
    fill_gaps: bool = Field(
        default=False, description="Fill gaps of at most 2 samples: null among them, or missing between the stamps."
    )
    linear_acceleration: LinearAccelerationBody | None = None
    angular_velocity: AngularVelocityBody | None = None
    angular_acceleration: AngularAccelerationBody | None = None


class OperatingPointBody(Strict):
    """A point on one criterion's curve; exactly one of the three."""

    criterion: CriterionKey = Field(examples=["bam"])
    sensitivity: Fraction | None = Field(None, description="Share of concussions to be found.", examples=[0.9])
    specificity: Fraction | None = Field(None, description="Share of other impacts to be passed.")
    threshold: Fraction | None = Field(None, description="A probability, taken as it is at any incidence.")


class ScoreBody(Strict):
    """An impact to be scored and not stored."""

    external_id: Name | None = Field(None, description="Your name for the impact.", examples=["mg-0042/1763665445123"])
    occurred_at: Annotated[str, Field(max_length=64, json_schema_extra={"format": "date-time"})] | None = Field(
        None,
        description="RFC 3339 with an offset, or a local time with `time_zone` beside it.",
        examples=["2026-11-20T19:04:05.123Z"],
    )
    time_zone: Annotated[str, Field(max_length=64)] | None = Field(
        None, description="IANA zone of a local `occurred_at`.", examples=["Europe/Dublin"]
    )
    device: DeviceRef | None = None
    context: Context | None = None
    kinematics: Kinematics
    operating_points: Annotated[list[OperatingPointBody], Field(max_length=MAX_OPERATING_POINTS)] | None = Field(
        None,
        description="Answered in this order; the organisation's default where left out. One that the model lacks "
        "is 422 where it is asked for here, and answered with null and a `reason` where it is a default.",
    )
    include: Annotated[list[Literal["traces"]], Field(max_length=1)] | None = Field(
        None, description="`traces` adds the filtered head kinematics and the brain-angle history."
    )
    extra_criteria: Annotated[list[Word], Field(max_length=32)] | None = Field(
        None, description="Criteria beside the thirteen, by name.", examples=[["damage"]]
    )


Reasons = Annotated[list[Text], Field(min_length=1, max_length=20)]


class FileImpactBody(ScoreBody):
    """An impact in a file: its athlete may come with the upload instead."""

    athlete: AthleteRef | None = None
    unscorable: Reasons | None = Field(None, description="Why the record is to be stored without a score.")


class ImpactBody(ScoreBody):
    """An impact to be scored and stored."""

    athlete: AthleteRef
    unscorable: Reasons | None = Field(
        None,
        description="Why the record is to be stored without a score, such as a channel that its laboratory disowns.",
        examples=[None],
    )
