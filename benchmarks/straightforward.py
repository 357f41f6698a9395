"""The thirteen criteria as a competent engineer would first write them with SciPy: the peer for one impact.

Vectorised where that comes naturally, a library call per step, nothing shared between criteria and nothing kept
between impacts.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import cumulative_trapezoid, solve_ivp, trapezoid
from scipy.signal import lsim

INERTIA = np.array([0.016, 0.024, 0.022])
DECAY = np.array([32.0, 38.0, 30.0])
DAMPED = 2 * np.pi * np.array([22.0, 22.0, 25.0])
TABLE_3 = {
    "peak_angular_acceleration": (8.446, [-1.63e-4, 5.17e-5, -0.0014]),
    "delta_angular_velocity": (10.69, [-0.145, -0.0046, -0.172]),
    "bric": (10.57, [-11.10]),
    "ric": (5.559, [-4.3e-8]),
    "peak_linear_acceleration": (9.041, [-0.071, -0.071, -0.031]),
    "hic15": (6.071, [-0.0072]),
    "hic36": (5.928, [-0.0056]),
    "si": (5.673, [-0.0024]),
    "hip": (5.549, [-4.11e-5]),
    "hip3d": (5.882, [-1.43e-5, -2.26e-4, 1.50e-4]),
    "gambit": (7.501, [-9.599]),
    "vtcp": (5.910, [-5.126]),
    "bam": (9.845, [-28.84, -10.23, -37.95]),
}


def windowed_maximum(x, rate, limit):
    """HIC's form: a loop over window lengths, vectorised over starts."""
    integral = cumulative_trapezoid(x, dx=1 / rate, initial=0)
    best = 0.0
    for k in range(1, min(int(limit * rate + 1e-6), len(x) - 1) + 1):
        duration = k / rate
        best = max(best, np.max(duration * ((integral[k:] - integral[:-k]) / duration) ** 2.5))
    return best


def brain_angles(alpha, rate):
    """Each oscillator through scipy.signal.lsim, which is exact for piecewise-linear input."""
    time = np.arange(len(alpha)) / rate
    peaks = []
    for i in range(3):
        system = ([-1.0], [1.0, 2 * DECAY[i], DAMPED[i] ** 2 + DECAY[i] ** 2])
        _, angle, _ = lsim(system, alpha[:, i], time)
        peaks.append(np.max(np.abs(angle)))
    return np.array(peaks)


def brain_angles_by_integration(alpha, rate):
    """The same equations of motion through scipy.integrate.solve_ivp, as they are often solved."""
    time = np.arange(len(alpha)) / rate
    peaks = []
    for i in range(3):
        squared, damping = DAMPED[i] ** 2 + DECAY[i] ** 2, 2 * DECAY[i]

        def motion(t, state, i=i, squared=squared, damping=damping):
            return [state[1], -np.interp(t, time, alpha[:, i]) - damping * state[1] - squared * state[0]]

        found = solve_ivp(motion, (0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-6, atol=1e-9, max_step=1 / rate)
        peaks.append(np.max(np.abs(found.y[0])))
    return np.array(peaks)


def criteria(a, w, alpha, rate, angles=brain_angles):
    """Values of the thirteen criteria: a in g, w in rad/s, alpha in rad/s^2, n x 3 each."""
    dt = 1 / rate
    resultant = np.linalg.norm(a, axis=1)
    angular = np.linalg.norm(alpha, axis=1)
    metric = a * 9.80665
    power = 4.5 * metric * cumulative_trapezoid(metric, dx=dt, axis=0, initial=0)
    power += INERTIA * alpha * cumulative_trapezoid(alpha, dx=dt, axis=0, initial=0)
    pla, paa = resultant.max(), angular.max()
    return {
        "peak_angular_acceleration": np.abs(alpha).max(axis=0),
        "delta_angular_velocity": np.ptp(w, axis=0),
        "bric": np.linalg.norm(np.abs(w).max(axis=0) / [66.2, 59.1, 44.2]),
        "ric": windowed_maximum(angular, rate, 0.036),
        "peak_linear_acceleration": np.abs(a).max(axis=0),
        "hic15": windowed_maximum(resultant, rate, 0.015),
        "hic36": windowed_maximum(resultant, rate, 0.036),
        "si": trapezoid(resultant**2.5, dx=dt),
        "hip": power.sum(axis=1).max(),
        "hip3d": power.max(axis=0),
        "gambit": np.max(np.sqrt((angular / 25000) ** 2 + (resultant / 250) ** 2)),
        "vtcp": 1 / (1 + np.exp(10.2 - 0.0433 * pla - 0.000873 * paa + 9.2e-7 * pla * paa)),
        "bam": angles(alpha, rate),
    }


def probabilities(values):
    """Table 3 applied to them."""
    return {key: 1 / (1 + np.exp(b0 + np.dot(np.atleast_1d(values[key]), b))) for key, (b0, b) in TABLE_3.items()}
