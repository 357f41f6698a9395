"""The brain model solved a second time, with nothing in common with the shipped solution: 40 digits, real states.

The state (phi, phi') over one step of length h with alpha linear from a to b is advanced by the exponential of the
augmented matrix [[A, B, 0], [0, 0, 1/h], [0, 0, 0]] (the input and its slope as states), computed by mpmath.
"""

from __future__ import annotations

import mpmath
import numpy as np
from numpy.typing import NDArray

# Laksari et al. 2020, Table 2: decay rate [1/s], damped frequency [Hz].
TABLE_2 = {"x": (32, 22), "y": (38, 22), "z": (30, 25)}
DIGITS = 40


def exact_history(alpha: NDArray[np.float64], rate_hz: float, decay: float, damped_hz: float) -> list[mpmath.mpf]:
    """Brain angle of one axis at every sample [rad], for alpha linear between samples, from rest."""
    with mpmath.workdps(DIGITS):
        h = 1 / mpmath.mpf(rate_hz)
        stiffness = (2 * mpmath.pi * damped_hz) ** 2 + mpmath.mpf(decay) ** 2
        augmented = mpmath.matrix([[0, 1, 0, 0], [-stiffness, -2 * mpmath.mpf(decay), -1, 0], [0, 0, 0, 1], [0] * 4])
        e = mpmath.expm(augmented * h)
        # the slope (b - a)/h: column 2 weighs a, column 3 the slope
        now = [e[i, 3] / h for i in range(2)]
        last = [e[i, 2] - now[i] for i in range(2)]
        phi, rate = mpmath.mpf(0), mpmath.mpf(0)
        history = [phi]
        a = mpmath.mpf(float(alpha[0]))
        for value in alpha[1:].tolist():
            b = mpmath.mpf(value)
            phi, rate = (
                e[0, 0] * phi + e[0, 1] * rate + last[0] * a + now[0] * b,
                e[1, 0] * phi + e[1, 1] * rate + last[1] * a + now[1] * b,
            )
            history.append(phi)
            a = b
        return history


def exact_histories(alpha: NDArray[np.float64], rate_hz: float) -> NDArray[np.float64]:
    """All three axes, n x 3 [rad], rounded once at the end."""
    columns = [exact_history(alpha[:, i], rate_hz, *TABLE_2[axis]) for i, axis in enumerate("xyz")]
    return np.array([[float(value) for value in column] for column in columns]).T
