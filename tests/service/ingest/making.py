"""A file of our own making for every preset: one motion of the head, as each device or laboratory would write it."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from ingest_files import half_sine, zipped
from laboratory import DTS_COLUMNS, dts, iso_mme

from headimpact.kinematics import STANDARD_GRAVITY, differentiate

PEAKS = {"linear_acceleration": (30.0, -12.0, 7.5), "angular_velocity": (8.0, 20.0, -4.0)}
"""Of the motion, in g and rad/s, in the axes of the file."""


@dataclass(frozen=True)
class Made:
    """A file, what is sent beside it, and what it must be read as."""

    data: bytes
    filename: str
    fields: dict[str, str] = field(default_factory=dict)
    j211: bool = False
    """Whether the file's axes are those of SAE J211: y and z then come out turned."""
    content_type: str = "text/csv"


def motion(samples: int = 160, rate_hz: float = 3200.0, start: int = 32) -> dict[str, np.ndarray]:
    """Acceleration [g], velocity [rad/s] and its derivative [rad/s^2], n x 3; half sines of 12 samples and more."""
    length = max(12, round(0.012 * rate_hz))
    waves = {
        name: np.stack([half_sine(samples, peak, start, length) for peak in peaks], axis=1)
        for name, peaks in PEAKS.items()
    }
    return waves | {"angular_acceleration": differentiate(waves["angular_velocity"], rate_hz)}


def table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    """A CSV."""
    text = io.StringIO()
    csv.writer(text).writerows([headings, *rows])
    return text.getvalue().encode()


def columns(headings: Sequence[str], parts: Sequence[np.ndarray]) -> bytes:
    """A CSV of number columns."""
    return table(headings, np.column_stack(parts).tolist())


def resultant(values: np.ndarray) -> np.ndarray:
    """The norm of each row."""
    return np.linalg.norm(values, axis=1)


def prevent() -> Made:
    """Metres per second squared; times from 10 ms before the trigger; resultants; the facts are in the name."""
    found = motion()
    a, w, alpha = (
        found["linear_acceleration"] * STANDARD_GRAVITY,
        found["angular_velocity"],
        found["angular_acceleration"],
    )
    names = [f"{q}.{axis}.{unit}" for q, unit in _PREVENT for axis in "XYZR"]
    blocks = [np.column_stack([values, resultant(values)]) for values in (alpha, w, a)]
    data = columns(["t.sec", *names], [(np.arange(160) - 32) / 3200.0, *blocks])
    return Made(data, "MG0042-17-2026-11-20T19_04_05.123Z.csv")


_PREVENT = (("PAA", "radsec^2"), ("PAV", "radsec"), ("PLA", "msec^2"))


def prevent_underscored() -> Made:
    """The same device's other spelling, in milliseconds."""
    found = motion()
    a, w, alpha = (
        found["linear_acceleration"] * STANDARD_GRAVITY,
        found["angular_velocity"],
        found["angular_acceleration"],
    )
    names = [f"{q}_{axis}_{unit.replace('^', '_')}" for q, unit in _PREVENT for axis in "XYZ"]
    return Made(columns(["T.ms", *names], [(np.arange(160) - 32) / 3.2, alpha, w, a]), "event.csv")


def swa() -> Made:
    """Two impacts in one file, no times, a date and a time of day that a spreadsheet has broken."""
    found = motion(104, 1000.0, 10)
    headings = ["Date", "Time", "Session ID", "Player ID", "Sensor ID", "Impact ID", "Sample Num"]
    for name, unit in (("Linear Acc", "g"), ("Angular Vel", "rad/s"), ("Angular Acc", "rad/s2")):
        headings += [f"{name} {axis} {unit}" for axis in ("x", "y", "z", "Mag")]
    rows = []
    for impact, factor in ((1, 1.0), (2, 0.5)):
        parts = [factor * found[name] for name in ("linear_acceleration", "angular_velocity", "angular_acceleration")]
        numbers = np.column_stack([np.column_stack([part, resultant(part)]) for part in parts])
        rows += [["20/11/2026", "37:10.6", "S9", "P1", "D3", impact, n, *row] for n, row in enumerate(numbers.tolist())]
    return Made(table(headings, rows), "export.csv", {"sample_rate_hz": "1000"})


LINX = [
    *("Time (sec)", "X Axis Linear Accel (g)", "Y Axis Linear Accel (g)", "Z Axis Linear Accel (g)"),
    *("Time (sec)", "X Rotational Velocity (rad/s)", "Y Rotational Velocity (rad/s)", "Z Rotational Velocity (rad/s)"),
]


def linx_rows() -> list[list[object]]:
    """An event: 80 rows at 1600 Hz beside 100 at 2000 Hz, the first of each corrupt."""
    a = motion(80, 1600.0, 16)["linear_acceleration"]
    w = motion(100, 2000.0, 20)["angular_velocity"]
    a[0], w[0] = 190.0, -30.0
    left = [[i / 1600.0, *a[i].tolist()] if i < 80 else ["", "", "", ""] for i in range(100)]
    return [[*left[i], i / 2000.0, *w[i].tolist()] for i in range(100)]


def linx_ias() -> Made:
    """The blocks of one sheet as CSV."""
    return Made(table(LINX, linx_rows()), "event 1.csv")


