"""A record as it is kept: a document of everything but its samples, the samples as arrays, and the way back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from headimpact.cut_offs import LowPass
from headimpact.quality import QualityNote
from headimpact.recording import AXES, SIGNALS, Mounting, Recording, Signal
from headimpact_service.ingest.record import ImpactRecord

FloatArray = NDArray[np.float64]
TIME = ".time_s"
"""Behind a signal's name, that of its stamps."""


def arrays(recording: Recording) -> dict[str, FloatArray]:
    """The samples and stamps of every signal, by name, as they were sent."""
    found: dict[str, FloatArray] = {}
    for name, signal in recording.signals():
        found[name] = signal.values
        if signal.time_s is not None:
            found[name + TIME] = signal.time_s
    return found


def describe(record: ImpactRecord) -> dict[str, Any]:
    """Everything about the record but its samples; with :func:`arrays` it gives the recording back bit for bit."""
    recording = record.recording
    return {
        "axes": recording.axes,
        "mounting": None if recording.mounting is None else _mounting(recording.mounting),
        "constrained_plane": recording.constrained_plane,
        "pre_trigger_ms": recording.pre_trigger_ms,
        "low_pass": {
            "name": recording.low_pass.name,
            "linear_acceleration": recording.low_pass.linear_acceleration,
            "angular_velocity": recording.low_pass.angular_velocity,
        },
        "fill_gaps": recording.fill_gaps,
        "signals": {name: _signal(signal) for name, signal in recording.signals()},
        "metadata": dict(record.metadata),
        "unscorable": list(record.unscorable),
        "notes": [asdict(note) for note in record.notes],
    }


def _mounting(mounting: Mounting) -> dict[str, Any]:
    return {
        "accelerometer_rotation": mounting.accelerometer_rotation.tolist(),
        "gyroscope_rotation": mounting.gyroscope_rotation.tolist(),
        "offset_m": mounting.offset_m.tolist(),
        "accelerometer_delay_s": mounting.accelerometer_delay_s,
        "gyroscope_delay_s": mounting.gyroscope_delay_s,
    }


def _signal(signal: Signal) -> dict[str, Any]:
    return {
        "unit": signal.unit,
        "sample_rate_hz": signal.sample_rate_hz,
        "samples": signal.values.shape[0],
        "declared_range": signal.declared_range,
    }


def rebuild_record(
    document: Mapping[str, Any], samples: Mapping[str, FloatArray], *, extra_criteria: tuple[str, ...] = ()
) -> ImpactRecord:
    """The record of a stored document and its samples, as far as a score depends on it."""
    return ImpactRecord(
        recording=rebuild(document, samples),
        notes=tuple(QualityNote(**note) for note in document["notes"]),
        unscorable=tuple(document["unscorable"]),
        extra_criteria=extra_criteria,
    )


def rebuild(document: Mapping[str, Any], samples: Mapping[str, FloatArray]) -> Recording:
    """The recording that :func:`describe` and :func:`arrays` were made of."""
    mounting = document["mounting"]
    return Recording(
        **{name: _rebuilt(name, document["signals"].get(name), samples) for name in SIGNALS},
        axes=document["axes"],
        mounting=None if mounting is None else _rebuilt_mounting(mounting),
        constrained_plane=document["constrained_plane"],
        low_pass=LowPass(**document["low_pass"]),
        pre_trigger_ms=document["pre_trigger_ms"],
        fill_gaps=document.get("fill_gaps", False),
    )


def _rebuilt_mounting(mounting: Mapping[str, Any]) -> Mounting:
    """A mounting; one that was stored before sensors could lag names no delays."""
    parts: dict[str, Any] = {
        name: np.array(part) if isinstance(part, list) else part for name, part in mounting.items()
    }
    return Mounting(**parts)


def _rebuilt(name: str, described: Mapping[str, Any] | None, samples: Mapping[str, FloatArray]) -> Signal | None:
    if described is None:
        return None
    return Signal(
        values=samples[name],
        unit=described["unit"],
        sample_rate_hz=described["sample_rate_hz"],
        time_s=samples.get(name + TIME),
        declared_range=described["declared_range"],
    )


def kinematics_document(document: Mapping[str, Any]) -> dict[str, Any]:
    """The kinematics as an answer shows them beside the score: how they were sent, without the samples."""
    mounting = document["mounting"]
    shown: dict[str, Any] = {
        "axes": document["axes"],
        "location": "head_cg" if mounting is None else "sensor",
        "pre_trigger_ms": document["pre_trigger_ms"],
        "filter": _filter(document["low_pass"]),
        "constrained_plane": document["constrained_plane"],
        "mounting": None if mounting is None else mounting_document(mounting),
        "fill_gaps": document.get("fill_gaps", False),
    }
    for name in SIGNALS:
        described = document["signals"].get(name)
        keys = ("unit", "sample_rate_hz", "samples")
        shown[name] = None if described is None else {key: described[key] for key in keys}
    return shown


def _filter(low_pass: Mapping[str, Any]) -> Any:  # noqa: ANN401 - a name or an object, as in a request
    if low_pass["name"] in {"paper", "none"}:
        return low_pass["name"]
    return {key: low_pass[key] for key in ("linear_acceleration", "angular_velocity")}


def mounting_document(mounting: Mapping[str, Any]) -> dict[str, Any]:
    """A mounting as requests write it."""
    sensors = ("accelerometer", "gyroscope")
    delays_ms = thousandfold(np.array([mounting.get(f"{name}_delay_s", 0.0) for name in sensors])).tolist()
    offset_mm = thousandfold(np.array(mounting["offset_m"], dtype=np.float64)).tolist()
    shown: dict[str, Any] = {
        "accelerometer": {"rotation": mounting["accelerometer_rotation"], "offset_mm": offset_mm},
        "gyroscope": {"rotation": mounting["gyroscope_rotation"]},
    }
    for name, delay_ms in zip(sensors, delays_ms, strict=True):
        if delay_ms:
            shown[name]["delay_ms"] = delay_ms
    return shown


def thousandfold(values: FloatArray) -> FloatArray:
    """Numbers that, divided by 1000, give `values` again: milli-units, as they were sent; the shortest of them."""
    exact = values * 1000.0
    found = exact
    for candidate in (np.nextafter(exact, -np.inf), np.nextafter(exact, np.inf), exact, np.round(exact, 9)):
        found = np.where(candidate / 1000.0 == values, candidate, found)
    return found


def raw_traces(document: Mapping[str, Any], samples: Mapping[str, FloatArray]) -> dict[str, Any]:
    """The signals as they were sent: the members of a request's kinematics."""
    return {
        name: None if (described := document["signals"].get(name)) is None else _raw(name, described, samples)
        for name in SIGNALS
    }


def _raw(name: str, described: Mapping[str, Any], samples: Mapping[str, FloatArray]) -> dict[str, Any]:
    stamps = samples.get(name + TIME)
    time_ms = None if stamps is None else thousandfold(stamps).tolist()
    rate = {"sample_rate_hz": described["sample_rate_hz"], "time_ms": time_ms}
    return {"unit": described["unit"], **rate, **axes_lists(samples[name])}


def axes_lists(values: FloatArray) -> dict[str, list[float]]:
    """Columns of n x 3 samples by axis."""
    return dict(zip(AXES, values.T.tolist(), strict=True))
