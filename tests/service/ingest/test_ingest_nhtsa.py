"""NHTSA crash tests as zips: which channels make a head, and what their laboratory says of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ingest_files import codes, half_sine, one, outcome, read, refused, statuses, zipped

from headimpact.cut_offs import NO_FILTER, PAPER
from headimpact_service.errors import Problem
from headimpact_service.ingest.mapping import Mapping as ColumnMapping
from headimpact_service.ingest.record import ImpactRecord

CURVES = {1: ("AC", "XL"), 2: ("AC", "YL"), 3: ("AC", "ZL"), 101: ("AV", "XL"), 102: ("AV", "YL"), 103: ("AV", "ZL")}


def row(
    curve: int, sensor: str, axis: str, *, occupant: str = "01", at: str = "HDCG", status: str = "AM", mark: str = "P",
    unit: str | None = None, first: int = -10, last: int = 29, scale: str = "2000",
) -> str:  # fmt: skip
    units = unit or {"AC": "G'S", "AV": "DPS"}[sensor]
    return (
        f"1|{curve}|{sensor}|{occupant}|{at}|{axis}|SEC|{units}|2800|MFG: X|11/AUG/2026|{scale}|4|0.0|"
        f"{first}|{last}|100|{status}|{mark}|HEAD"
    )


def ev5(*rows: str, number: str = "10999", occupants: tuple[str, ...] = ("01",)) -> str:
    seats = [f"1|{seat}|" + "|".join(["H3", *["0"] * 29]) + "|140|77.7|92.7|41.0|x" for seat in occupants]
    head = f"# Source: NHTSA Vehicle Database - Test Number: {number}"
    parts = [head, "----- EV5 -----", "----- TEST -----", "V5|A TEST", "----- OCCUPANT -----", *seats]
    return "\r\n".join([*parts, "----- INSTRUMENTATION -----", *rows, "----- END -----", ""])


def curve(peak: float, samples: int = 40, first: int = -10) -> str:
    wave = half_sine(samples, peak)
    return "".join(f"{(first + i) * 1e-4:.6f}\t{value:.6f}\n" for i, value in enumerate(wave))


def rows(**changes: Any) -> list[str]:
    return [row(number, sensor, axis, **changes) for number, (sensor, axis) in CURVES.items()]


def files(folder: str = "v10999/", header: str | None = None, **extra: str) -> dict[str, str]:
    whole = {f"{folder}v10999.{number:03d}": curve(float(number)) for number in CURVES}
    return {f"{folder}v10999.EV5": header or ev5(*rows()), **whole, **extra}


def values(record: ImpactRecord, signal: str) -> np.ndarray:
    found: np.ndarray = getattr(record.recording, signal).values
    return found


@pytest.mark.parametrize("folder", ["", "v10999/", "a/b/c/d/"])
def test_a_crash_test_is_read_wherever_it_lies_in_the_zip(folder: str):
    record = one(zipped(files(folder)))
    recording = record.recording
    assert values(record, "linear_acceleration").max(axis=0).tolist() == [1.0, 2.0, 3.0]
    assert values(record, "angular_velocity").max(axis=0).tolist() == [101.0, 102.0, 103.0]
    assert recording.linear_acceleration is not None
    assert recording.angular_velocity is not None
    assert (recording.linear_acceleration.unit, recording.angular_velocity.unit) == ("g", "deg/s")
    assert recording.linear_acceleration.sample_rate_hz == recording.angular_velocity.sample_rate_hz == 10_000.0
    assert recording.linear_acceleration.declared_range == 2000.0
    assert recording.axes == "sae_j211"
    assert recording.low_pass is NO_FILTER
    assert recording.pre_trigger_ms == 1.0
    assert not record.unscorable


def test_the_laboratorys_own_hic_and_the_curves_are_kept():
    metadata = one(zipped(files())).metadata
    assert metadata["laboratory"] == {"hic": 140.0, "t1_ms": 77.7, "t2_ms": 92.7}
    assert metadata["test_number"] == "10999"
    assert metadata["curves"]["angular_velocity_z"] == 103
    assert (metadata["format"], metadata["occupant"]) == ("nhtsa", "01")


def test_fields_beside_the_zip_override_the_preset():
    record = one(zipped(files()), low_pass=PAPER, axes="anatomical", athlete="dummy", preset="nhtsa")
    assert record.recording.low_pass is PAPER
    assert record.recording.axes == "anatomical"
    assert record.athlete_external_id == "dummy"


def test_other_channels_and_files_make_no_difference():
    others = [
        row(4, "AC", "XL", at="CHST"),
        row(5, "AC", "RL"),
        "1|short|row",
        row(6, "AC", "XL").replace("AC|01", "FO|01"),
    ]
    extra = {"v10999/v10999.004": "not numbers", "v10999/readme.txt": "hello", "other/v10999.001": curve(99.0)}
    record = one(zipped(files(header=ev5(*others, *rows()), **extra)))
    assert values(record, "linear_acceleration").max(axis=0).tolist() == [1.0, 2.0, 3.0]


def test_every_occupant_with_head_channels_is_an_impact():
    second = [row(n + 200, sensor, axis, occupant="02") for n, (sensor, axis) in CURVES.items()]
    curves = {f"v10999/v10999.{n + 200}": curve(float(n + 200)) for n in CURVES}
    header = ev5(*second, *rows(), occupants=("01", "02"))
    driver, passenger = read(zipped(files(header=header, **curves)))
    assert isinstance(driver, ImpactRecord)
    assert isinstance(passenger, ImpactRecord)
    assert (driver.metadata["occupant"], passenger.metadata["occupant"]) == ("01", "02")
    assert values(passenger, "linear_acceleration").max(axis=0).tolist() == [201.0, 202.0, 203.0]
    with pytest.raises(Problem, match="at most 1 impacts"):
        read(zipped(files(header=header, **curves)), max_impacts=1)


def test_several_tests_in_one_zip_keep_their_own_curves():
    both = files("a/") | {name: text.replace("10999", "10998") for name, text in files("b/").items()}
    both["b/v10999.001"] = curve(55.0)
    first, second = read(zipped(both))
    assert isinstance(first, ImpactRecord)
    assert isinstance(second, ImpactRecord)
    assert values(first, "linear_acceleration").max() == 3.0
    assert values(second, "linear_acceleration").max() == 55.0
    assert second.metadata["test_number"] == "10998"


@pytest.mark.parametrize(("header", "curves"), [("v10999/", "v10999/tsv/"), ("ev5/", "tsv/"), ("a/ev5/", "a/tsv/x/")])
def test_curves_may_lie_in_a_folder_of_their_own(header: str, curves: str):
    apart = {
        (header if name.endswith("EV5") else curves) + name.removeprefix("v10999/"): text
        for name, text in files().items()
    }
    record = one(zipped(apart | {f"{curves}v20000.001": curve(55.0)}))
    assert values(record, "linear_acceleration").max(axis=0).tolist() == [1.0, 2.0, 3.0]


def test_tests_in_one_folder_are_told_apart_by_name():
    both = files("") | {name.replace("v10999", "v20000"): text for name, text in files("").items()}
    both["v20000.001"] = curve(55.0)
    first, second = read(zipped(both))
    assert isinstance(first, ImpactRecord)
    assert isinstance(second, ImpactRecord)
    assert values(first, "linear_acceleration").max() == 3.0
    assert values(second, "linear_acceleration").max() == 55.0


def test_a_channel_marked_invalid_makes_the_impact_unscorable_and_names_it():
    marked = [row(2, "AC", "YL", status="CF") if "|2|AC" in line else line for line in rows()]
    record = one(zipped(files(header=ev5(*marked))))
    assert len(record.unscorable) == 1
    assert "linear_acceleration y (curve 002)" in record.unscorable[0]
    assert "CF" in record.unscorable[0]
    assert record.recording.linear_acceleration is not None


def _with_status(status):
    marked = [row(2, "AC", "YL", status=status) if "|2|AC" in line else line for line in rows()]
    return one(zipped(files(header=ev5(*marked))))


@pytest.mark.parametrize("status", ["CF", "cf", "MD", "NO", "SF"])
def test_a_channel_that_its_laboratory_disowns_is_never_scored(status):
    record = _with_status(status)
    assert [status.upper() in reason for reason in record.unscorable] == [True]


@pytest.mark.parametrize(("status", "said"), [("QD", "questionable data"), ("XX", "XX, which is not known")])
def test_a_channel_of_which_its_laboratory_says_something_else_is_scored_with_a_warning(status, said):
    record = _with_status(status)
    assert record.unscorable == ()
    [note] = record.notes
    assert (note.code, note.signal, note.channel) == ("questionable_data", "linear_acceleration", "y")
    assert said in note.detail


@pytest.mark.parametrize("status", ["", "AM", "CM", "LN", "SC"])
def test_a_channel_that_its_laboratory_lets_stand_is_no_finding(status):
    record = _with_status(status)
    assert (record.unscorable, record.notes) == ((), ())


def test_a_valid_redundant_sensor_stands_in_for_an_invalid_one():
    header = ev5(
        *[row(2, "AC", "YL", status="CF") if "|2|AC" in line else line for line in rows()], row(7, "AC", "YL", mark="R")
    )
    record = one(zipped(files(header=header, **{"v10999/v10999.007": curve(70.0)})))
    assert not record.unscorable
    assert values(record, "linear_acceleration").max(axis=0).tolist() == [1.0, 70.0, 3.0]
    assert record.metadata["curves"]["linear_acceleration_y"] == 7


def test_the_primary_sensor_goes_before_a_redundant_one():
    header = ev5(row(7, "AC", "XL", mark="R"), *rows())
    record = one(zipped(files(header=header, **{"v10999/v10999.007": curve(70.0)})))
    assert record.metadata["curves"]["linear_acceleration_x"] == 1


def test_an_absent_curve_leaves_its_signal_out_and_is_named():
    whole = files()
    del whole["v10999/v10999.102"]
    record = one(zipped(whole))
    assert record.recording.angular_velocity is None
    [note] = record.notes
    assert (note.code, note.signal, note.channel) == ("channel_missing", "angular_velocity", "y")
    assert "curve 102" in note.detail


def test_an_invalid_channel_without_its_file_is_unscorable_on_the_signal_that_is_left():
    header = ev5(*[row(2, "AC", "YL", status="CF") if "|2|AC" in line else line for line in rows()])
    whole = files(header=header)
    del whole["v10999/v10999.002"]
    record = one(zipped(whole))
    assert record.recording.linear_acceleration is None
    assert record.recording.angular_velocity is not None
    assert record.unscorable


def test_no_complete_signal_is_refused():
    whole = {name: text for name, text in files().items() if not name.endswith(("001", "101"))}
    assert codes(refused(zipped(whole))) == [(None, "no-signal")]


def test_curves_of_different_windows_are_cut_to_what_they_share():
    wave = half_sine(40, 9.0)
    longer = "".join(f"{(i - 15) * 1e-4:.6f} {v:.6f}\n" for i, v in enumerate([*[0.0] * 5, *wave, *[0.0] * 5]))
    header = ev5(*[row(3, "AC", "ZL", first=-15, last=34) if "|3|AC" in line else line for line in rows()])
    record = one(zipped(files(header=header, **{"v10999/v10999.003": longer})))
    np.testing.assert_allclose(values(record, "linear_acceleration")[:, 2], wave, atol=1e-6)
    assert record.recording.pre_trigger_ms == 1.0


def test_signals_of_different_rates_keep_their_times_on_one_clock():
    wave = half_sine(100, 9.0)
    slow = "".join(f"{i * 2e-4 - 0.0004:.6f}\t{v:.6f}\n" for i, v in enumerate(wave))
    turned = {f"v10999/v10999.{n}": slow for n in (101, 102, 103)}
    header = ev5(*[line.replace("|-10|29|", "|-2|97|") if "|AV|" in line else line for line in rows()])
    recording = one(zipped(files(header=header, **turned))).recording
    assert recording.linear_acceleration is not None
    assert recording.angular_velocity is not None
    assert recording.linear_acceleration.time_s is not None
    assert recording.angular_velocity.time_s is not None
    assert recording.linear_acceleration.time_s[0] == pytest.approx(-0.001)
    assert recording.angular_velocity.time_s[0] == pytest.approx(-0.0004)
    assert recording.pre_trigger_ms == 1.0


def test_a_count_that_differs_from_the_header_is_noted():
    header = ev5(*[row(1, "AC", "XL", last=40) if "|1|AC" in line else line for line in rows()])
    [note] = one(zipped(files(header=header))).notes
    assert note.code == "sample_count_mismatch"
    assert "40 samples" in note.detail


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("", "sample-count"),
        ("0.0 1.0\n0.0001 2.0\n", "sample-count"),
        ("0.0 1.0\n0.0001\n", "missing-sample"),
        ("0.0 nan\n0.0001 1\n0.0002 1\n", "missing-sample"),
        ("0.0 1e400\n0.0001 1\n0.0002 1\n", "missing-sample"),
        ("0.0 1.0.0\n0.0001 1\n0.0002 1\n", "missing-sample"),
        ("0.0 1\n0.0001 1\n0.0001 1\n", "time-not-increasing"),
        ("0.0002 1\n0.0001 1\n0.0000 1\n", "time-not-increasing"),
        ("".join(f"{i * 1e-4} 0\n" for i in range(20_001)), "sample-count"),
        ("hello", "missing-sample"),
    ],
)
def test_a_curve_that_cannot_be_used_is_the_fault_of_its_occupant(text: str, code: str):
    problem = refused(zipped(files(**{"v10999/v10999.001": text})))
    assert problem.slug == "unreadable-file"
    assert codes(problem) == [(None, code)]
    assert "curve 001" in problem.detail


def test_units_that_are_not_known_for_a_channel_are_refused():
    header = ev5(*[row(1, "AC", "XL", unit="MPS") if "|1|AC" in line else line for line in rows()])
    assert codes(refused(zipped(files(header=header)))) == [(None, "unit-missing")]


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("", "no section INSTRUMENTATION"),
        ("----- INSTRUMENTATION -----\n", "no channel at a head's centre of gravity"),
        (ev5(*rows(at="CHST")), "no channel at a head's centre of gravity"),
        (ev5(row(1, "AC", "XL").replace("|1|AC", "|one|AC")), "no curve number"),
    ],
)
def test_a_header_that_names_no_head_is_refused(header: str, said: str):
    whole = files()
    whole["v10999/v10999.EV5"] = header
    assert said in refused(zipped(whole)).detail


def test_a_crash_test_takes_no_mapping_and_no_other_preset():
    for options in ({"preset": "swa"}, {"mapping": ColumnMapping.model_validate({})}):
        assert "takes no mapping" in refused(zipped(files()), **options).detail


lines = st.text(alphabet="|-ACDHGXYZL0123456789'. \nINSTRUMENTATION", max_size=200)


@settings(max_examples=100, deadline=None)
@given(header=lines, whole=st.booleans(), text=st.text(alphabet="0123456789.eE+- \t\n", max_size=100))
def test_any_header_and_curve_are_read_or_refused(header: str, whole: bool, text: str):
    content: Mapping[str, str] = {"a.EV5": ev5(*rows(), header) if whole else header, "a.001": text}
    items = outcome(zipped({**files(""), **content}))
    assert items
    assert statuses(items) <= {422}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"|100|AM": "|80|AM"}, "a step of 80 us where the curve's times step by 100 us"),
        ({"|-10|29|": "|0|39|"}, "a begin at 0 ms where the curve's times begin at -1 ms"),
    ],
)
def test_times_that_the_header_says_otherwise_are_noted_and_the_curves_own_count(change, said):
    header = ev5(*rows())
    for before, after in change.items():
        header = header.replace(before, after)
    record = one(zipped(files(header=header)))
    assert record.recording.pre_trigger_ms == 1.0
    assert {note.code for note in record.notes} == {"questionable_data"}
    assert all(said in note.detail for note in record.notes)


def test_a_supplied_resultant_is_compared_with_the_three_axes():
    resultant = np.linalg.norm([half_sine(40, float(number)) for number in (1, 2, 3)], axis=0)
    header = ev5(*rows(), row(7, "AC", "RS"))

    def notes(factor: float) -> list[str]:
        told = "".join(f"{(i - 10) * 1e-4:.6f}\t{value:.6f}\n" for i, value in enumerate(factor * resultant))
        return [note.code for note in one(zipped(files(header=header, **{"v10999/v10999.007": told}))).notes]

    assert notes(1.0) == []
    assert notes(1.2) == ["vendor_peak_mismatch"]
    assert one(zipped(files(header=header))).notes == ()
    assert one(zipped(files(header=header, **{"v10999/v10999.007": "no number"}))).notes == ()
    of_another = ev5(*rows(), row(7, "AC", "RS", occupant="02"))
    assert len(read(zipped(files(header=of_another)))) == 1
