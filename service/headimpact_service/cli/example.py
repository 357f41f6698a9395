"""An example call that works when pasted: a whole small impact, inline."""

from __future__ import annotations

from math import pi, sin

RATE_HZ = 1000
SAMPLES = 80
ONSET = 10
WIDTH = 12


def curl(address: str, key: str) -> str:
    """One command for a POSIX shell."""
    return f"""\
curl -sS '{address}/v1/impacts' -H 'Authorization: Bearer {key}' -H 'Content-Type: application/json' -d '
{{"external_id": "first-impact", "athlete": {{"external_id": "p-17"}}, "occurred_at": "2026-11-20T19:04:05Z",
 "kinematics": {{"constrained_plane": "sagittal", "pre_trigger_ms": {ONSET},
  "linear_acceleration": {{"unit": "g", "sample_rate_hz": {RATE_HZ},
   "x": {_pulse(60)},
   "z": {_pulse(-25)}}},
  "angular_velocity": {{"unit": "rad/s", "sample_rate_hz": {RATE_HZ},
   "y": {_pulse(24)}}}}}}}'"""


def _pulse(peak: float) -> str:
    """A half sine of 12 ms, as a JSON list of whole numbers."""
    heights = [
        round(peak * sin(pi * (sample - ONSET) / WIDTH)) if ONSET <= sample <= ONSET + WIDTH else 0
        for sample in range(SAMPLES)
    ]
    return "[" + ",".join(map(str, heights)) + "]"
