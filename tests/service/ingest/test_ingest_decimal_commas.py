"""One rule tells decimal commas, whether a sample of a CSV, a channel of DTS or a cell about an impact holds them."""

from __future__ import annotations

import re

import numpy as np
import pytest
from ingest_files import csv_text, one, refused
from laboratory import dts

from headimpact_service.errors import Problem
from headimpact_service.ingest.record import ImpactRecord

CLEAR = {
    "0,125": 0.125,
    "12,5": 12.5,
    ",5": 0.5,
    "0012,345": 12.345,
    "1234,567": 1234.567,
    "12,3456": 12.3456,
    "1,250e1": 12.5,
    "+7,5": 7.5,
}
UNCLEAR = ["1,250", "999,000", "1,250,000", "12,5,0", "12,"]
PLACE = 17


def in_csv(*cells: str) -> str:
    """A table of whole numbers but for some samples of its last column."""
    lines = csv_text(np.arange(240.0).reshape(40, 6), rate_hz=0.001, delimiter=";").replace(".0", "").splitlines()
    for place, cell in enumerate(cells, PLACE):
        lines[place + 1] = lines[place + 1].rpartition(";")[0] + f";{cell}"
    return "\n".join(lines).replace("t_s", "t_ms")


def in_dts(*cells: str) -> str:
    """An export of whole numbers but for some samples of its last channel."""
    text = dts(delimiter=";", time_column=False, changes={"Scale Factor (EU/Cnt)": []})
    lines = re.sub(r"(?<=[0-9])\.[0-9]+(e-?[0-9]+)?", "", text).split("\r\n")
    first = next(place for place, line in enumerate(lines) if line.startswith("Pre-zero")) + 1
    for place, cell in enumerate(cells, first + PLACE):
        lines[place] = lines[place].rpartition(";")[0] + f";{cell}"
    return "\r\n".join(lines)


def about_an_impact(cell: str) -> str:
    """A table that says how long before the trigger it begins."""
    return csv_text(before={"pre_trigger_ms": f'"{cell}"'})


def sample(record: ImpactRecord, signal: str) -> float:
    return float(getattr(record.recording, signal).values[PLACE, 2])


@pytest.mark.parametrize("cell", CLEAR)
def test_a_comma_that_cannot_group_thousands_is_decimal(cell: str):
    assert sample(one(in_csv(cell)), "angular_velocity") == CLEAR[cell]
    assert sample(one(in_dts(cell)), "linear_acceleration") == CLEAR[cell]
    assert one(about_an_impact(cell)).recording.pre_trigger_ms == CLEAR[cell]


@pytest.mark.parametrize("cell", UNCLEAR)
def test_any_other_comma_is_refused(cell: str):
    for text in (in_csv(cell), in_dts(cell), about_an_impact(cell)):
        assert isinstance(refused(text), Problem)


def test_one_clear_comma_tells_of_those_that_might_group_thousands():
    assert sample(one(in_csv("1,250", "12,5")), "angular_velocity") == 1.25
    assert sample(one(in_dts("1,250", "12,5")), "linear_acceleration") == 1.25


def test_points_beside_decimal_commas_are_refused():
    for text in (in_csv("12,5", "1.250"), in_dts("12,5", "1.250")):
        assert "and points too" in refused(text).detail


def test_quotes_hold_decimal_commas_between_commas():
    quoted = [re.sub(r";", ",", re.sub(r"(?<=;)12,5", '"12,5"', text)) for text in (in_csv("12,5"), in_dts("12,5"))]
    assert sample(one(quoted[0]), "angular_velocity") == 12.5
    assert sample(one(quoted[1]), "linear_acceleration") == 12.5


POINTED = ["1.250", "-12.345", "+999.000", " 7.125"]


@pytest.mark.parametrize("cell", POINTED)
@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_a_point_that_may_group_thousands_is_refused_among_whole_numbers(cell: str, delimiter: str):
    problem = refused(in_csv(cell).replace(";", delimiter))
    assert "Whether points in the file's numbers are decimal or group thousands" in problem.detail
    assert "without separators of thousands" in problem.detail


@pytest.mark.parametrize("cell", POINTED)
@pytest.mark.parametrize("clear", ["0.125", "12.5", "1234.567", "1.2040", "1.250e1", ".5"])
def test_one_clear_point_tells_of_those_that_might_group_thousands(cell: str, clear: str):
    assert sample(one(in_csv(cell, clear)), "angular_velocity") == float(cell)


def test_points_between_commas_are_decimal():
    assert sample(one(in_csv("1.250").replace(";", ",")), "angular_velocity") == 1.25


@pytest.mark.parametrize("cell", ["1,204.5", "1.204,5", "-1,204,567", "1.204.567", "12,345,678.9"])
@pytest.mark.parametrize("delimiter", [";", ","])
def test_grouped_thousands_are_refused_with_what_to_do(cell: str, delimiter: str):
    text = in_csv(f'"{cell}"').replace(";", delimiter)
    assert "groups its thousands" in refused(text).detail


def test_a_comma_in_quotes_that_may_group_thousands_is_refused_with_what_to_do():
    assert "without separators of thousands" in refused(in_csv('"1,204"').replace(";", ",")).detail
    assert "no separators of thousands" in refused(in_csv("12,5", "1.204")).detail
