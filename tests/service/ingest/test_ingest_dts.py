"""DTS / TDAS exports: the header says what the columns are, at which rate, and how they were filtered."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ingest_files import codes, csv_text, half_sine, one, outcome, read, refused, statuses
from laboratory import DTS_COLUMNS, SAMPLES, dts

from headimpact.preparation import prepare
from headimpact_service.ingest.dts import is_dts
from headimpact_service.ingest.mapping import Mapping

EXPECTED = {"linear_acceleration": [30.0, -12.0, 7.5], "angular_velocity": np.degrees([8.0, 20.0, -4.0])}


def peaks(record, signal: str) -> list[float]:
    values = getattr(record.recording, signal).values
    return [float(column[np.abs(column).argmax()]) for column in values.T]


@pytest.mark.parametrize("time_column", [True, False])
@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("named", [None, "dts"])
def test_channels_are_read_in_the_order_of_the_header_whatever_that_is(time_column, delimiter, named):
    record = one(dts(time_column=time_column, delimiter=delimiter), preset=named)
    recording = record.recording
    for signal, expected in EXPECTED.items():
        assert peaks(record, signal) == pytest.approx(expected)
    assert (recording.linear_acceleration.unit, recording.angular_velocity.unit) == ("g", "deg/s")
    assert recording.linear_acceleration.sample_rate_hz == 20_000.0
    assert (recording.axes, recording.pre_trigger_ms) == ("sae_j211", 0.5)
    assert record.metadata["test_id"] == "drop 7"
    assert prepare(recording).kinematics.samples == SAMPLES


def test_the_header_s_filter_counts_not_the_code_s_last_letter():
    assert one(dts()).metadata["filtered_before"]["linear_acceleration_x"] == "none"
    told = dts(changes={"Software Filter": ["CFC 180"] * 6})
    assert one(told).metadata["filtered_before"]["linear_acceleration_x"] == "cfc 180"
    silent = dts(changes={"Software Filter": []})
    assert one(silent).metadata["filtered_before"]["linear_acceleration_x"] == "CFC180"


def test_a_value_that_is_given_once_is_that_of_every_channel():
    once = {"Sample Rate (Hz)": ["10000"], "Pre-zero Data Pts": ["20"], "Software Filter": ["NONE"]}
    once = dts(changes=once, time_column=False)
    recording = one(once).recording
    assert recording.angular_velocity.sample_rate_hz == 10_000.0
    assert recording.pre_trigger_ms == 2.0


def test_without_points_before_the_trigger_the_trigger_is_not_known():
    assert one(dts(before=None)).recording.pre_trigger_ms is None


class TestTimes:
    """The column of times against the header."""

    @pytest.mark.parametrize("per_second", [1.0, 1e3, 1e6])
    def test_it_may_count_seconds_or_parts_of_them_and_then_gives_the_trigger(self, per_second):
        text = dts(before=None, times=lambda n: (n - 10) / 20_000 * per_second)
        assert one(text).recording.pre_trigger_ms == pytest.approx(0.5)

    @pytest.mark.parametrize("times", [lambda n: n, lambda n: n + 1.0, lambda n: n / 20_000])
    def test_numbers_of_samples_and_times_from_the_start_leave_the_trigger_to_the_header(self, times):
        assert one(dts(times=times)).recording.pre_trigger_ms == 0.5
        assert one(dts(before=None, times=times)).recording.pre_trigger_ms is None

    @pytest.mark.parametrize(
        "times",
        [
            lambda n: n / 10_000,
            lambda n: n / 20_000 + (0.001 if n > 40 else 0.0),
            lambda n: -n / 20_000,
            lambda n: 2.0 * n,
        ],
    )
    def test_times_at_another_rate_than_the_header_s_are_refused(self, times):
        problem = refused(dts(times=times))
        assert codes(problem) == [(None, "rates-differ")]
        assert "20000" in problem.detail

    def test_times_that_put_the_trigger_elsewhere_are_refused(self):
        problem = refused(dts(times=lambda n: (n - 25) / 20_000))
        assert codes(problem) == [(None, "time-zero")]
        assert "10 samples" in problem.detail
        assert "25" in problem.detail

    def test_a_time_that_is_no_number_is_refused(self):
        assert codes(refused(dts(times=lambda n: "x" if n == 30 else n / 20_000))) == [(None, "time-form")]

    @pytest.mark.parametrize(
        ("key", "value"),
        [
            ("Pre-zero points", 10),
            ("Number of pre-zero points", "10.0"),
            ("Number of Pre-Trigger Samples", 10),
            ("Pre Trigger Samples", 10),
            ("Pre-zero seconds", 0.0005),
            ("Pre-Trigger Time (s)", 0.0005),
            ("PreTrigger (ms)", 0.5),
        ],
    )
    def test_the_record_before_the_trigger_is_counted_in_points_or_in_time(self, key, value):
        text = dts(before=None, time_column=False, changes={key: [value]})
        assert one(text).recording.pre_trigger_ms == pytest.approx(0.5)

    def test_a_part_of_a_point_before_the_trigger_is_refused(self):
        text = dts(before=None, time_column=False, changes={"Pre-zero points": [0.05]})
        assert codes(refused(text)) == [(None, "time-zero")]


def test_decimal_commas_are_read_where_semicolons_part_the_cells():
    assert np.array_equal(
        one(dts(delimiter=";").replace(".", ",")).recording.linear_acceleration.values,
        one(dts()).recording.linear_acceleration.values,
    )


def test_a_comma_that_may_group_thousands_is_no_number():
    text = re.sub(r"(?<![0-9])-?[0-9]+[.][0-9]+", "1,000", dts(delimiter=";", before=None, changes={"Test ID": ["7"]}))
    assert codes(refused(text)) == [(None, "time-form")]


def test_a_row_of_codes_may_leave_a_cell_for_the_time():
    text = dts()
    lines = [
        f"{line.partition(',')[0]},,{line.partition(',')[2]}" if i < 12 else line
        for i, line in enumerate(text.split("\r\n"))
    ]
    assert peaks(one("\r\n".join(lines)), "linear_acceleration") == pytest.approx(EXPECTED["linear_acceleration"])


def test_two_heads_of_one_file_are_two_impacts():
    columns = DTS_COLUMNS | {"13" + code[2:]: (unit, 2 * peak) for code, (unit, peak) in DTS_COLUMNS.items()}
    first, second = read(dts(columns))
    assert peaks(first, "linear_acceleration")[0] == 30.0
    assert peaks(second, "linear_acceleration")[0] == 60.0


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, None),
        ({"Number of Pts (Total)": [4000] * 6}, 4000),
        ({"Number of Pts (Total)": [], "Post-zero Data Pts": [SAMPLES - 10] * 6}, None),
        ({"Number of Pts (Total)": [], "Post-zero Data Pts": [SAMPLES - 11] * 6}, None),
        ({"Number of Pts (Total)": [], "Post-zero Data Pts": [3000] * 6}, 3010),
        ({"Number of Pts (Total)": ["many"] * 6}, None),
    ],
)
def test_a_file_that_has_fewer_samples_than_its_header_says_is_noted(changes, said):
    notes = [note for note in one(dts(changes=changes)).notes if note.code == "sample_count_mismatch"]
    assert len(notes) == (0 if said is None else 6)
    assert all(f"{SAMPLES} samples where its header says {said}" in note.detail for note in notes)


def test_other_channels_of_the_file_are_passed_over():
    columns = {"11CHST0000H3ACXC": ("g", 99.0), **DTS_COLUMNS, "": ("V", 1.0)}
    assert peaks(one(dts(columns)), "linear_acceleration")[0] == 30.0


def test_channels_without_iso_codes_are_read_with_a_mapping_by_their_names():
    plain = {f"X{n}": pair for n, pair in enumerate(DTS_COLUMNS.values())}
    file = dts(plain)
    assert "ISO code" in refused(file).detail
    mapping = Mapping.model_validate(
        {
            "linear_acceleration": {"unit": "g", "x": "X3", "y": "X4", "z": "X5"},
            "angular_velocity": {"unit": "deg/s", "x": "X2", "y": "X1", "z": "X0"},
        }
    )
    [short] = read(dts(plain, changes={"Number of Pts (Total)": [4000] * 6}), mapping=mapping)
    assert [(note.code, note.signal) for note in short.notes] == [("sample_count_mismatch", None)]
    for named in (None, "dts"):
        record = one(file, mapping=mapping, preset=named)
        assert record.notes == ()
        assert peaks(record, "angular_velocity") == pytest.approx(EXPECTED["angular_velocity"])
        assert (record.recording.axes, record.recording.pre_trigger_ms) == ("sae_j211", 0.5)


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"Sample Rate (Hz)": ["fast"] * 6}, "rates-differ"),
        ({"Sample Rate (Hz)": ["20000"] * 5 + ["10000"]}, "rates-differ"),
        ({"Engineering Unit": ["furlong"] * 6}, "unit-missing"),
        ({"Engineering Unit": ["deg/s"] * 3 + ["g", "g", "m/s^2"]}, "units-differ"),
    ],
)
def test_a_header_that_contradicts_itself_is_refused(changes, code):
    assert codes(refused(dts(changes=changes))) == [(None, code)]


def test_a_missing_value_is_422_with_its_place_and_filled_where_that_is_asked_for():
    lines = dts().split("\r\n")
    cells = lines[20].split(",")
    lines[20] = ",".join([*cells[:4], "", *cells[5:]])
    problem = refused("\r\n".join(lines))
    assert codes(problem) == [(None, "missing-sample")]
    assert "linear acceleration x has no value at sample 7" in problem.detail
    assert prepare(one("\r\n".join(lines), fill_gaps=True).recording).notes[0].code == "gaps_filled"
    lines[20] = ",".join([*cells[:4], "1,5x", *cells[5:]])
    assert refused("\r\n".join(lines)).status == 422


def test_a_spreadsheet_s_utf_16_is_read_too():
    plain, wide = one(dts()), one(dts().encode("utf-16"))
    np.testing.assert_array_equal(plain.recording.linear_acceleration.values, wide.recording.linear_acceleration.values)


def test_a_table_is_no_dts_file():
    assert not is_dts(csv_text().encode())
    assert not is_dts(b"Sample Num,Linear Acc x g\n1,2\n")
    assert is_dts(dts().encode())


def test_the_length_is_bounded():
    row = "0," * 5 + "0\r\n"
    assert codes(refused(dts(time_column=False) + row * 20_001)) == [(None, "sample-count")]
    head = "\r\n".join(dts().split("\r\n")[:13])
    assert refused(head).status == 422


@pytest.mark.parametrize(
    "file",
    [
        dts().replace("30.0", '"30.0', 1),
        dts() + "\0,1,2,3,4,5,6\r\n",
        dts() + "1" * 300_000,
        dts(time_column=False) + "1,2,3,4,5,6,7,8\r\n",
        dts(changes={"ISO Channel Code": []}),
        "Sample Rate (Hz),1\nISO Channel Code,x\n" + "word,1\n" * 300,
    ],
    ids=["quotes", "NUL", "line", "cells", "no codes", "no samples"],
)
def test_a_broken_file_is_refused(file):
    assert refused(file, preset="dts").status in {415, 422}


def test_more_heads_than_an_import_may_hold_are_413():
    columns = DTS_COLUMNS | {"13" + code[2:]: pair for code, pair in DTS_COLUMNS.items()}
    assert statuses(outcome(dts(columns), max_impacts=1)) == {413}


@given(st.dictionaries(st.integers(0, 3000), st.binary(max_size=4), min_size=1, max_size=6))
@settings(max_examples=80, deadline=None)
def test_any_damage_is_read_or_refused(damage):
    data = bytearray(dts().encode())
    for place, junk in damage.items():
        data[place : place + len(junk)] = junk
    assert statuses(outcome(bytes(data), preset="dts")) <= {413, 415, 422}
    assert statuses(outcome(bytes(data))) <= {413, 415, 422}


def test_a_wave_of_each_channel_is_its_own():
    recording = one(dts()).recording
    np.testing.assert_allclose(recording.angular_velocity.values[:, 2], half_sine(SAMPLES, np.degrees(-4.0)))


class TestKeys:
    """What a row of the header says, by its first cell."""

    @pytest.mark.parametrize(
        "row",
        [
            "Sample Rate Max (Hz),100000",
            "Sample Rate Requested (Hz),10000",
            "Unit System,Metric",
            "EU File,abc",
            "Description,Head drop",
            "Location,Hall 3",
        ],
    )
    def test_a_row_that_begins_like_another_is_not_taken_for_it(self, row):
        named = {"Channel Description": ["Head 1", "Head 2", "Head 3", "Head 4", "Head 5", "Head 6"]}
        text = dts(changes=named)
        record = one(f"{row}\r\n{text}")
        assert record.recording.angular_velocity.sample_rate_hz == 20_000.0
        np.testing.assert_array_equal(
            record.recording.linear_acceleration.values, one(text).recording.linear_acceleration.values
        )
        columns = {"unit": "g", "x": "Head 4", "y": "Head 5", "z": "Head 6"}
        uncoded = text.replace("ISO Channel Code", "Channel Code")
        mapped = one(
            f"{row}\r\n{uncoded}", preset="dts", mapping=Mapping.model_validate({"linear_acceleration": columns})
        )
        assert peaks(mapped, "linear_acceleration")[0] == 30.0

    def test_a_rate_may_be_in_kilohertz(self):
        text = dts(time_column=False).replace("Sample Rate (Hz)", "Sampling Rate (kHz)").replace("20000", "20")
        assert one(text).recording.angular_velocity.sample_rate_hz == 20_000.0

    def test_the_units_of_channels_without_codes_are_those_of_the_header(self):
        uncoded = dts().replace("ISO Channel Code", "Channel Code")
        named = {"x": "Head 4", "y": "Head 5", "z": "Head 6"}
        record = one(uncoded, preset="dts", mapping=Mapping.model_validate({"linear_acceleration": named}))
        assert record.recording.linear_acceleration.unit == "g"
        wrong = Mapping.model_validate({"linear_acceleration": named | {"unit": "m/s^2"}})
        assert codes(refused(uncoded, preset="dts", mapping=wrong))[0][1] == "units-differ"


def test_headings_in_another_order_than_the_codes_are_refused():
    text = dts()
    headings = ",".join(["Time (sec)", *DTS_COLUMNS])
    turned = ",".join(["Time (sec)", *reversed(DTS_COLUMNS)])
    assert headings in text
    assert codes(refused(text.replace(headings, turned))) == [(None, "heading-order")]


def test_a_time_before_the_trigger_counts_its_samples():
    text = dts(before=None, time_column=False, changes={"Pre Trigger (sec)": [0.0005], "Post-zero Points": [50]})
    text = text.replace("Number of Pts (Total)", "Points of the disk")
    assert one(text).notes == ()


class TestRateBesideTheFile:
    """A header that says no rate, as of an export that calls it something else."""

    SILENT = dts(time_column=False).replace("Sample Rate (Hz)", "Samples Per Second")

    @pytest.mark.parametrize("named", [None, "dts"])
    def test_no_rate_anywhere_is_refused_with_what_to_give(self, named):
        problem = refused(self.SILENT, preset=named)
        assert codes(problem) == [("sample_rate_hz", "rate-missing")]
        assert "give sample_rate_hz beside the file" in problem.detail
        assert codes(refused(dts(changes={"Sample Rate (Hz)": ["0"] * 6}))) == codes(problem)

    @pytest.mark.parametrize(
        "given",
        [
            {"sample_rate_hz": 20_000.0},
            {"mapping": Mapping(sample_rate_hz=20_000.0)},
            {"mapping": Mapping(sample_rate_hz=20_000.0), "sample_rate_hz": 20_000.0},
        ],
    )
    def test_a_rate_beside_the_file_or_of_a_mapping_counts(self, given):
        recording = one(self.SILENT, **given).recording
        assert recording.linear_acceleration.sample_rate_hz == 20_000.0
        assert recording.pre_trigger_ms == 0.5

    def test_it_counts_for_channels_that_a_mapping_names_too(self):
        uncoded = self.SILENT.replace("ISO Channel Code", "Channel Code")
        columns = {"x": "Head 4", "y": "Head 5", "z": "Head 6"}
        for rate in ({"sample_rate_hz": 20_000.0}, {"linear_acceleration": columns | {"sample_rate_hz": 20_000.0}}):
            mapping = Mapping.model_validate({"linear_acceleration": columns} | rate)
            recording = one(uncoded, preset="dts", mapping=mapping).recording
            assert (recording.linear_acceleration.sample_rate_hz, recording.pre_trigger_ms) == (20_000.0, 0.5)

    def test_a_column_of_times_must_go_on_at_it(self):
        timed = dts().replace("Sample Rate (Hz)", "Samples Per Second")
        assert one(timed, sample_rate_hz=20_000.0).recording.pre_trigger_ms == 0.5
        assert codes(refused(timed, sample_rate_hz=10_000.0)) == [(None, "rates-differ")]

    def test_another_rate_than_the_header_s_is_refused(self):
        uncoded = dts().replace("ISO Channel Code", "Channel Code")
        columns = {"x": "Head 4", "y": "Head 5", "z": "Head 6"}
        mapping = Mapping.model_validate({"linear_acceleration": columns, "sample_rate_hz": 10_000.0})
        assert codes(refused(uncoded, preset="dts", mapping=mapping)) == [("/sample_rate_hz", "rates-differ")]
        assert codes(refused(dts(), sample_rate_hz=10_000.0))[0][1] == "rate-differs"
        both = refused(self.SILENT, mapping=Mapping(sample_rate_hz=10_000.0), sample_rate_hz=20_000.0)
        assert codes(both) == [("/sample_rate_hz", "rates-differ")]
