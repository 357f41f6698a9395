"""Whole bodies that are taken as they are: what the documentation and the first start show."""

from __future__ import annotations

from math import pi, sin
from typing import Any

RATE_HZ = 1000
SAMPLES = 80
ONSET = 10
WIDTH = 12


def kinematics() -> dict[str, Any]:
    """A blow to the front in the sagittal plane, 65 g and 24 rad/s: half sines of 12 ms."""
    return {
        "constrained_plane": "sagittal",
        "pre_trigger_ms": ONSET,
        "linear_acceleration": {"unit": "g", "sample_rate_hz": RATE_HZ, "x": half_sine(60), "z": half_sine(-25)},
        "angular_velocity": {"unit": "rad/s", "sample_rate_hz": RATE_HZ, "y": half_sine(24)},
    }


def half_sine(peak: float) -> list[int]:
    """A half sine in whole numbers, short to print."""
    return [
        round(peak * sin(pi * (sample - ONSET) / WIDTH)) if ONSET <= sample <= ONSET + WIDTH else 0
        for sample in range(SAMPLES)
    ]


def score() -> dict[str, Any]:
    """A body of POST /v1/score."""
    return {"kinematics": kinematics(), "operating_points": [{"criterion": "bam", "sensitivity": 0.9}]}


def impact(external_id: str = "mg-0042/1763665445123") -> dict[str, Any]:
    """A body of POST /v1/impacts."""
    return {
        "external_id": external_id,
        "athlete": {"external_id": "p-17"},
        "occurred_at": "2026-11-20T19:04:05Z",
        "kinematics": kinematics(),
    }


def device() -> dict[str, Any]:
    """A body of PUT /v1/devices/{serial}: the sensor's x, y, z point to the left, back and up."""
    turned = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    return {
        "maker": "Example Instruments",
        "linear_acceleration_range_g": 200.0,
        "mounting": {"accelerometer": {"rotation": turned, "offset_mm": [70.0, 0.0, -60.0]}},
    }
