"""Files and bodies of our own making that the tests of the ingest layer send."""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from headimpact_service.errors import Problem
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.upload import read_upload

ROOT = Path(__file__).parents[3]
RECORDINGS = Path(os.environ.get("HEADIMPACT_RECORDINGS", ROOT.parent / "shared" / "data"))
needs_recordings = pytest.mark.skipif(
    not RECORDINGS.is_dir(), reason=f"no recordings in {RECORDINGS}: set HEADIMPACT_RECORDINGS to their folder"
)

GENERIC = "t_s,ax_g,ay_g,az_g,wx_rad_s,wy_rad_s,wz_rad_s"


def half_sine(samples: int = 40, peak: float = 30.0, start: int = 10, length: int = 12) -> np.ndarray:
    """One half-sine pulse in a record that is zero elsewhere."""
    wave = np.zeros(samples)
    wave[start : start + length] = peak * np.sin(np.pi * np.arange(length) / length)
    return wave


def six_axis(samples: int = 40) -> np.ndarray:
    """Linear acceleration and angular velocity of our own: pulses of different heights, n x 6."""
    return np.stack([half_sine(samples, peak) for peak in (30.0, -12.0, 7.5, 8.0, 20.0, -4.0)], axis=1)


def signal(unit: str, columns: np.ndarray, **rate: Any) -> dict[str, Any]:
    """The JSON of one signal."""
    x, y, z = columns.T.tolist()
    return {"unit": unit, **(rate or {"sample_rate_hz": 1000}), "x": x, "y": y, "z": z}


def body(**changes: Any) -> dict[str, Any]:
    """The JSON of an impact, with members changed or, where None, left out."""
    samples = six_axis()
    whole: dict[str, Any] = {
        "external_id": "mg-0042/1763665445123",
        "athlete": {"external_id": "p-17"},
        "occurred_at": "2026-11-20T19:04:05.123Z",
        "device": {"serial": "mg-0042"},
        "context": {"session_id": "g-2026-11-20", "activity": "game", "sport": "american_football", "position": "LB"},
        "kinematics": kinematics(samples),
    }
    return {name: value for name, value in (whole | changes).items() if value is not None}


def kinematics(samples: np.ndarray, **changes: Any) -> dict[str, Any]:
    """The JSON of kinematics."""
    whole: dict[str, Any] = {
        "axes": "anatomical",
        "location": "head_cg",
        "pre_trigger_ms": 10,
        "filter": "paper",
        "linear_acceleration": signal("g", samples[:, :3]),
        "angular_velocity": signal("rad/s", samples[:, 3:]),
        "angular_acceleration": None,
    }
    return whole | changes


def encoded(document: Any) -> bytes:
    """JSON text; NaN and Infinity are written as some clients do."""
    return json.dumps(document).encode()


def csv_text(
    samples: np.ndarray | None = None,
    heading: str = GENERIC,
    rate_hz: float = 1000.0,
    delimiter: str = ",",
    before: Mapping[str, str] | None = None,
) -> str:
    """A CSV with a time column and the samples; `before` are columns of one value each."""
    samples = six_axis() if samples is None else samples
    labels = before or {}
    lines = [delimiter.join([*labels, *heading.split(",")])]
    for index, row in enumerate(samples.tolist()):
        lines.append(delimiter.join([*labels.values(), repr(index / rate_hz), *map(repr, row)]))
    return "\n".join(lines) + "\n"


def zipped(files: Mapping[str, str | bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A zip archive."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def read(data: bytes | str, **options: Any) -> list[ImpactRecord | Problem]:
    """Everything that an upload gives."""
    data = data.encode() if isinstance(data, str) else data
    return list(read_upload(data, ImportOptions(**options)))


def outcome(data: bytes | str, **options: Any) -> list[ImpactRecord | Problem]:
    """Everything that an upload gives, its own problem among it; any other exception is a fault of the reader."""
    try:
        return read(data, **options)
    except Problem as problem:
        return [problem]


def statuses(items: list[ImpactRecord | Problem]) -> set[int]:
    """The statuses of the problems."""
    return {item.status for item in items if isinstance(item, Problem)}


def one(data: bytes | str, **options: Any) -> ImpactRecord:
    """The one impact of an upload."""
    [record] = read(data, **options)
    assert isinstance(record, ImpactRecord), record.as_dict()
    return record


def refused(data: bytes | str, **options: Any) -> Problem:
    """The problem of the file, or of the one impact in it."""
    try:
        [problem] = read(data, **options)
    except Problem as raised:
        return raised
    assert isinstance(problem, Problem)
    return problem


def codes(problem: Problem) -> list[tuple[str | None, str]]:
    """Where a problem's errors are, and which rules they break."""
    return [(error.pointer if error.pointer is not None else error.parameter, error.code) for error in problem.errors]
