"""The paper's Figure 8: risk over idealised half-sine pulses of angular acceleration, equal in the three axes.

`python tests/models/figure8.py figure8.png` draws it; test_figure8.py checks the shapes of its contours.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from headimpact.kinematics import HeadKinematics, running_integral
from headimpact.preparation import Preparation
from headimpact.risk import LAKSARI_2020, linear_predictor_of
from headimpact.scoring import score_many

FloatArray = NDArray[np.float64]

CRITERIA = ("bam", "peak_angular_acceleration", "bric")
DURATIONS_S = np.geomspace(0.0005, 2.0, 37)
AMPLITUDES = np.geomspace(100.0, 100_000.0, 4)  # rad/s^2
FREE_VIBRATION_S = 0.06


@dataclass(frozen=True)
class RiskSurface:
    """Linear predictors of each criterion, durations x amplitudes; p = 1/(1 + exp(e))."""

    predictors: dict[str, FloatArray]

    def contour(self, key: str, probability: float) -> FloatArray:
        """The amplitude that reaches a probability, at each duration [rad/s^2].

        For these pulses every criterion, and so its linear predictor, is proportional to the amplitude: the line
        through two amplitudes is exact.
        """
        e = self.predictors[key]
        slope = (e[:, -1] - e[:, 0]) / (AMPLITUDES[-1] - AMPLITUDES[0])
        return AMPLITUDES[0] + (linear_predictor_of(probability) - e[:, 0]) / slope


def half_sine(duration_s: float, amplitude: float) -> Preparation:
    """One pulse and the free vibration after it, finely sampled."""
    rate_hz = min(max(100.0 / duration_s, 4000.0), 100_000.0)
    t = np.arange(round((duration_s + FREE_VIBRATION_S) * rate_hz) + 1) / rate_hz
    wave = np.where(t <= duration_s, amplitude * np.sin(np.pi * np.minimum(t / duration_s, 1.0)), 0.0)
    alpha = np.asfortranarray(np.repeat(wave[:, None], 3, axis=1))
    return Preparation.of(HeadKinematics(rate_hz, None, running_integral(alpha, rate_hz), alpha))


def velocity_change(duration_s: FloatArray, amplitude: FloatArray) -> FloatArray:
    """The area of a half-sine pulse [rad/s]."""
    return 2 / np.pi * duration_s * amplitude


@cache
def surface() -> RiskSurface:
    """The shipped model over the grid."""
    predictors = {key: np.empty((DURATIONS_S.size, AMPLITUDES.size)) for key in CRITERIA}
    for row, duration_s in enumerate(DURATIONS_S):
        scores = score_many([half_sine(float(duration_s), float(amplitude)) for amplitude in AMPLITUDES])
        for column, found in enumerate(scores):
            for key in CRITERIA:
                predictors[key][row, column] = found.criteria[key].linear_predictor
    return RiskSurface(predictors)


def draw(path: str) -> None:
    """Figure 8's three panels over duration, and over the change in velocity: risk in colour, three contours."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    titles = {"bam": "A) BAM", "peak_angular_acceleration": "B) peak angular acceleration", "bric": "C) BrIC"}
    figure, axes = plt.subplots(2, 3, figsize=(15, 9), sharey=True, layout="constrained")
    found = surface()
    amplitudes, fine = np.linspace(0, 12_000, 240), np.geomspace(DURATIONS_S[0], DURATIONS_S[-1], 800)
    for column, key in enumerate(CRITERIA):
        e = found.predictors[key]
        slope = (e[:, -1] - e[:, 0]) / (AMPLITUDES[-1] - AMPLITUDES[0])
        # between the durations of the grid, for a smooth picture
        slope = np.exp(np.interp(np.log(fine), np.log(DURATIONS_S), np.log(-slope)))
        line = LAKSARI_2020.curves[key].b0 - slope[:, None] * amplitudes
        risk = 1 / (1 + np.exp(np.clip(line, -700, 700)))
        durations, levels = np.broadcast_arrays(fine[:, None], amplitudes[None, :])
        for ax, of_duration in zip(axes[:, column], (lambda t, _: t * 1000, velocity_change), strict=True):
            x = of_duration(durations, levels)
            mesh = ax.pcolormesh(x, levels, risk, cmap="RdYlGn_r", shading="gouraud")
            for probability, style in ((0.1, ":"), (0.5, "-"), (0.9, "--")):
                contour = found.contour(key, probability)
                ax.plot(of_duration(DURATIONS_S, contour), contour, style, color="black", label=f"{probability:.0%}")
            ax.legend(title="risk", loc="upper right")
        axes[0, column].set(title=titles[key], xlabel="duration [ms]", xlim=(0.5, 100), ylim=(0, 12_000))
        axes[1, column].set(xlabel="change in angular velocity [rad/s]", xlim=(0, 100))
    for ax in axes[:, 0]:
        ax.set_ylabel("amplitude [rad/s$^2$]")
    figure.colorbar(mesh, ax=axes, label="probability of injury")
    figure.savefig(path, dpi=100)
    plt.close(figure)


if __name__ == "__main__":
    draw(sys.argv[1])
