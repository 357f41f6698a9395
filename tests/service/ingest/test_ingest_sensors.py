"""Sensors that differ within one device: their own times, rates, ranges and mounting; records that come in parts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ingest_files import codes, csv_text, one, outcome, read, refused, six_axis, statuses
from making import LINX, linx_rows, motion, table

from headimpact.errors import TraceError
from headimpact.preparation import prepare
from headimpact.scoring import score
from headimpact_service.ingest.mapping import Mapping

ACCELERATION = {"unit": "g", "x": "ax", "y": "ay", "z": "az"}
VELOCITY = {"unit": "rad/s", "x": "wx", "y": "wy", "z": "wz"}
STILL = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
SIX = ["ax", "ay", "az", "wx", "wy", "wz"]


def mapping(**fields: Any) -> Mapping:
    return Mapping.model_validate({"linear_acceleration": ACCELERATION, "angular_velocity": VELOCITY} | fields)


class TestOwnTimes:
    """The workbook of Linx, as CSV: accelerometer and gyroscope side by side, each with its own times."""

    def test_each_sensor_has_its_own_rate_and_length_and_the_corrupt_first_row_is_left_out(self):
        record = one(table(LINX, linx_rows()))
        a, w = record.recording.linear_acceleration, record.recording.angular_velocity
        assert (a.values.shape[0], w.values.shape[0]) == (79, 99)
        np.testing.assert_allclose(np.diff(a.time_s), 1 / 1600)
        np.testing.assert_allclose(np.diff(w.time_s), 1 / 2000)
        assert a.time_s[0] - w.time_s[0] == pytest.approx(1 / 1600 - 1 / 2000)
        assert record.recording.pre_trigger_ms == pytest.approx(5.0 - 0.5)
        (note,) = record.notes
        assert (note.code, note.severity) == ("edge_glitch", "note")
        assert np.abs(a.values).max() == pytest.approx(30.0, rel=0.01)

    def test_both_are_brought_to_one_base_on_one_clock(self):
        record = one(table(LINX, linx_rows()))
        kinematics = prepare(record.recording).kinematics
        assert kinematics.sample_rate_hz == pytest.approx(2000.0)
        assert kinematics.time_ms(0) == pytest.approx(-5.0 + 1000 / 1600, abs=0.51)
        # both pulses begin 10 ms into the file: 5 ms behind the trigger
        onset = np.flatnonzero(np.abs(kinematics.linear_acceleration_g[:, 0]) > 3.0)[0]
        assert kinematics.time_ms(int(onset)) == pytest.approx(5.0, abs=1.0)

    def test_a_gyroscope_that_stays_near_its_range_is_saturated(self):
        rows = linx_rows()
        for i in range(30, 35):
            rows[i][6] = 34.79 if i != 32 else 34.8
        rows[30][6] = rows[31][6] = rows[33][6] = rows[34][6] = 34.5
        rows[32][6] = 34.5
        rows[40][6] = 34.8
        found = score(prepare(one(table(LINX, rows)).recording)).quality
        assert [(n.signal, n.channel) for n in found if n.code == "saturated"] == [("angular_velocity", "y")]

    def test_a_time_without_a_sample_is_422(self):
        rows = linx_rows()
        rows[40][5] = ""
        assert codes(refused(table(LINX, rows))) == [(None, "missing-sample")]

    def test_times_of_their_own_may_be_named_in_a_mapping(self):
        found = motion(60, 1000.0, 10)
        a, w = found["linear_acceleration"], found["angular_velocity"]
        rows = [[i, *a[i].tolist(), i * 1000, *w[i].tolist()] for i in range(60)]
        own = mapping(
            linear_acceleration=ACCELERATION | {"time": {"column": "ta", "unit": "ms"}},
            angular_velocity=VELOCITY | {"time": {"column": "tw", "unit": "us"}},
        )
        recording = one(table(["ta", "ax", "ay", "az", "tw", "wx", "wy", "wz"], rows), mapping=own).recording
        assert recording.linear_acceleration.sample_rate_hz == recording.angular_velocity.sample_rate_hz == 1000.0
        missing = mapping(linear_acceleration=ACCELERATION | {"time": {"column": "none", "unit": "ms"}})
        assert codes(refused(table(["t", *SIX], [[0.0] * 7] * 5), mapping=missing)) == [
            ("/linear_acceleration/time", "column-missing")
        ]

    def test_times_of_their_own_that_nearly_say_one_rate_are_kept(self):
        rows = [[i, *row[:3], i / 1.0005, *row[3:]] for i, row in enumerate(six_axis().tolist())]
        own = mapping(
            linear_acceleration=ACCELERATION | {"time": {"column": "ta", "unit": "ms"}},
            angular_velocity=VELOCITY | {"time": {"column": "tw", "unit": "ms"}},
        )
        recording = one(table(["ta", "ax", "ay", "az", "tw", "wx", "wy", "wz"], rows), mapping=own).recording
        assert [sent.sample_rate_hz for _, sent in recording.signals()] == [None, None]
        assert prepare(recording).kinematics.sample_rate_hz == 1000.0

    def test_rates_of_their_own_may_be_stated(self):
        own = mapping(
            linear_acceleration=ACCELERATION | {"sample_rate_hz": 1600},
            angular_velocity=VELOCITY | {"sample_rate_hz": 2000, "range": 34.9},
        )
        recording = one(table(SIX, six_axis().tolist()), mapping=own).recording
        assert recording.linear_acceleration.sample_rate_hz == 1600.0
        assert (recording.angular_velocity.sample_rate_hz, recording.angular_velocity.declared_range) == (2000.0, 34.9)

    def test_the_rows_of_a_sensor_with_a_rate_of_its_own_end_where_its_cells_are_empty(self):
        own = mapping(
            linear_acceleration=ACCELERATION | {"sample_rate_hz": 1600},
            angular_velocity=VELOCITY | {"sample_rate_hz": 2000},
        )
        rows: list[list[Any]] = six_axis().tolist()
        for row in rows[30:]:
            row[:3] = ["", "", ""]
        recording = one(table(SIX, rows), mapping=own).recording
        assert recording.linear_acceleration.values.shape[0] == 30
        assert recording.angular_velocity.values.shape[0] == len(rows)
        rows[10][1] = ""
        assert codes(refused(table(SIX, rows), mapping=own)) == [(None, "missing-sample")]

    def test_a_signal_without_times_or_rate_beside_one_that_has_them_is_refused(self):
        own = mapping(linear_acceleration=ACCELERATION | {"sample_rate_hz": 1600})
        problem = refused(table(SIX, six_axis().tolist()), mapping=own)
        assert codes(problem) == [("sample_rate_hz", "rate-missing")]
        assert problem.detail.startswith("The angular velocity has no column of times")
        neither = mapping(linear_acceleration=ACCELERATION, angular_velocity=VELOCITY)
        assert refused(table(SIX, six_axis().tolist()), mapping=neither).detail.startswith("The file has no column of")

    @pytest.mark.parametrize(
        ("rate", "stamps", "said"),
        [
            (1000.0, lambda i: i, None),
            (1004.0, lambda i: i, None),
            (1010.0, lambda i: i, "rate-differs"),
            (1020.0, lambda i: i, "rate-differs"),
            (3200.0, lambda i: round(i / 3.2), None),  # written to the millisecond
            (1600.0, lambda i: round(i / 1.6) / 1000 * 1000, None),
            (3200.0, lambda i: i, "rate-differs"),
            (1000.0, lambda i: i % 20, "rate-differs"),  # two impacts, one below the other
            (1000.0, lambda i: i if i < 10 else i + 30, "rate-differs"),
            (1000.0, lambda i: i + 0.125 if i < 10 else i + 1.125, "rate-differs"),
        ],
    )
    def test_a_rate_and_times_of_one_impact_must_agree(self, rate: float, stamps: Any, said: str | None):
        rows = [[stamps(i), *row, rate] for i, row in enumerate(six_axis().tolist())]
        text = table(["t_ms", "ax_g", "ay_g", "az_g", "wx_rad_s", "wy_rad_s", "wz_rad_s", "sample_rate_hz"], rows)
        if said is None:
            assert one(text).recording.linear_acceleration.sample_rate_hz == rate
        else:
            assert codes(refused(text)) == [("sample_rate_hz", said)]

    def test_an_impact_of_empty_cells_between_the_rows_of_another_is_its_own_fault(self):
        own = {
            "linear_acceleration": ACCELERATION | {"time": {"column": "ta", "unit": "ms"}},
            "angular_velocity": VELOCITY | {"time": {"column": "tw", "unit": "ms"}},
        }
        whole = [["a", i, *row[:3], i, *row[3:]] for i, row in enumerate(six_axis().tolist())]
        rows = [row for pair in zip(whole, [["b", *[""] * 8]] * 40, strict=True) for row in pair]
        text = table(["id", "ta", *SIX[:3], "tw", *SIX[3:]], rows)
        first, second = read(text, mapping=Mapping.model_validate({"group_by": "id"} | own))
        assert prepare(first.recording).kinematics.samples == 40
        with pytest.raises(TraceError, match="3 to 20000 samples"):
            prepare(second.recording)

    def test_a_mounting_of_what_is_not_a_sensor_is_refused(self):
        turned = {"accelerometer": {"rotation": STILL, "offset_mm": [70, 10, -60]}, "gyroscope": {"rotation": STILL}}
        rows = table(SIX, six_axis().tolist())
        for location in ({}, {"location": "head_cg"}):
            problem = refused(rows, mapping=mapping(sample_rate_hz=1000, mounting=turned, **location))
            assert codes(problem) == [("/mounting", "mounting-not-needed")]
        assert one(rows, mapping=mapping(sample_rate_hz=1000, mounting=turned, location="sensor")).recording.mounting


class TestDroppedSamples:
    def test_the_time_before_the_trigger_is_shortened_by_a_rate_as_by_times(self):
        dropped = mapping(sample_rate_hz=2000, drop_rows=3, pre_trigger_ms=10)
        assert one(table(SIX, six_axis().tolist()), mapping=dropped).recording.pre_trigger_ms == 8.5
        none_left = mapping(sample_rate_hz=2000, drop_rows=3, pre_trigger_ms=1)
        assert one(table(SIX, six_axis().tolist()), mapping=none_left).recording.pre_trigger_ms == 0.0


class TestMounting:
    def test_each_sensor_s_rotation_and_delay_come_with_a_mapping(self):
        turned = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
        mounted = mapping(
            sample_rate_hz=1000,
            location="sensor",
            mounting={
                "accelerometer": {"rotation": STILL, "offset_mm": [70, 0, 0]},
                "gyroscope": {"rotation": turned, "delay_ms": 2.0},
            },
        )
        record = one(table(SIX, six_axis().tolist()), mapping=mounted)
        assert record.recording.mounting.gyroscope_delay_s == 0.002
        kinematics = prepare(record.recording).kinematics
        assert kinematics.samples == 38
        assert kinematics.angular_velocity[:, 0].max() == pytest.approx(20.0, rel=0.1)

    def test_a_mirrored_axis_map_is_refused_with_the_reason(self):
        mirrored = mapping(
            sample_rate_hz=1000,
            location="sensor",
            mounting={"accelerometer": {"rotation": [[1, 0, 0], [0, -1, 0], [0, 0, 1]], "offset_mm": [0, 0, 0]}},
        )
        problem = refused(table(SIX, six_axis().tolist()), mapping=mirrored)
        assert (problem.slug, codes(problem)) == (
            "improper-rotation",
            [("/mounting/accelerometer/rotation", "improper-rotation")],
        )
        assert "mirrors an axis" in problem.detail


class TestParts:
    """Rows of an impact whose signals do not share their times, as this service exports them."""

    HEADINGS = (
        "external_id",
        "time_base",
        "sample_rate_hz",
        "t_ms",
        "ax_g",
        "ay_g",
        "az_g",
        *(f"w{a}_rad_s" for a in "xyz"),
    )

    def rows(self, rates: tuple[object, object] = (1000, 2000)) -> list[list[object]]:
        found = six_axis()
        first = [["e", 1, rates[0], float(i), *found[i, :3].tolist(), "", "", ""] for i in range(40)]
        second = [["e", 2, rates[1], i / 2, "", "", "", *found[i, 3:].tolist()] for i in range(40)]
        return first + second

    def test_each_part_has_its_own_rate(self):
        recording = one(table(self.HEADINGS, self.rows())).recording
        assert recording.linear_acceleration.sample_rate_hz == 1000.0
        assert recording.angular_velocity.sample_rate_hz == 2000.0
        np.testing.assert_array_equal(recording.angular_velocity.values, six_axis()[:, 3:])

    def test_without_a_rate_a_part_has_its_times(self):
        recording = one(table(self.HEADINGS, self.rows(("", "")))).recording
        assert recording.linear_acceleration.sample_rate_hz == 1000.0
        assert recording.angular_velocity.sample_rate_hz == 2000.0

    def test_parts_that_begin_at_different_times_keep_them(self):
        rows = self.rows(("", ""))
        for row in rows[40:]:
            row[3] = float(row[3]) + 1.25
        recording = one(table(self.HEADINGS, rows)).recording
        assert recording.linear_acceleration.time_s[0] == 0.0
        assert recording.angular_velocity.time_s[0] == 0.00125

    def test_a_signal_that_an_impact_does_not_have_is_empty(self):
        rows = self.rows()[:40]
        recording = one(table(self.HEADINGS, rows)).recording
        assert recording.angular_velocity is None

    def test_a_sample_that_is_missing_inside_a_part_is_422(self):
        rows = self.rows()
        rows[20][4] = ""
        assert codes(refused(table(self.HEADINGS, rows))) == [(None, "missing-sample")]

    def test_a_signal_in_two_parts_is_refused(self):
        rows = self.rows()
        rows[50][4:7] = [1.0, 1.0, 1.0]
        assert codes(refused(table(self.HEADINGS, rows))) == [(None, "time-base")]

    def test_an_impact_of_empty_rows_is_refused(self):
        rows = [["e", 1, 1000, float(i), *[""] * 6] for i in range(5)]
        assert codes(refused(table(self.HEADINGS, rows))) == [(None, "no-signal")]


@given(st.lists(st.tuples(st.integers(0, 81), st.sampled_from(["", "x", "nan", "-1", "1e999", "2"])), max_size=12))
@settings(max_examples=60, deadline=None)
def test_any_cells_of_a_part_are_read_or_refused(damage):
    rows = TestParts().rows()
    for place, cell in damage:
        rows[place % 80][place % 10] = cell
    assert statuses(outcome(table(TestParts.HEADINGS, rows))) <= {422}


def test_a_gap_is_refused_or_filled_as_the_sender_says():
    lines = csv_text().splitlines()
    cells = lines[20].split(",")
    lines[20] = ",".join([*cells[:2], "", *cells[3:]])
    file = "\n".join(lines)
    assert codes(refused(file)) == [(None, "missing-sample")]
    filled = one(file, fill_gaps=True)
    assert filled.recording.fill_gaps
    assert prepare(filled.recording).notes[0].code == "gaps_filled"
    asked = mapping(fill_gaps=True, sample_rate_hz=1000)
    assert one(
        file.replace("ax_g,ay_g,az_g,wx_rad_s,wy_rad_s,wz_rad_s", ",".join(SIX)), mapping=asked
    ).recording.fill_gaps


def test_rows_that_are_missing_are_filled_by_their_times():
    lines = csv_text().splitlines()
    del lines[20:22]
    assert one("\n".join(lines)).recording.linear_acceleration.sample_rate_hz is None
    filled = prepare(one("\n".join(lines), fill_gaps=True).recording)
    assert filled.kinematics.samples == 40
    assert {note.code for note in filled.notes} == {"gaps_filled"}
