"""DAMAGE solved a second time, by a general solver of differential equations."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from headimpact.kinematics import HeadKinematics


def damage_by_ode(kinematics: HeadKinematics) -> tuple[float, float]:
    """DAMAGE by SciPy's DOP853: at the samples, and densely between them.

    Gabler, Crandall & Panzer 2019: M d'' + C d' + K d = M alpha, C = a1 K, DAMAGE = 2.9903 max ||d||.
    """
    stiffness = np.array([[32142.0 + 1636.3, 0.0, -1636.3], [0.0, 23493.0, 0.0], [-1636.3, 0.0, 1636.3 + 16935.0]])
    damping = 5.9148e-3 * stiffness
    alpha, rate = kinematics.angular_acceleration, kinematics.sample_rate_hz
    state, crest, sampled = np.zeros(6), 0.0, 0.0
    for k in range(alpha.shape[0] - 1):

        def motion(t: float, y: np.ndarray, k: int = k) -> np.ndarray:
            push = alpha[k] + (alpha[k + 1] - alpha[k]) * t * rate
            return np.concatenate((y[3:], push - damping @ y[3:] - stiffness @ y[:3]))

        step = solve_ivp(motion, (0, 1 / rate), state, method="DOP853", rtol=1e-11, atol=1e-14, dense_output=True)
        between = step.sol(np.linspace(0, 1 / rate, 21))
        crest = max(crest, float(np.linalg.norm(between[:3], axis=0).max()))
        state = step.y[:, -1]
        sampled = max(sampled, float(np.linalg.norm(state[:3])))
    return 2.9903 * sampled, 2.9903 * crest
