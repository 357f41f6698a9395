"""What a record's content is, in 32 bytes.

Two deliveries of one impact have one content digest however they were written: key order, ``1`` or ``1.0``, ``Z`` or
``+00:00``, JSON or CSV make no difference; one changed sample does. The digest is SHA-256 over canonical bytes: the
members that say how the samples are to be read, as JSON with sorted keys and no spaces, each signal's samples and
stamps as little-endian float64 in row order (-0.0 counts as 0.0), every part preceded by its length.
"""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from hashlib import sha256
from typing import Any

import numpy as np

from headimpact.recording import Recording, Signal
from headimpact.uniform import MountingNumbers
from headimpact_service.ingest.record import ImpactRecord

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)
_ENCODER = json.JSONEncoder(sort_keys=True, separators=(",", ":"), allow_nan=False)

VERSION = 1
"""Part of every digest: a change of the canonical bytes changes it, so that old and new digests never meet."""


def content_digest(record: ImpactRecord, kinematics: bytes | None = None) -> bytes:
    """The digest of everything that makes the impact the one it is.

    That is its kinematics, athlete, instant, device, context and the reasons not to score it; not its `external_id`,
    the file it came in, nor what was asked of the answer (`operating_points`, `include`, `extra_criteria`).

    Parameters
    ----------
    record
        The impact.
    kinematics
        Its :func:`input_digest`, where that is known.
    """
    members = {
        "athlete": record.athlete_id or record.athlete_external_id,
        "athlete_by": "id" if record.athlete_id else "external_id",
        "context": dict(record.context),
        "device": record.device_serial,
        "kinematics": shown(kinematics or input_digest(record)),
        "occurred_at": None if record.occurred_at is None else (record.occurred_at - _EPOCH) // _MICROSECOND,
        "unscorable": list(record.unscorable),
    }
    return sha256(_canonical(members)).digest()


def input_digest(record: ImpactRecord) -> bytes:
    """The digest of the kinematics alone: what a score is computed from."""
    parts = [_reading(record.recording, record.needs_device_mounting)]
    for name, signal in record.recording.signals():
        parts.append(_heading(name, signal.unit, signal.sample_rate_hz))
        parts += _samples(signal)
    return sha256(b"".join(parts)).digest()


def shown(digest: bytes) -> str:
    """A digest as it is written."""
    return f"sha256:{digest.hex()}"


def _reading(recording: Recording, needs_device_mounting: bool) -> bytes:
    mounting = None if recording.mounting is None else MountingNumbers.of(recording.mounting)
    # Numbers that are equal are kept as one, so they must be one kind of number.
    pre_trigger_ms = None if recording.pre_trigger_ms is None else float(recording.pre_trigger_ms)
    low_pass = recording.low_pass
    chosen = (_number(low_pass.linear_acceleration), _number(low_pass.angular_velocity))
    plane = recording.constrained_plane
    return _canonical_reading(
        recording.axes, mounting, plane, pre_trigger_ms, chosen, recording.fill_gaps, needs_device_mounting
    )


@lru_cache(maxsize=512)
def _canonical_reading(
    axes: str,
    mounting: MountingNumbers | None,
    constrained_plane: str | None,
    pre_trigger_ms: float | None,
    low_pass: tuple[float | str | None, float | str | None],
    fill_gaps: bool,
    needs_device_mounting: bool,
) -> bytes:
    """How the samples are to be read. Devices say it the same way again and again, so it is kept."""
    members = {
        "version": VERSION,
        "axes": axes,
        "location": "device" if needs_device_mounting else None,
        "mounting": None if mounting is None else _mounting(mounting),
        "constrained_plane": constrained_plane,
        "pre_trigger_ms": pre_trigger_ms,
        "filter": list(low_pass),
    }
    return _canonical(members | ({"fill_gaps": True} if fill_gaps else {}))


def _mounting(mounting: MountingNumbers) -> list[Any]:
    parts = (mounting.accelerometer_rotation, mounting.gyroscope_rotation)
    rotations = [(np.array(part).reshape(3, 3) + 0.0).tolist() for part in parts]
    offset = (np.array(mounting.offset_m) + 0.0).tolist()
    delays = [mounting.accelerometer_delay_s, mounting.gyroscope_delay_s]
    return [*rotations, offset, *(delays if any(delays) else ())]


def _number(cut_off: float | str | None) -> float | str | None:
    return float(cut_off) if isinstance(cut_off, int | float) else cut_off


@lru_cache(maxsize=512)
def _heading(signal: str, unit: str, sample_rate_hz: float | None) -> bytes:
    return _canonical({"signal": signal, "unit": unit, "rate": sample_rate_hz})


def _samples(signal: Signal) -> tuple[bytes, ...]:
    values = _float64(signal.values)
    stamps = b"" if signal.time_s is None else _float64(signal.time_s)
    return b"%d:" % len(values), values, b"%d:" % len(stamps), stamps


def _float64(values: np.ndarray[Any, np.dtype[np.float64]]) -> bytes:
    # Adding 0.0 turns -0.0, which JSON writes as -0 or -0.0, into 0.0.
    return (values + 0.0).astype("<f8", copy=False).tobytes()


def _canonical(members: dict[str, Any]) -> bytes:
    text = _ENCODER.encode(members).encode("ascii")
    return b"%d:%b" % (len(text), text)
