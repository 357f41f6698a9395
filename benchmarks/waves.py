"""Wave forms of our own for the benchmarks: smooth pulses with sensor-like noise, by a fixed seed."""

from __future__ import annotations

import numpy as np

from headimpact.kinematics import HeadKinematics, Motion, differentiate


def impact(seed: int, samples: int = 100, rate: float = 1000.0) -> HeadKinematics:
    """One impact of the size that football records: about 50 g and 20 rad/s, 30 ms into the record."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) / rate
    pulse = np.exp(-(((time - 0.03) / rng.uniform(0.004, 0.012)) ** 2))[:, None]
    swing = np.cumsum(pulse, axis=0) / pulse.sum()
    a = pulse * rng.uniform(-50, 50, 3) + rng.normal(0, 0.5, (samples, 3))
    w = swing * rng.uniform(-20, 20, 3) + rng.normal(0, 0.02, (samples, 3))
    return HeadKinematics(rate, a, w, differentiate(w, rate))


def block(impacts: list[HeadKinematics]) -> Motion:
    """Impacts of one length and rate side by side."""
    first = impacts[0].motion
    stack = np.ascontiguousarray(np.concatenate([k.motion.stack for k in impacts], axis=3))
    return Motion(first.sample_rate_hz, first.signals, stack)


def fresh(motion: Motion) -> Motion:
    """The same motion without anything computed from it: what each timed call starts from."""
    return Motion(motion.sample_rate_hz, motion.signals, motion.stack)
