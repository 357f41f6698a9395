"""What a record's content is, in 64 hexadecimal digits.

Two deliveries of one impact have one content digest however they were written: key order, ``1`` or ``1.0``, ``Z`` or
``+00:00``, JSON or CSV make no difference; one changed sample does. The digest is SHA-256 over canonical bytes: the
members that say how the samples are to be read, as JSON with sorted keys and no spaces, each signal's samples and
stamps as little-endian float64 in row order (-0.0 counts as 0.0), every part preceded by its length.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from headimpact.recording import Mounting, Recording, Signal
from headimpact_service.ingest.record import ImpactRecord

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)
_ENCODER = json.JSONEncoder(sort_keys=True, separators=(",", ":"), allow_nan=False)

VERSION = 1
"""Part of every digest: a change of the canonical bytes changes it, so that old and new digests never meet."""


@dataclass(frozen=True, slots=True)
class Digests:
    """Both digests of one record, each ``sha256:`` and 64 hexadecimal digits."""

    input: str
    content: str


def digests(record: ImpactRecord, *, athlete: str | None = None) -> Digests:
    """Both digests, reading the samples once; `athlete` as for :func:`content_digest`."""
    kinematics = input_digest(record)
    members = {
        "athlete": athlete or record.athlete_id or record.athlete_external_id,
        "athlete_by": "id" if athlete or record.athlete_id else "external_id",
        "context": dict(record.context),
        "device": record.device_serial,
        "kinematics": kinematics,
        "occurred_at": None if record.occurred_at is None else (record.occurred_at - _EPOCH) // _MICROSECOND,
        "unscorable": list(record.unscorable),
    }
    return Digests(input=kinematics, content=_named(hashlib.sha256(_canonical(members)).hexdigest()))


def content_digest(record: ImpactRecord, *, athlete: str | None = None) -> str:
    """The digest of everything that makes the impact the one it is.

    That is its kinematics, athlete, instant, device, context and the reasons not to score it; not its `external_id`,
    the file it came in, nor what was asked of the answer (`operating_points`, `include`, `extra_criteria`).

    Parameters
    ----------
    record
        The impact.
    athlete
        The stored athlete's id, where it has been looked up: then an athlete named by either id counts as the same.
    """
    return digests(record, athlete=athlete).content


def input_digest(record: ImpactRecord) -> str:
    """The digest of the kinematics alone: what a score is computed from."""
    digest = hashlib.sha256(_canonical(_members(record.recording, record.needs_device_mounting)))
    for name, signal in record.recording.signals():
        digest.update(_canonical({"signal": name, "unit": signal.unit, "rate": signal.sample_rate_hz}))
        digest.update(_samples(signal))
    return _named(digest.hexdigest())


def _named(hexadecimal: str) -> str:
    return f"sha256:{hexadecimal}"


def _members(recording: Recording, needs_device_mounting: bool) -> dict[str, Any]:
    low_pass = recording.low_pass
    filled = {"fill_gaps": True} if recording.fill_gaps else {}
    return filled | {
        "version": VERSION,
        "axes": recording.axes,
        "location": "device" if needs_device_mounting else None,
        "mounting": None if recording.mounting is None else _mounting(recording.mounting),
        "constrained_plane": recording.constrained_plane,
        "pre_trigger_ms": None if recording.pre_trigger_ms is None else float(recording.pre_trigger_ms),
        "filter": [_number(low_pass.linear_acceleration), _number(low_pass.angular_velocity)],
    }


def _mounting(mounting: Mounting) -> list[Any]:
    parts = (mounting.accelerometer_rotation, mounting.gyroscope_rotation, mounting.offset_m)
    delays = [mounting.accelerometer_delay_s, mounting.gyroscope_delay_s]
    return [(np.asarray(part, dtype=np.float64) + 0.0).tolist() for part in parts] + (delays if any(delays) else [])


def _number(cut_off: float | str | None) -> float | str | None:
    return float(cut_off) if isinstance(cut_off, int | float) else cut_off


def _samples(signal: Signal) -> bytes:
    values = _float64(signal.values)
    stamps = b"" if signal.time_s is None else _float64(signal.time_s)
    return b"%d:%b%d:%b" % (len(values), values, len(stamps), stamps)


def _float64(values: np.ndarray[Any, np.dtype[np.float64]]) -> bytes:
    # Adding 0.0 turns -0.0, which JSON writes as -0 or -0.0, into 0.0.
    return (values + 0.0).astype("<f8", copy=False).tobytes()


def _canonical(members: dict[str, Any]) -> bytes:
    text = _ENCODER.encode(members).encode("ascii")
    return b"%d:%b" % (len(text), text)
