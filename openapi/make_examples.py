"""The examples of this folder: wave forms of our own, never a recording.

    uv run python openapi/make_examples.py

Half sines of head motion at 1 kHz with a little of everything a device adds: a trigger after 10 ms, a rebound, signals
of two rates, stamps that jitter. Nothing random: the same files come out each time (a test compares them).
"""

from __future__ import annotations

import json
import sys
from math import exp, pi, sin
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent / "examples"
ONSET_MS = 10.0


def pulse(time_ms: float, peak: float, width_ms: float) -> float:
    """A half sine that begins at the trigger, and a weaker, slower rebound behind it."""
    since = time_ms - ONSET_MS
    if since < 0:
        return 0.0
    if since <= width_ms:
        return peak * sin(pi * since / width_ms)
    return -0.2 * peak * sin(pi * (since - width_ms) / (3 * width_ms)) * exp(-(since - width_ms) / (3 * width_ms))


def axes(peaks: tuple[float, float, float], width_ms: float, stamps_ms: list[float]) -> dict[str, list[float]]:
    """Samples at the stamps, to the digits of a device."""
    return {
        axis: [round(pulse(stamp, peak, width_ms), 3) + 0.0 for stamp in stamps_ms]
        for axis, peak in zip("xyz", peaks, strict=True)
    }


def uniform(count: int, rate_hz: float) -> list[float]:
    """Stamps from zero on."""
    return [1000.0 * index / rate_hz for index in range(count)]


def motion() -> dict[str, Any]:
    """A head impact of about 56 g and 23 rad/s, as a mouthguard gives it."""
    stamps = uniform(100, 1000)
    return {
        "axes": "anatomical",
        "location": "head_cg",
        "pre_trigger_ms": 10,
        "filter": "paper",
        "linear_acceleration": {"unit": "g", "sample_rate_hz": 1000, **axes((50, -22, 12), 12, stamps)},
        "angular_velocity": {"unit": "rad/s", "sample_rate_hz": 1000, **axes((6, 20, -9), 25, stamps)},
        "angular_acceleration": None,
    }


def sensor_motion() -> dict[str, Any]:
    """The same from a sensor behind the teeth: other units, axes and rates, stamps that jitter, a mounting."""
    jittered = [round(stamp + 0.05 * sin(stamp), 4) for stamp in uniform(100, 1000)]
    turned = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    return {
        "axes": "sae_j211",
        "location": "sensor",
        "mounting": {
            "accelerometer": {"rotation": turned, "offset_mm": [70.0, 0.0, 60.0]},
            "gyroscope": {"rotation": turned},
        },
        "pre_trigger_ms": 10,
        "filter": {"linear_acceleration": "CFC180", "angular_velocity": 184},
        "linear_acceleration": {"unit": "m/s^2", "time_ms": jittered, **axes((200, 480, -110), 12, jittered)},
        "angular_velocity": {
            "unit": "deg/s",
            "sample_rate_hz": 2000,
            **axes((1100, -340, 500), 25, uniform(200, 2000)),
        },
    }


def impact(external_id: str, kinematics: dict[str, Any], **fields: object) -> dict[str, Any]:
    """A body of POST /v1/impacts."""
    return {
        "external_id": external_id,
        "athlete": {"external_id": "p-17"},
        "occurred_at": "2026-11-20T19:04:05.123Z",
        "device": {"serial": "mg-0042"},
        "context": {
            "session_id": "g-2026-11-20",
            "activity": "game",
            "sport": "american_football",
            "position": "LB",
        },
        "kinematics": kinematics,
        **fields,
    }


def planar() -> dict[str, Any]:
    """A sled test in the sagittal plane: what the plane holds still is left out."""
    signals = axes((40, 0, -18), 20, uniform(120, 1000))
    turning = axes((0, 17, 0), 40, uniform(120, 1000))
    return {
        "constrained_plane": "sagittal",
        "linear_acceleration": {"unit": "g", "sample_rate_hz": 1000, "x": signals["x"], "z": signals["z"]},
        "angular_velocity": {"unit": "rad/s", "sample_rate_hz": 1000, "y": turning["y"]},
    }


def table() -> str:
    """A CSV of one impact, in columns that the import's mapping names."""
    stamps = uniform(100, 1000)
    linear, angular = axes((50, -22, 12), 12, stamps), axes((6, 20, -9), 25, stamps)
    columns = [stamps, *linear.values(), *angular.values()]
    rows = [",".join(f"{value:g}" for value in row) for row in zip(*columns, strict=True)]
    return "\n".join(["time,front,left,up,roll,pitch,yaw", *rows]) + "\n"


MAPPING = {
    "time": {"column": "time", "unit": "ms"},
    "pre_trigger_ms": 10,
    "linear_acceleration": {"unit": "g", "x": "front", "y": "left", "z": "up"},
    "angular_velocity": {"unit": "rad/s", "x": "roll", "y": "pitch", "z": "yaw"},
}


def documents() -> dict[str, Any]:
    """Every example by the name of its file."""
    asked = [{"criterion": "bam", "sensitivity": 0.9}, {"criterion": "hic15", "threshold": 0.01}]
    many = [impact(f"mg-0042/{number}", motion(), occurred_at=f"2026-11-20T19:{number:02}:00Z") for number in range(3)]
    return {
        "score.json": {"kinematics": motion(), "operating_points": asked},
        "score-with-traces.json": {
            "kinematics": planar(),
            "include": ["traces"],
            "extra_criteria": ["damage"],
        },
        "impact.json": impact("mg-0042/1763665445123", motion()),
        "impact-sensor.json": impact("mg-0042/1763665445124", sensor_motion()),
        "athlete.json": {
            "external_id": "p-17",
            "tags": ["varsity"],
            "sport": "american_football",
            "level": "collegiate",
            "position": "LB",
            "sex": "male",
            "birth_year": 2004,
            "time_zone": "America/New_York",
            "consent": "granted",
        },
        "device.json": {
            "maker": "Example Instruments",
            "model": "MG-2",
            "firmware": "4.1",
            "linear_acceleration_range_g": 200,
            "angular_velocity_range_rad_s": 34.9,
            "trigger_threshold_g": 8,
            "mounting": sensor_motion()["mounting"],
        },
        "settings.json": {"incidence": 0.0055, "operating_points": [{"criterion": "bam", "sensitivity": 0.9}]},
        "key.json": {"name": "sideline gate", "scopes": ["score", "impacts:write"], "mode": "live"},
        "new-score.json": {"model": "laksari-2020", "extra_criteria": ["ubric_mps"]},
        "mapping.json": MAPPING,
        "import.csv": table(),
        "import.ndjson": "".join(json.dumps(body, separators=(",", ":")) + "\n" for body in many),
    }


def files() -> dict[str, str]:
    """Every example's text by the name of its file; a list of samples stays on one line."""
    return {name: value if isinstance(value, str) else _text(value) for name, value in documents().items()}


def _text(value: object, indent: int = 0) -> str:
    return _node(value, indent) + "\n"


def _node(value: object, indent: int) -> str:
    inner = " " * (indent + 1)
    if isinstance(value, dict) and value:
        members = (f"{inner}{json.dumps(name)}: {_node(member, indent + 1)}" for name, member in value.items())
        return "{\n" + ",\n".join(members) + "\n" + " " * indent + "}"
    return json.dumps(value, ensure_ascii=False)


def main() -> None:
    """Write the files."""
    FOLDER.mkdir(exist_ok=True)
    for name, text in files().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
        sys.stdout.write(f"{FOLDER / name}\n")


if __name__ == "__main__":
    main()
