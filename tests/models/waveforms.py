"""Wave forms of our own that the tests of the science are made from, and the kinematics that hold them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from headimpact.criteria import evaluate
from headimpact.kinematics import HeadKinematics
from headimpact.recording import Recording, Signal

FloatArray = NDArray[np.float64]

# Shapes over 0 <= s <= 1, largest value 1.
SHAPES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "square": np.ones_like,
    "half_sine": lambda s: np.sin(np.pi * s),
    "haversine": lambda s: np.sin(np.pi * s) ** 2,
    "triangle": lambda s: 1 - np.abs(2 * s - 1),
}


def pulse(
    shape: str, duration_s: float, amplitude: float, rate_hz: float, samples: int, start_s: float = 0.02
) -> FloatArray:
    """One pulse in a record that is zero elsewhere; both of its ends are samples where the rate allows."""
    s = (np.arange(samples) / rate_hz - start_s) / duration_s
    inside = (s >= -1e-9) & (s <= 1 + 1e-9)
    return np.where(inside, amplitude * SHAPES[shape](np.clip(s, 0.0, 1.0)), 0.0)


def along(x: FloatArray, axis: int = 0) -> FloatArray:
    """A three-axis signal that moves along one axis only."""
    signal = np.zeros((x.size, 3))
    signal[:, axis] = x
    return signal


def linear(acceleration_g: FloatArray, rate_hz: float) -> HeadKinematics:
    """Kinematics with linear acceleration only."""
    return HeadKinematics(rate_hz, acceleration_g, None, None)


def rotational(alpha: FloatArray, rate_hz: float, omega: FloatArray | None = None) -> HeadKinematics:
    """Kinematics with rotation only."""
    return HeadKinematics(rate_hz, None, omega, alpha)


def values_of(kinematics: HeadKinematics) -> dict[str, FloatArray]:
    """The criteria of one impact: a value, or three."""
    return {key: found[..., 0] for key, found in evaluate(kinematics.motion).values.items()}


def burst(generator: np.random.Generator, samples: int, scale: float, rate_hz: float = 1000.0) -> FloatArray:
    """A smooth three-axis burst, n x 3: a few decaying sines that start and end near zero."""
    t = np.arange(samples) / rate_hz
    middle, width = t[-1] * 0.35, t[-1] * 0.12
    envelope = np.exp(-0.5 * ((t - middle) / width) ** 2)
    frequencies, phases = generator.uniform(5, 60, (3, 3)), generator.uniform(0, 2 * np.pi, (3, 3))
    weights = generator.normal(size=(3, 3))
    waves = np.sin(2 * np.pi * frequencies[:, :, None] * t + phases[:, :, None])
    return scale * envelope[:, None] * np.einsum("ak,akt->ta", weights, waves)


def impact(seed: int, samples: int = 100, rate_hz: float = 1000.0) -> HeadKinematics:
    """A made-up impact with all three signals."""
    generator = np.random.default_rng(seed)
    return HeadKinematics(
        rate_hz,
        burst(generator, samples, 40.0, rate_hz),
        burst(generator, samples, 15.0, rate_hz),
        burst(generator, samples, 2500.0, rate_hz),
    )


def recording(seed: int = 1, samples: int = 100, rate_hz: float = 1000.0, **changes: object) -> Recording:
    """A made-up recording of acceleration and angular velocity that draws no quality note, with changes."""
    generator = np.random.default_rng(seed)
    parts: dict[str, object] = {
        "linear_acceleration": Signal(burst(generator, samples, 30.0, rate_hz), "g", rate_hz),
        "angular_velocity": Signal(burst(generator, samples, 8.0, rate_hz), "rad/s", rate_hz),
    }
    return Recording(**{**parts, **changes})


def rotation_matrix(axis: FloatArray, angle_rad: float) -> FloatArray:
    """The matrix that turns vectors about an axis (Rodrigues)."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * cross @ cross