def athlete_intelligence() -> Made:
    """No column of times: the rate comes beside the file."""
    found = motion(100, 1000.0, 20)
    headings = [f"{name} {axis} ({unit})" for name, unit in _ATHLETE for axis in "XYZ"]
    parts = [found[name] for name in ("linear_acceleration", "angular_acceleration", "angular_velocity")]
    return Made(columns(headings, parts), "impact.csv", {"sample_rate_hz": "1000"})


_ATHLETE = (("Linear Accel", "g"), ("Rotational Accel", "rad/s^2"), ("Rotational Vel", "rad/s"))


def biocore() -> Made:
    """Metres per second squared; the headings name no units, so the preset is named."""
    found = motion(100, 1000.0, 20)
    headings = ["time_ms", *(f"{name}_{axis}" for name in ("Ah", "ALP", "W") for axis in "xyz")]
    a, alpha, w = (
        found["linear_acceleration"] * STANDARD_GRAVITY,
        found["angular_acceleration"],
        found["angular_velocity"],
    )
    return Made(columns(headings, [np.arange(100.0), a, alpha, w]), "b.csv", {"preset": "biocore"})


def imperial() -> Made:
    """Neither headings nor preset know the units: a mapping gives them."""
    found = motion(100, 1000.0, 20)
    headings = ["t(ms)", *(f"{name}{axis}" for name in ("LinAcc", "RotVel", "RotAcc") for axis in "XYZ")]
    parts = [found[name] for name in ("linear_acceleration", "angular_velocity", "angular_acceleration")]
    units = (
        '{"linear_acceleration": {"unit": "g"}, "angular_velocity": {"unit": "rad/s"},'
        ' "angular_acceleration": {"unit": "rad/s^2"}}'
    )
    data = columns(headings, [np.arange(100.0), *parts])
    return Made(data, "i.csv", {"preset": "imperial", "mapping": units})


def headsport() -> Made:
    """Gyroscope first; times from the record's start."""
    found = motion()
    headings = ["t_s", *(f"G{axis}_rad_s" for axis in "XYZ"), *(f"A{axis}_g" for axis in "XYZ")]
    parts = [np.arange(160) / 3200.0, found["angular_velocity"], found["linear_acceleration"]]
    return Made(columns(headings, parts), "raw.csv")


def generic_six_axis() -> Made:
    """Degrees per second, any order."""
    found = motion(100, 1000.0, 20)
    headings = ["Time (ms)", *(f"gyro {axis} (deg/s)" for axis in "zyx"), *(f"accel_{axis}_g" for axis in "xyz")]
    parts = [np.arange(100.0), np.degrees(found["angular_velocity"][:, ::-1]), found["linear_acceleration"]]
    return Made(columns(headings, parts), "six.csv")


def microseconds() -> Made:
    """Stamps in microseconds after hours, with jitter; misspelt."""
    stamps = 26_623_464_000 + np.arange(100) * 1000 + np.resize([0, 60, -40], 100)
    found = motion(100, 1000.0, 20)
    headings = ["TimeStamp(Micosecond)", *(f"A{axis} (g)" for axis in "xyz"), *(f"W{axis} (dps)" for axis in "xyz")]
    parts = [stamps, found["linear_acceleration"], np.degrees(found["angular_velocity"])]
    return Made(columns(headings, parts), "k.csv")


def dts_export() -> Made:
    """20 kHz, deg/s, gyroscope first and backwards."""
    return Made(dts(DTS_COLUMNS, samples=1400, length=240).encode(), "dts.csv", j211=True)


def iso_mme_set() -> Made:
    """A folder as zip."""
    return Made(iso_mme(), "T1.zip", j211=True, content_type="application/zip")


def nhtsa() -> Made:
    """Six curves and their EV5."""
    found = motion(200, 10_000.0, 60)
    curves = {
        1: ("AC", "XL"),
        2: ("AC", "YL"),
        3: ("AC", "ZL"),
        101: ("AV", "XL"),
        102: ("AV", "YL"),
        103: ("AV", "ZL"),
    }
    lines, files = ["----- INSTRUMENTATION -----"], {}
    for number, (sensor, axis) in curves.items():
        name, unit = ("linear_acceleration", "G'S") if sensor == "AC" else ("angular_velocity", "DPS")
        values = found[name][:, "XYZ".index(axis[0])]
        values = values if sensor == "AC" else np.degrees(values)
        files[f"v1/v1.{number:03d}"] = "".join(
            f"{(i - 50) * 1e-4:.6f}\t{v:.6f}\n" for i, v in enumerate(values.tolist())
        )
        lines.append(f"1|{number}|{sensor}|01|HDCG|{axis}|SEC|{unit}|2800|X|D|2000|4|0.0|-50|149|100|AM|P|HEAD")
    header = "# Source: Test Number: 1\r\n" + "\r\n".join([*lines, "----- END -----", ""])
    return Made(zipped({"v1/v1.EV5": header, **files}), "v1.zip", j211=True, content_type="application/zip")


MAKERS: dict[str, tuple[Callable[[], Made], ...]] = {
    "prevent": (prevent, prevent_underscored),
    "swa": (swa,),
    "linx_ias": (linx_ias,),
    "athlete_intelligence": (athlete_intelligence,),
    "biocore": (biocore,),
    "imperial": (imperial,),
    "dts": (dts_export,),
    "headsport": (headsport,),
    "nhtsa": (nhtsa,),
    "iso_mme": (iso_mme_set,),
    "generic_six_axis": (generic_six_axis, microseconds),
}
