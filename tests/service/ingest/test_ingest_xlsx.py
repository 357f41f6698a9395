"""Workbooks: a sheet an event, blocks beside or below each other, values and never formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from binary_files import SHEET, noise, with_part, xlsx
from ingest_files import GENERIC, half_sine, read, refused, six_axis, zipped

from headimpact_service.errors import Problem
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

ACCELERATION = ["Time (sec)", *(f"{axis} Axis Linear Accel (g)" for axis in "XYZ")]
ROTATION = ["Time (sec)", *(f"{axis} Rotational Velocity (rad/s)" for axis in "XYZ")]
SUMMARY = [["Event", "Peak Linear Acceleration (g)"], [1.0, 30.0], [2.0, 31.0]]

Row = list[Any]


def records(data: bytes, **options: Any) -> list[ImpactRecord]:
    found = read(data, **options)
    assert all(isinstance(item, ImpactRecord) for item in found), found[0]
    return [item for item in found if isinstance(item, ImpactRecord)]


def samples_of(record: ImpactRecord) -> np.ndarray:
    return np.concatenate([signal.values for _, signal in record.recording.signals()], axis=1)


def generic(samples: np.ndarray | None = None) -> list[Row]:
    """Headings that name their units, and samples of 1 kHz."""
    rows = (six_axis() if samples is None else samples).tolist()
    return [GENERIC.split(","), *([index / 1000.0, *row] for index, row in enumerate(rows))]


def block(rate_hz: float, samples: int, peak: float) -> list[Row]:
    wave = half_sine(samples, peak, start=20)
    return [[index / rate_hz - 0.005, value, -value / 2, value / 4] for index, value in enumerate(wave.tolist())]


def linx(*, below: bool) -> list[Row]:
    """One event of a device with two sensors, 80 and 100 samples long."""
    a, w = block(1600.0, 80, 60.0), block(2000.0, 100, 20.0)
    if below:
        return [["Event 1"], ACCELERATION, *a, [], ["Gyroscope"], ROTATION, *w]
    return [["Event 1"], ACCELERATION + ROTATION, *((a[i] if i < 80 else [None] * 4) + w[i] for i in range(100))]


@pytest.mark.parametrize("below", [False, True])
def test_a_device_of_two_sensors_is_read_with_the_rates_of_both(below: bool):
    found = records(xlsx({"Summary": SUMMARY, "Event 1": linx(below=below), "Event 2": linx(below=below)}))
    assert [record.metadata for record in found] == [
        {"format": "xlsx", "preset": "linx_ias", "sheet": name} for name in ("Event 1", "Event 2")
    ]
    for record in found:
        a, w = (signal for _, signal in record.recording.signals())
        # The first row of each block is left out, as the device's layout says.
        assert (a.values.shape, w.values.shape) == ((79, 3), (99, 3))
        assert a.values[:, 0].max() == half_sine(80, 60.0).max()
        assert w.values[:, 2].max() == half_sine(80, 5.0).max()
        assert [note.code for note in record.notes] == ["edge_glitch"]
        for signal, rate in ((a, 1600.0), (w, 2000.0)):
            assert signal.time_s is not None
            np.testing.assert_allclose(np.diff(signal.time_s), 1.0 / rate, rtol=1e-9)


def test_a_sheet_whose_headings_name_units_needs_no_preset():
    [record] = records(xlsx({"a": generic()}))
    np.testing.assert_array_equal(samples_of(record), six_axis())
    assert record.metadata == {"format": "xlsx", "preset": "generic_six_axis", "sheet": "a"}


def test_words_above_the_headings_and_sheets_without_signals_are_passed_over():
    notes = [["Laboratory"], ["Operator", "x"], ["Run", 7.0], [], *generic()]
    other = [["key", "value"], ["mass", 4.0]]
    [record] = records(xlsx({"notes": other, "b": notes, "table": [["p", "q"], [1.0, 2.0]]}))
    np.testing.assert_array_equal(samples_of(record), six_axis())
    assert record.metadata["sheet"] == "b"


def test_one_sheet_may_hold_several_impacts():
    rows = [["external_id", *generic()[0]]]
    for number in range(3):
        rows += [[float(number + 1), *row] for row in generic(noise()[number])[1:]]
    found = records(xlsx({"all": rows}))
    assert [record.external_id for record in found] == ["1", "2", "3"]
    np.testing.assert_array_equal(np.stack([samples_of(record) for record in found]), noise())


def test_a_formula_is_the_value_that_was_saved_with_it():
    def computed(part: bytes) -> bytes:
        changed = part.replace(b'<c r="B12"><v>', b'<c r="B12"><f>WEBSERVICE("http://example.org")</f><v>')
        assert changed != part
        return changed

    np.testing.assert_array_equal(
        samples_of(records(with_part(xlsx({"a": generic()}), SHEET, computed))[0]), six_axis()
    )

    def unsaved(part: bytes) -> bytes:
        return part.replace(b'<c r="B12"><v>0.0</v>', b'<c r="B12"><f>1+1</f>').replace(
            b'<c r="B12"><v>', b'<c r="B12"><f>1+1</f><v></v></c><c r="Z12"><v>'
        )

    problem = refused(with_part(xlsx({"a": generic()}), SHEET, unsaved))
    assert [error.code for error in problem.errors] == ["missing-sample"]


def test_numbers_that_were_typed_as_text_are_numbers_and_words_are_not():
    rows = generic()
    rows[5][2] = " 1.5e0 "
    assert samples_of(records(xlsx({"a": rows}))[0])[4, 1] == 1.5
    rows[5][2] = "1,5"
    assert samples_of(records(xlsx({"a": rows}))[0])[4, 1] == 1.5
    rows[5][2] = "much"
    assert [error.code for error in refused(xlsx({"a": rows})).errors] == ["missing-sample"]


def test_a_broken_sheet_stands_for_itself_among_others():
    rows = generic()
    rows[7][3] = None
    first, second, third = read(xlsx({"a": generic(), "b": rows, "c": generic()}))
    assert isinstance(first, ImpactRecord)
    assert isinstance(second, Problem)
    assert isinstance(third, ImpactRecord)
    long = generic(np.zeros((20_001, 6)))
    fault, good = read(xlsx({"long": long, "a": generic()}))
    assert isinstance(fault, Problem)
    assert "20000 samples" in fault.detail
    assert isinstance(good, ImpactRecord)


def test_a_sheet_that_is_refused_while_it_is_read_leaves_the_others_alone():
    headings, *rows = generic()
    long = [[*headings, "external_id"], *([*row, "x" * 1001] for row in rows)]
    fault, good = read(xlsx({"long": long, "a": generic()}))
    assert isinstance(fault, Problem)
    assert fault.detail == "Sheet long: A cell of text may have at most 1000 characters."
    assert isinstance(good, ImpactRecord)


def test_the_number_of_impacts_is_bounded_over_all_sheets():
    problem = refused(xlsx({name: generic() for name in "abc"}), max_impacts=2)
    assert problem.slug == "import-too-large"


def test_a_mapping_reaches_any_sheet():
    mapping = {
        "linear_acceleration": {"unit": "m/s^2", "x": "p", "y": "-q", "z": "r"},
        "time": {"column": "clock", "unit": "ms"},
    }
    rows = [["clock", "p", "q", "r"], *([float(i), float(i), 2.0 * i, 3.0 * i] for i in range(30))]
    [record] = records(xlsx({"a": rows}), mapping=Mapping.model_validate(mapping))
    np.testing.assert_array_equal(samples_of(record), np.arange(30.0)[:, None] * [1.0, -2.0, 3.0])


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (xlsx({"a": []}), "No sheet of the workbook"),
        (xlsx({"a": [["only", "words"]]}), "No sheet of the workbook"),
        (xlsx({"a": [[1.0, 2.0], [3.0, 4.0]]}), "No sheet of the workbook"),
        (xlsx({"a": [["p", "q"], [1.0, 2.0]]}), "The columns of no signal were found"),
        (xlsx({"summary ": generic()}), "no impact"),
        (zipped({"xl/workbook.xml": "<broken"}), "broken"),
        (with_part(xlsx({"a": generic()}), SHEET, lambda part: part[: len(part) // 2]), "broken"),
    ],
)
def test_a_workbook_that_cannot_be_read_says_why(data: bytes, said: str):
    problem = refused(data)
    assert problem.slug == "unreadable-file"
    assert said in problem.detail


def test_a_sheet_whose_numbers_are_all_text_is_read():
    headings, *rows = generic()
    [record] = records(xlsx({"a": [headings, *([repr(cell) for cell in row] for row in rows)]}))
    np.testing.assert_array_equal(samples_of(record), six_axis())


def test_a_row_of_units_below_the_headings_is_one():
    _, *rows = generic()
    words = ["Time", "Accel X", "Accel Y", "Accel Z", "Gyro X", "Gyro Y", "Gyro Z"]
    units = ["s", "g", "g", "g", "rad/s", "rad/s", "rad/s"]
    [record] = records(xlsx({"a": [["Event 1"], words, units, *rows]}))
    np.testing.assert_array_equal(samples_of(record), six_axis())


def as_text(comma: str) -> list[Row]:
    """The same with every number kept as text."""
    headings, *rows = generic()
    return [headings, *([f"{value:.7f}".replace(".", comma) for value in row] for row in rows)]


def test_numbers_kept_as_text_may_have_decimal_commas():
    [written] = records(xlsx({"a": as_text(",")}))
    [plain] = records(xlsx({"a": as_text(".")}))
    np.testing.assert_array_equal(samples_of(written), samples_of(plain))
    assert [signal.sample_rate_hz for _, signal in written.recording.signals()] == [1000.0, 1000.0]


def test_commas_beside_points_in_numbers_kept_as_text_are_refused():
    rows = as_text(",")
    rows[3][2] = "1.5"
    assert "decimal commas, and points too" in refused(xlsx({"a": rows})).detail


def test_commas_that_may_group_thousands_in_numbers_kept_as_text_are_refused():
    headings, *rows = generic()
    for row in rows:
        row[1] = "1,250"
    assert "is not clear" in refused(xlsx({"a": [headings, *rows]})).detail


def sheets_of_sensors(**names: str) -> dict[str, list[Row]]:
    headings, *rows = generic()
    parts = {"linear": slice(1, 4), "rotation": slice(4, 7)}
    return {
        names[part]: [[headings[0], *headings[columns]], *([row[0], *row[columns]] for row in rows)]
        for part, columns in parts.items()
    }


def test_sheets_that_hold_a_sensor_each_are_not_two_impacts():
    problem = refused(xlsx(sheets_of_sensors(linear="Accelerometer", rotation="Gyroscope")))
    assert problem.slug == "unreadable-file"
    assert problem.detail.startswith("The sheets Accelerometer and Gyroscope hold a sensor each")
    assert len(records(xlsx(sheets_of_sensors(linear="Event 1", rotation="Event 2")))) == 2
    assert len(records(xlsx({"Accelerometer": generic(), "Gyroscope": generic()}))) == 2


def test_files_of_a_folder_that_hold_a_sensor_each_are_not_two_impacts():
    texts = {
        f"{name}.csv": "\n".join(",".join(map(str, row)) for row in rows)
        for name, rows in sheets_of_sensors(linear="hit1_acc", rotation="hit1_gyro").items()
    }
    with pytest.raises(Problem, match=r"The files hit1_acc\.csv and hit1_gyro\.csv hold a sensor each"):
        read(zipped(texts))
