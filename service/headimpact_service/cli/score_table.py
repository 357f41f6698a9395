"""A score as a table for a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from headimpact_service.ingest.record import ImpactRecord

RESEARCH_USE = "Research use only: the model rests on adult men, and this is no diagnosis."


def show(record: ImpactRecord, document: Mapping[str, Any]) -> None:
    """Print one impact's score."""
    console = Console(highlight=False)
    console.print(Text(_heading(record, document), style="bold"))
    console.print(_peaks(document))
    console.print(_criteria(document))
    for point in document["operating_points"]:
        console.print(Text(_point(point)))
    for note in document["quality"]:
        console.print(Text(f"{note['severity']} {note['code']}: {note['detail']}", style="yellow"))
    for reason in document.get("reasons", ()):
        console.print(Text(f"not scored: {reason}", style="red"))
    console.print(Text(RESEARCH_USE, style="dim"))


def _heading(record: ImpactRecord, document: Mapping[str, Any]) -> str:
    name = record.external_id or _name_in_file(record.metadata)
    when = "" if record.occurred_at is None else f", {record.occurred_at:%Y-%m-%d %H:%M:%S} UTC"
    return f"{name}{when}: {document['state']} under {document['model']}"


def _name_in_file(metadata: Mapping[str, Any]) -> str:
    """Where an impact without a name of its own stood."""
    file, number = metadata.get("file"), metadata.get("impact")
    parts = [str(file)] if file is not None else []
    if number is not None:
        parts.append(f"impact {number}")
    return ", ".join(parts) or "impact"


def _peaks(document: Mapping[str, Any]) -> Text:
    peaks, angle = document["peaks"], document["brain_angle"]
    parts = [
        f"peak {_number(peaks['linear_acceleration_g'])} g",
        f"{_number(peaks['angular_velocity_rad_s'])} rad/s",
        f"{_number(peaks['angular_acceleration_rad_s2'])} rad/s^2",
    ]
    if angle is not None:
        parts.append(f"brain angle {_number(angle['resultant'])} rad")
    return Text(", ".join(parts))


def _criteria(document: Mapping[str, Any]) -> Table:
    """Keys rather than names, and no frame: every row stays on one line of 80 columns."""
    table = Table(box=None, padding=(0, 1, 0, 0))
    for heading, side in (
        ("criterion", "left"),
        ("value, or x y z", "right"),
        ("unit", "left"),
        ("probability", "right"),
    ):
        table.add_column(heading, justify=side, no_wrap=True)  # type: ignore[arg-type] # left or right
    for key, found in document["criteria"].items():
        table.add_row(key, _values(found["value"]), found["unit"], _number(found["probability"]))
    return table


def _values(value: Any) -> str:  # noqa: ANN401 - a number, a vector or nothing
    if isinstance(value, dict):
        return " ".join(_number(value[axis]) for axis in ("x", "y", "z"))
    return _number(value)


def _point(point: Mapping[str, Any]) -> str:
    asked, level = next(iter(point["requested"].items()))
    side = {True: "exceeded", False: "not exceeded", None: "not known"}[point["exceeded"]]
    return f"{point['criterion']} at {asked} {level:g}: p >= {point['threshold']:.4g} {side} ({point['basis']})"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
