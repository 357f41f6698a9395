"""The four public recordings, read from a folder outside the repository: they are never committed.

The folder is named by HEADIMPACT_RECORDINGS; tests that need it are skipped, with the reason, where it is absent.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from headimpact.cut_offs import PAPER, LowPass
from headimpact.recording import Recording, Signal

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("HEADIMPACT_RECORDINGS", ROOT.parent / "shared" / "data"))

needs_recordings = pytest.mark.skipif(
    not FOLDER.is_dir(), reason=f"no recordings in {FOLDER}: set HEADIMPACT_RECORDINGS to the folder that holds them"
)


def load(name: str, low_pass: LowPass = PAPER) -> Recording:
    """A recording by the name that tests/data/recordings.json gives it."""
    return LOADERS[name](low_pass)


def _table(name: str) -> np.ndarray:
    return np.loadtxt(FOLDER / f"{name}.csv", delimiter=",", skiprows=1)


def _nhtsa(low_pass: LowPass) -> Recording:
    """Crash test 10146, driver's head: g and deg/s at 10 kHz from 50 ms before the trigger, SAE J211 axes."""

    def channel(number: str) -> list[float]:
        lines = (FOLDER / "nhtsa_v10146_driver" / f"v10146.{number}").read_text().splitlines()
        return [float(line.split("\t")[1]) for line in lines if "\t" in line]

    acceleration = np.array([channel(n) for n in ("001", "002", "003")]).T
    velocity = np.array([channel(n) for n in ("101", "102", "103")]).T
    return Recording(
        Signal(acceleration, "g", 10_000.0),
        Signal(velocity, "deg/s", 10_000.0),
        axes="sae_j211",
        low_pass=low_pass,
        pre_trigger_ms=50.0,
    )


def _headsport(low_pass: LowPass) -> Recording:
    """A rugby event of an instrumented mouthguard (HEADSport, Tierney et al., CC-BY 4.0): 3200 Hz, g, rad/s."""
    x = _table("headsport_rugby_img_raw")
    return Recording(Signal(x[:, 4:7], "g", 3200.0), Signal(x[:, 1:4], "rad/s", 3200.0), low_pass=low_pass)


def _camlab(low_pass: LowPass) -> Recording:
    """A finite-element input with angular acceleration supplied (CamLab head model, Apache-2.0): 10 kHz."""
    x = _table("camlab_example_impact0")
    return Recording(
        Signal(x[:, 1:4], "g", 10_000.0),
        Signal(x[:, 4:7], "rad/s", 10_000.0),
        Signal(x[:, 7:10], "rad/s^2", 10_000.0),
        low_pass=low_pass,
    )


def _kinmet(low_pass: LowPass) -> Recording:
    """Microsecond stamps with jitter, g, deg/s (KINMET toolkit, MIT)."""
    x = _table("kinmet_example1")
    time_s = (x[:, 0] - x[0, 0]) * 1e-6
    return Recording(
        Signal(x[:, 1:4], "g", time_s=time_s), Signal(x[:, 4:7], "deg/s", time_s=time_s), low_pass=low_pass
    )


LOADERS = {
    "nhtsa_v10146_driver": _nhtsa,
    "headsport_rugby_img_raw": _headsport,
    "camlab_example_impact0": _camlab,
    "kinmet_example1": _kinmet,
}
