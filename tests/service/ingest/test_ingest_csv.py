"""CSV files: what is read whatever the dialect, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ingest_files import GENERIC, codes, csv_text, one, outcome, read, refused, six_axis, statuses

from headimpact_service.errors import Problem
from headimpact_service.ingest import csv_format
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord, RefusedImpact

TIME = {"column": "t_s", "unit": "s"}


def samples_of(record: ImpactRecord) -> np.ndarray:
    recording = record.recording
    assert recording.linear_acceleration is not None
    assert recording.angular_velocity is not None
    return np.concatenate((recording.linear_acceleration.values, recording.angular_velocity.values), axis=1)


def test_a_table_is_read_to_the_last_bit():
    samples = np.random.default_rng(1).normal(size=(50, 6)) * 1e-3
    record = one(csv_text(samples))
    np.testing.assert_array_equal(samples_of(record), samples)
    assert record.recording.linear_acceleration is not None
    assert record.recording.linear_acceleration.sample_rate_hz == 1000.0
    assert record.metadata == {"format": "csv", "preset": "generic_six_axis"}


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("coding", ["utf-8", "utf-8-sig", "latin-1"])
def test_dialects_make_no_difference(delimiter: str, ending: str, coding: str):
    text = csv_text(delimiter=delimiter, heading=GENERIC.replace("ax_g", "Ax (g) "), before={"naïve": "é"})
    record = one(text.replace("\n", ending).encode(coding))
    np.testing.assert_array_equal(samples_of(record), six_axis())


def test_quotes_blank_lines_comments_and_empty_cells_at_the_end_are_passed_over():
    lines = csv_text().splitlines()
    quoted = [",".join(f'"{cell}"' for cell in line.split(",")) for line in lines]
    for text in (
        "\n".join(quoted),
        "# made by a laboratory\n\n" + "\n\n".join(lines) + "\n\n\n",
        "\n".join([lines[0], *(f"{line},," for line in lines[1:])]),
        "\n".join([*lines, "," * 6, " , ,,,,,"]),
        "\n".join([lines[0], *(line.replace(",", " , ") for line in lines[1:])]),
    ):
        np.testing.assert_array_equal(samples_of(one(text)), six_axis())


def test_a_quoted_heading_may_hold_the_separator():
    heading = csv_text(before={'"place, time"': '"Dublin, noon"'})
    np.testing.assert_array_equal(samples_of(one(heading)), six_axis())


@pytest.mark.parametrize(
    "above", ["Subject,17\nPeak,40.2,21.3\n", "A,B,C,D,E,F,G\n1,2,3,4,5,6,7\n\n", "Key,value\n" * 70]
)
def test_lines_above_that_hide_the_headings_are_refused_with_how_to_skip_them(above: str):
    problem = refused(above + csv_text())
    assert codes(problem) == [("mapping", "layout-unknown")]
    assert 'a mapping says how many: {"skip_rows": ' in problem.detail
    skipped = Mapping(skip_rows=above.count("\n"))
    np.testing.assert_array_equal(samples_of(one(above + csv_text(), mapping=skipped)), six_axis())
    wrong = refused(above + csv_text(), mapping=Mapping(skip_rows=0))
    assert "skip_rows" not in wrong.detail


def test_blocks_are_joined_in_order(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(csv_format, "ROWS_AT_ONCE", 7)
    samples = np.random.default_rng(2).normal(size=(50, 6))
    np.testing.assert_array_equal(samples_of(one(csv_text(samples))), samples)
    np.testing.assert_array_equal(samples_of(one(csv_text(samples, before={"label": '"a"'}))), samples)


def grouped(*names: str) -> str:
    parts = [csv_text(six_axis() * (1 + i), before={"external_id": name}) for i, name in enumerate(names)]
    return parts[0] + "".join(part.split("\n", 1)[1] for part in parts[1:])


def test_one_file_may_hold_several_impacts_in_the_order_in_which_they_begin():
    records = read(grouped("b", "a", "c"))
    assert [r.external_id for r in records if isinstance(r, ImpactRecord)] == ["b", "a", "c"]
    for number, record in enumerate(records):
        assert isinstance(record, ImpactRecord)
        np.testing.assert_array_equal(samples_of(record), six_axis() * (1 + number))


def test_interleaved_impacts_are_sorted_out():
    lines = grouped("a", "b").splitlines()
    mixed = [lines[0], *(line for pair in zip(lines[1:41], lines[41:], strict=True) for line in pair)]
    first, second = read("\n".join(mixed))
    assert isinstance(first, ImpactRecord)
    assert isinstance(second, ImpactRecord)
    np.testing.assert_array_equal(samples_of(first), six_axis())
    np.testing.assert_array_equal(samples_of(second), six_axis() * 2)


@pytest.mark.parametrize(
    "cell", ["", "nan", "NaN", "inf", "-Infinity", "1e400", "1_000", "١", "0x10", "NOVALUE", "1,5"]
)
def test_a_bad_cell_is_the_fault_of_its_own_impact(cell: str):
    lines = grouped("a", "b", "c").splitlines()
    row = lines[45].split(",")
    row[3] = f'"{cell}"' if "," in cell else cell
    lines[45] = ",".join(row)
    good, bad, last = read("\n".join(lines))
    assert isinstance(good, ImpactRecord)
    assert isinstance(last, ImpactRecord)
    assert isinstance(bad, Problem)
    assert isinstance(bad, RefusedImpact)
    assert bad.external_id == "b"
    assert (bad.slug, bad.errors[0].code) == ("unreadable-file", "missing-sample")
    assert "Column 4 (ay_g)" in bad.detail
    assert ("fill_gaps" in bad.detail) is (cell.lower() in {"", "nan"})
    assert "sample 4" in bad.detail
    assert "row 41" in bad.detail


@pytest.mark.parametrize("quote", ["", '"'])
def test_the_last_line_needs_no_end_though_it_names_its_impact(quote: str):
    lines = csv_text().splitlines()
    text = "\n".join([f"{lines[0]},external_id", *(f"{line},{quote}a{quote}" for line in lines[1:])])
    assert [record.external_id for record in read(text) if isinstance(record, ImpactRecord)] == ["a"]


@pytest.mark.parametrize(
    ("cell", "held"),
    [('"a"', "a"), ('"a,b"', "a,b"), ('"a""b"', 'a"b'), ('"a\nb"', None)],
)
def test_quotes_in_some_rows_change_nothing_in_the_others(cell: str, held: str | None, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(csv_format, "ROWS_AT_ONCE", 7)
    lines = csv_text().splitlines()
    rows = [f"{cell if number == 20 else 'plain'},{line}" for number, line in enumerate(lines[1:])]
    mapped = {"group_by": "label", "external_id": "label", "time": {"column": "t_s", "unit": "s"}}
    columns = {"linear_acceleration": {"unit": "g", "x": "ax_g", "y": "ay_g", "z": "az_g"}}
    found = read("\n".join([f"label,{lines[0]}", *rows]), mapping=Mapping.model_validate(mapped | columns))
    assert len(found) == 2
    first = found[0]
    assert isinstance(first, ImpactRecord)
    assert first.recording.linear_acceleration is not None
    assert first.recording.linear_acceleration.values.shape == (39, 3)
    assert (found[1].external_id if hasattr(found[1], "external_id") else None) == held


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_decimal_commas_between_other_separators_are_read(delimiter: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(csv_format, "ROWS_AT_ONCE", 7)
    text = csv_text(delimiter=delimiter, before={"label": "v1.5"})
    np.testing.assert_array_equal(samples_of(one(text.replace(".", ","))), six_axis())


def test_a_decimal_comma_beside_what_is_no_number_is_none():
    lines = csv_text(delimiter=";").replace(".", ",").splitlines()
    lines[4] += "\x1d"
    assert codes(refused("\n".join(lines)))[0][1] == "missing-sample"


def test_decimal_commas_in_quotes_are_read():
    lines = csv_text().splitlines()
    quoted = [",".join(f'"{cell}"' for cell in line.split(",")).replace(".", ",") for line in lines[1:]]
    np.testing.assert_array_equal(samples_of(one("\n".join([lines[0], *quoted]))), six_axis())


def test_a_comma_in_a_label_says_nothing_of_the_numbers():
    text = csv_text(delimiter=";", before={"label": "1,5"})
    np.testing.assert_array_equal(samples_of(one(text)), six_axis())


def test_commas_that_may_group_thousands_are_refused():
    lines = csv_text(np.arange(240.0).reshape(40, 6), rate_hz=0.001, delimiter=";").replace(".0", "").splitlines()
    lines[7] = lines[7].rsplit(";", 1)[0] + ";1,234"
    problem = refused("\n".join(lines))
    assert problem.slug == "unreadable-file"
    assert "group thousands" in problem.detail


def test_decimal_commas_beside_points_are_refused():
    lines = csv_text(delimiter=";").replace(".", ",").splitlines()
    lines[9] = lines[9].replace(",", ".", 1)
    assert "and points too" in refused("\n".join(lines)).detail


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_what_a_spreadsheet_calls_unicode_text_is_read(encoding: str):
    marks = {"utf-16": "", "utf-16-le": "\ufeff", "utf-16-be": "\ufeff"}
    text = csv_text(delimiter="\t", before={"athlete": "Zoë"})
    record = one((marks[encoding] + text).encode(encoding))
    assert record.athlete_external_id == "Zoë"
    np.testing.assert_array_equal(samples_of(record), six_axis())


@pytest.mark.parametrize("data", [b"\xff\xfea", b"\xff\xfe\x00\xd8a\x00", b"\xfe\xff" + b"\0a" * 400_000])
def test_broken_utf16_is_refused(data: bytes):
    assert refused(data).slug == "unreadable-file"


def test_a_line_that_names_the_separator_is_skipped():
    np.testing.assert_array_equal(samples_of(one("sep=;\r\n" + csv_text(delimiter=";"))), six_axis())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("\n\n\n", "empty"),
        ("# only a comment\n", "no line of headings"),
        (GENERIC, "no samples"),
        (GENERIC + "\n\n,,,,,,\n", "no samples"),
        ("one column\n1\n2\n", "separated by"),
        ("a,b;c\n1,2;3\n", "two separators"),
        (csv_text() + "1,2,3\n", "has 3 cells where the headings have 7"),
        (csv_text() + "1,2,3,4,5,6,7,8\n", "has 8 cells where the headings have 7"),
        (csv_text() + '"1,2,3\n', "quotes"),
        (csv_text() + '1,"2"2,3,4,5,6,7\n', "quotes"),
        (csv_text(np.zeros((5000, 6))) + "\0", "NUL"),
        (csv_text() + "1" * 300_000, "262144 bytes"),
        (",".join(f"c{i}" for i in range(1025)) + "\n", "1024 columns"),
        ("x,y\n1,2\n", "The columns of no signal were found"),
    ],
)
def test_a_file_that_cannot_be_read_says_why(text: str, said: str):
    problem = refused(text)
    assert problem.slug == "unreadable-file"
    assert said in problem.detail


def test_a_heading_too_long_for_a_mapping_says_nothing():
    long = GENERIC.replace("ax_g", "ax_g" + "é".upper() * 10 + "–" * 200)
    assert codes(refused(csv_text(heading=long)))[0][1] == "layout-unknown"
    longer = GENERIC.replace("ax_g", "ax_g" + "–" * 190)
    np.testing.assert_array_equal(samples_of(one(csv_text(heading=longer))), six_axis())


def test_a_single_impact_has_at_most_20000_samples():
    problem = refused(csv_text(np.zeros((20_001, 6))))
    assert "20000 samples" in problem.detail
    both = csv_text(np.ones((20_001, 6)), before={"external_id": "a"})
    assert refused(both).errors[0].code == "sample-count"


def test_the_number_of_impacts_is_bounded():
    assert refused(grouped("a", "b", "c"), max_impacts=2).slug == "import-too-large"


def test_no_time_and_no_rate_is_refused_and_a_rate_given_beside_is_taken():
    text = "\n".join(line.split(",", 1)[1] for line in csv_text().splitlines())
    problem = refused(text)
    assert codes(problem) == [("sample_rate_hz", "rate-missing")]
    recording = one(text, sample_rate_hz=2000.0).recording
    assert recording.angular_velocity is not None
    assert recording.angular_velocity.sample_rate_hz == 2000.0


def test_a_rate_given_beside_the_file_stands_for_times_that_go_on_at_it():
    recording = one(csv_text(), sample_rate_hz=1000.4).recording
    assert recording.linear_acceleration is not None
    assert recording.linear_acceleration.sample_rate_hz == 1000.4


@pytest.mark.parametrize(
    "options",
    [
        {"sample_rate_hz": 3200.0},
        {"mapping": Mapping(sample_rate_hz=3200.0)},
        {"mapping": Mapping.model_validate({"angular_velocity": {"sample_rate_hz": 3200, "time": TIME}})},
    ],
)
def test_a_rate_that_the_file_s_own_times_contradict_is_refused(options):
    problem = refused(csv_text(), **options)
    assert codes(problem) == [("sample_rate_hz", "rate-differs")]
    assert "3200" in problem.detail


def test_a_mapping_s_rate_that_the_rows_contradict_is_refused():
    text = csv_text(before={"sample_rate_hz": "1000"}).replace("t_s", "x")
    assert codes(refused(text, mapping=Mapping(sample_rate_hz=2000.0))) == [("sample_rate_hz", "rate-differs")]


def test_times_that_are_wrong_can_be_left_out_for_a_rate():
    recording = one(csv_text(), sample_rate_hz=3200.0, mapping=Mapping(time=None)).recording
    assert recording.linear_acceleration is not None
    assert recording.linear_acceleration.sample_rate_hz == 3200.0


def test_jittered_stamps_are_kept_from_the_first_one_on():
    stamps_us = 26_623_464 + 1000 * np.arange(40) + np.where(np.arange(40) % 3 == 1, 40, 0)
    lines = csv_text(heading=GENERIC.replace("t_s", "TimeStamp(Micosecond)")).splitlines()
    rows = [f"{stamp},{line.split(',', 1)[1]}" for stamp, line in zip(stamps_us, lines[1:], strict=True)]
    signal = one("\n".join([lines[0], *rows])).recording.linear_acceleration
    assert signal is not None
    assert signal.sample_rate_hz is None
    np.testing.assert_allclose(signal.time_s, (stamps_us - stamps_us[0]) / 1e6, rtol=1e-15, atol=0)


def test_times_from_before_zero_to_after_it_count_from_the_trigger():
    lines = csv_text(heading=GENERIC.replace("t_s", "t_ms")).splitlines()
    rows = [f"{index - 10},{line.split(',', 1)[1]}" for index, line in enumerate(lines[1:])]
    assert one("\n".join([lines[0], *rows])).recording.pre_trigger_ms == 10.0
    assert one(csv_text()).recording.pre_trigger_ms is None


def test_fields_beside_the_file_override_what_is_in_it():
    text = csv_text(before={"external_id": "e", "athlete_id": "p-1", "device_serial": "d-1"})
    record = one(text)
    assert (record.external_id, record.athlete_external_id, record.device_serial) == ("e", "p-1", "d-1")
    record = one(text, athlete="p-2", device="d-2", axes="sae_j211", filename="x.csv")
    assert (record.athlete_external_id, record.device_serial) == ("p-2", "d-2")
    assert record.recording.axes == "sae_j211"
    assert record.metadata["file"] == "x.csv"


def test_names_in_cells_are_bounded_and_printable():
    assert codes(refused(csv_text(before={"external_id": "e" * 201}))) == [("external_id", "name-form")]
    assert codes(refused(csv_text(before={"athlete": "p\x07"}))) == [("athlete", "name-form")]


@settings(max_examples=150, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(text=st.text(alphabet='0123456789.,;-+eE"\n\r\t _#nax\0é', max_size=300), headed=st.booleans())
def test_any_text_is_read_or_refused(text: str, headed: bool):
    assert statuses(outcome(GENERIC + "\n" + text if headed else text)) <= {413, 415, 422}


@settings(max_examples=150, deadline=None)
@given(data=st.binary(max_size=300))
def test_any_bytes_are_read_or_refused(data: bytes):
    assert statuses(outcome(data)) <= {413, 415, 422}


@settings(max_examples=60, deadline=None)
@given(
    values=st.lists(
        st.lists(st.floats(-1e3, 1e3, allow_subnormal=False), min_size=6, max_size=6), min_size=3, max_size=30
    ),
    quote=st.booleans(),
)
def test_whatever_numbers_are_written_come_back(values: list[list[float]], quote: bool):
    samples = np.array(values)
    labels = {"label": '"x"'} if quote else None
    np.testing.assert_array_equal(samples_of(one(csv_text(samples, before=labels))), samples)


@pytest.mark.parametrize(("samples", "helps"), [((7,), "fill_gaps"), ((7, 8), "fill_gaps"), ((7, 8, 9), ".")])
def test_a_gap_names_what_helps_against_it(samples: tuple[int, ...], helps: str):
    lines = csv_text().splitlines()
    for sample in samples:
        lines[sample + 1] = ",".join([lines[sample + 1].split(",")[0], *[""] * 6])
    problem = refused("\n".join(lines))
    assert codes(problem) == [(None, "missing-sample")]
    assert helps in problem.detail.partition("headings")[2]
    assert ("fill_gaps" in problem.detail) is (helps == "fill_gaps")
    if helps == "fill_gaps":
        assert one("\n".join(lines), fill_gaps=True).recording.fill_gaps


@pytest.mark.parametrize("samples", [range(5), range(35, 40), range(39, 40)])
def test_a_signal_that_is_shorter_than_its_rows_is_told_to_be_cut(samples: range):
    lines = csv_text().splitlines()
    for sample in samples:
        lines[sample + 1] = ",".join([*lines[sample + 1].split(",")[:4], *[""] * 3])
    problem = refused("\n".join(lines))
    assert codes(problem) == [(None, "missing-sample")]
    assert problem.detail.endswith(": leave out the samples at the record's edge that lack it.")
    assert "(wx_rad_s)" in problem.detail
    kept = [line for number, line in enumerate(lines) if number - 1 not in samples]
    assert one("\n".join(kept)).recording.angular_velocity is not None


def test_a_time_that_is_missing_is_none_that_can_be_filled():
    lines = csv_text().splitlines()
    lines[8] = ",".join(["", *lines[8].split(",")[1:]])
    problem = refused("\n".join(lines))
    assert "Column 1 (t_s)" in problem.detail
    assert "fill_gaps" not in problem.detail


def test_a_file_without_headings_is_told_so():
    problem = refused("\n".join(csv_text().splitlines()[1:]))
    assert problem.detail == "The file begins with numbers: write headings above its columns."


def test_an_axis_that_holds_nothing_at_all_is_told_so():
    heading, *lines = csv_text().splitlines()
    empty = [",".join([*line.split(",")[:3], "", *line.split(",")[4:]]) for line in lines]
    assert "three axes are needed" in refused("\n".join([heading, *empty])).detail
