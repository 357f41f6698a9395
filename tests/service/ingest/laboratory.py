"""Files of laboratories, of our own making: ISO-MME sets and DTS exports."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from ingest_files import half_sine, zipped

ISO_CODES = {
    "11HEADCG00H3ACXA": ("g", 30.0),
    "11HEADCG00H3ACYA": ("g", -12.0),
    "11HEADCG00H3ACZA": ("g", 7.5),
    "11HEAD0000H3AVXA": ("rad/s", 8.0),
    "11HEAD0000H3AVYA": ("rad/s", 20.0),
    "11HEAD0000H3AVZA": ("rad/s", -4.0),
}
SAMPLES, INTERVAL_S, FIRST_S = 60, 1e-3, -0.01


def text(fields: Mapping[str, Any], numbers: Sequence[object] = ()) -> str:
    """A file of ISO-MME: padded keys, then a number a line."""
    lines = [f"{key:<28}:{value}" for key, value in fields.items()]
    return "\r\n".join([*lines, *(n if isinstance(n, str) else f"{n:.6E}" for n in numbers), ""])


def channel(code: str, unit: str, numbers: Sequence[object], **changes: Any) -> str:
    """A channel's file with implicit times; a change to None leaves a line out."""
    fields = {
        "Test object number": code[0],
        "Name of the channel": "Kopf",
        "Channel code": code,
        "Unit": unit,
        "Reference channel": "implicit",
        "Reference channel name": "NOVALUE",
        "Channel frequency class": "1000",
        "Time of first sample": FIRST_S,
        "Sampling interval": INTERVAL_S,
        "Number of samples": len(numbers),
        "Data status": "ok",
    }
    fields |= {key.replace("_", " ").capitalize(): value for key, value in changes.items()}
    return text({key: value for key, value in fields.items() if value is not None}, numbers)


def channels(codes: Mapping[str, tuple[str, float]] = ISO_CODES, **changes: Any) -> dict[str, str]:
    """A half sine for every code."""
    return {
        code: channel(code, unit, half_sine(SAMPLES, peak).tolist(), **changes) for code, (unit, peak) in codes.items()
    }


def iso_mme(
    held: Mapping[str, str] | None = None,
    *,
    listed: Sequence[str] | None = None,
    folder: str = "T1/",
    name: str = "T1",
    encoding: str = "utf-8",
    **info: str,
) -> bytes:
    """A set as zip; `listed` are the codes that its list names, first those that are held."""
    held = channels() if held is None else held
    codes = [*held, *(code for code in listed or () if code not in held)]
    names = {f"Name of channel {number:03d}": f"{code} / Kopf" for number, code in enumerate(codes, start=1)}
    fields = {"Data format edition number": "1.6", "Laboratory name": "Prüfzentrum", "Test number": name} | info
    files = {
        f"{folder}{name}.mme": text(fields),
        f"{folder}Channel/{name}.chn": text({"Number of channels": len(codes), **names}),
    }
    files |= {f"{folder}Channel/{name}.{n:03d}": held[code] for n, code in enumerate(codes, start=1) if code in held}
    return zipped({path: content.encode(encoding) for path, content in files.items()})


DTS_COLUMNS = {
    "11HEAD0000H3AVZC": ("deg/s", np.degrees(-4.0)),
    "11HEAD0000H3AVYC": ("deg/s", np.degrees(20.0)),
    "11HEAD0000H3AVXC": ("deg/s", np.degrees(8.0)),
    "11HEAD0000H3ACXC": ("g", 30.0),
    "11HEAD0000H3ACYC": ("g", -12.0),
    "11HEAD0000H3ACZC": ("g", 7.5),
}


def dts(
    columns: Mapping[str, tuple[str, float]] = DTS_COLUMNS,
    *,
    rate_hz: float = 20_000.0,
    before: int | None = 10,
    time_column: bool = True,
    delimiter: str = ",",
    samples: int = SAMPLES,
    length: int = 12,
    changes: Mapping[str, Sequence[object]] | None = None,
    times: Callable[[int], float] | None = None,
) -> str:
    """An export: the gyroscope's channels first, z before y before x."""
    count = len(columns)
    header: dict[str, Sequence[object]] = {
        "Test Date": ["11/20/2026"],
        "Test ID": ["drop 7"],
        "Data Channel Number": range(1, count + 1),
        "Channel Description": [f"Head {n}" for n in range(1, count + 1)],
        "ISO Channel Code": list(columns),
        "Sensor Serial Number": ["ARS123"] * count,
        "Engineering Unit": [unit for unit, _ in columns.values()],
        "Software Filter": ["NONE"] * count,
        "Sample Rate (Hz)": [f"{rate_hz:g}"] * count,
        "Number of Pts (Total)": [samples] * count,
        "Pre-zero Data Pts": [] if before is None else [before] * count,
        "Scale Factor (EU/Cnt)": [0.01] * count,
    }
    header |= changes or {}
    rows = [[key, *values] for key, values in header.items() if values]
    if time_column:
        rows.append(["Time (sec)", *columns])
    waves = np.stack([half_sine(samples, peak, 10, length) for _, peak in columns.values()], axis=1)
    for index, values in enumerate(waves.tolist()):
        time = (index - (before or 0)) / rate_hz if times is None else times(index)
        rows.append([*([time] if time_column else []), *values])
    return "\r\n".join(delimiter.join(map(str, row)) for row in rows) + "\r\n"
