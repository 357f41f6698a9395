"""Mappings and presets: columns to signals, without a guess at any unit."""

from __future__ import annotations

import json
from contextlib import suppress
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ingest_files import GENERIC, codes, csv_text, half_sine, one, outcome, read, refused, six_axis, statuses

from headimpact.errors import TraceError
from headimpact.preparation import prepare
from headimpact.recording import Signal
from headimpact_service.errors import Problem
from headimpact_service.ingest.headings import Headings, Vocabulary, compact
from headimpact_service.ingest.mapping import Mapping, merge
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.presets import list_presets, presets, recognise
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.intake.scoring import UNKNOWN_DEVICE, Scored, Terms, score_records

MAPPED = {
    "linear_acceleration": {"unit": "m/s^2", "x": "front", "y": "-right", "z": ["up", "top"]},
    "time": {"column": "clock", "unit": "ms"},
}


def mapping(document: dict[str, Any]) -> Mapping:
    return Mapping.model_validate(document)


def table(heading: str, columns: int | None = None) -> str:
    """A CSV with these headings: times [ms] in the first column, pulses of rising height in the others."""
    count = len(heading.split(",")) if columns is None else columns
    waves = np.stack([np.arange(40.0), *(half_sine(peak=float(i)) for i in range(1, count))], axis=1)
    return "\n".join([heading, *(",".join(map(repr, row)) for row in waves.tolist())])


def untimed(text: str) -> str:
    return "\n".join(line.split(",", 1)[1] for line in text.splitlines())


def peaks(signal: Signal | None) -> list[float]:
    assert signal is not None
    strongest = np.abs(signal.values).argmax(axis=0)
    return signal.values[strongest, range(3)].tolist()


def test_a_mapping_gives_each_component_its_column_sign_and_unit():
    record = one(table("clock,front,right,top"), mapping=mapping(MAPPED))
    signal = record.recording.linear_acceleration
    assert signal is not None
    assert (signal.unit, signal.sample_rate_hz) == ("m/s^2", 1000.0)
    assert peaks(signal) == [1.0, -2.0, 3.0]
    assert record.recording.angular_velocity is None
    assert record.metadata == {"format": "csv"}


def test_a_mapping_may_set_everything_else():
    document = MAPPED | {
        "axes": "sae_j211",
        "filter": {"linear_acceleration": "CFC180"},
        "pre_trigger_ms": 5,
        "constrained_plane": "sagittal",
        "drop_rows": 2,
        "skip_rows": 3,
        "location": "sensor",
        "mounting": {"accelerometer": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "offset_mm": [70, 0, 0]}},
    }
    record = one("a,b,c\nd\n\n" + table("clock,front,right,up"), mapping=mapping(document))
    recording = record.recording
    assert recording.axes == "sae_j211"
    assert recording.low_pass.linear_acceleration == "CFC180"
    assert recording.pre_trigger_ms == 3.0  # of 5 ms before the trigger the first two samples were dropped
    assert recording.constrained_plane == "sagittal"
    assert recording.mounting is not None
    assert recording.linear_acceleration is not None
    assert recording.linear_acceleration.values.shape == (38, 3)
    assert [note.code for note in record.notes] == ["edge_glitch"]


def test_a_sensor_without_mounting_waits_for_its_device():
    record = one(table("clock,front,right,up"), mapping=mapping(MAPPED | {"location": "sensor"}))
    assert record.needs_device_mounting


def test_a_rate_may_stand_in_the_mapping():
    document = {"linear_acceleration": MAPPED["linear_acceleration"], "sample_rate_hz": 2000}
    signal = one(table("clock,front,right,up"), mapping=mapping(document)).recording.linear_acceleration
    assert signal is not None
    assert signal.sample_rate_hz == 2000.0


def test_impacts_are_told_apart_by_several_columns():
    rows = table("clock,front,right,up").splitlines()
    labels = [("s1", "1"), ("s1", "2"), ("s2", "1")]
    lines = ["session,number," + rows[0], *(f"{s},{n},{row}" for s, n in labels for row in rows[1:])]
    document = MAPPED | {"group_by": ["session", "number"], "session_id": "session", "athlete": "number"}
    records = read("\n".join(lines), mapping=mapping(document))
    found = [(r.context["session_id"], r.athlete_external_id) for r in records if isinstance(r, ImpactRecord)]
    assert found == labels


@pytest.mark.parametrize(
    ("document", "fault"),
    [
        (MAPPED | {"time": {"column": "nowhere", "unit": "s"}}, ("/time", "column-missing")),
        (MAPPED | {"group_by": "nowhere"}, ("/group_by", "column-missing")),
        (MAPPED | {"external_id": "nowhere"}, ("/external_id", "column-missing")),
        (MAPPED | {"occurred_at": "nowhere"}, ("/occurred_at", "column-missing")),
        (MAPPED | {"occurred_at": {"date": "front", "time": "nowhere"}}, ("/occurred_at", "column-missing")),
        (
            MAPPED | {"angular_velocity": {"unit": "rad/s", "x": "a", "y": "b", "z": "c"}},
            ("/angular_velocity/x", "column-missing"),
        ),
        (
            {"linear_acceleration": {"unit": "g", "x": "front", "y": "right"}, "sample_rate_hz": 1000},
            ("/linear_acceleration/z", "column-missing"),
        ),
        (
            {"linear_acceleration": {"x": "front", "y": "right", "z": "up"}, "sample_rate_hz": 1000},
            ("/linear_acceleration/unit", "unit-missing"),
        ),
    ],
)
def test_what_a_mapping_names_must_be_there(document: dict[str, Any], fault: tuple[str, str]):
    problem = refused(table("clock,front,right,up"), mapping=mapping(document))
    assert problem.status == 422
    assert codes(problem) == [fault]
    assert problem.errors[0].parameter == "mapping"


def test_two_columns_of_one_heading_are_refused_where_they_are_needed():
    assert codes(refused(table("clock,front,right,up,up"), mapping=mapping(MAPPED))) == [("mapping", "heading-twice")]
    one(table("clock,front,right,up,spare,spare"), mapping=mapping(MAPPED))


def test_a_heading_as_written_wins_over_a_looser_match():
    record = one(table("clock,FRONT,front,right,up"), mapping=mapping(MAPPED))
    assert peaks(record.recording.linear_acceleration) == [2.0, -3.0, 4.0]


def test_a_plane_alone_makes_headings_of_single_axes_known():
    text = table("t_ms,ax_g,az_g,wy_rad_s")
    problem = refused(text)
    assert codes(problem) == [("mapping", "layout-unknown")]
    assert "the columns ax_g, az_g, wy_rad_s are some of them" in problem.detail
    assert '{"constrained_plane": "sagittal"}' in problem.detail
    recording = one(text, mapping=mapping({"constrained_plane": "sagittal"})).recording
    assert peaks(recording.linear_acceleration) == [1.0, 0.0, 2.0]
    assert peaks(recording.angular_velocity) == [0.0, 3.0, 0.0]
    other = refused(text, mapping=mapping({"constrained_plane": "coronal"}))
    assert codes(other) == [("/linear_acceleration/y", "column-missing")]


def test_a_column_may_say_the_plane_of_each_impact():
    def rows(plane: str, name: str) -> list[str]:
        return [f"{name},{plane},{n},{n % 7},{n % 5},{n % 3}" for n in range(40)]

    heading = "impact_id,constrained_plane,t_ms,ax_g,az_g,wy_rad_s"
    text = "\n".join([heading, *rows("sagittal", "1"), *rows("coronal", "2"), *rows("", "3")])
    found = score_records(
        [(record, UNKNOWN_DEVICE) for record in read(text) if isinstance(record, ImpactRecord)], Terms()
    )
    assert isinstance(found[0], Scored)
    assert found[0].record.recording.constrained_plane == "sagittal"
    assert [isinstance(one, Problem) and one.errors[0].pointer for one in found[1:]] == [
        "/kinematics/linear_acceleration/y",
        "/kinematics/constrained_plane",
    ]


def test_a_constrained_plane_needs_only_its_own_columns():
    document = {
        "angular_velocity": {"unit": "rad/s", "y": "front"},
        "constrained_plane": "sagittal",
        "sample_rate_hz": 1000,
    }
    signal = one(table("clock,front"), mapping=mapping(document)).recording.angular_velocity
    assert signal is not None
    assert not signal.values[:, [0, 2]].any()
    assert signal.values[:, 1].max() == pytest.approx(1.0)


@pytest.mark.parametrize(
    "heading",
    [
        "t_ms,ax_g,ay_g,az_g,wx_rad_s,wy_rad_s,wz_rad_s",
        "Time (ms),Ax (g),Ay(g),Az [g],Wx (rad/s),Wy(rad/s),WZ [rad/s]",
        "t.ms,acc_x_g,acc_y_g,acc_z_g,gyro_x_rad/s,gyro_y_rad/s,gyro_z_rad/s",
        "TIME_MS,Linear Acc x g,Linear Acc y g,Linear Acc z g,"
        "Angular Vel x rad/s,Angular Vel y rad/s,Angular Vel z rad/s",
        "t ms,X Axis Linear Accel (g),Y Axis Linear Accel (g),Z Axis Linear Accel (g),"
        "X Rotational Velocity (rad/s),Y Rotational Velocity (rad/s),Z Rotational Velocity (rad/s)",
        "time[ms],accel.x[g],accel.y[g],accel.z[g],omega.x[rad/sec],omega.y[rad/sec],omega.z[rad/sec]",
    ],
)
def test_headings_that_name_quantity_axis_and_unit_need_no_mapping(heading: str):
    record = one(table(heading))
    recording = record.recording
    assert recording.linear_acceleration is not None
    assert recording.angular_velocity is not None
    assert (recording.linear_acceleration.unit, recording.angular_velocity.unit) == ("g", "rad/s")
    assert recording.linear_acceleration.sample_rate_hz == 1000.0
    assert peaks(recording.linear_acceleration) == [1.0, 2.0, 3.0]
    assert peaks(recording.angular_velocity) == [4.0, 5.0, 6.0]


@pytest.mark.parametrize(
    ("spelling", "signal", "unit"),
    [
        ("a{}_m_s2", "linear_acceleration", "m/s^2"),
        ("a{} (m/s²)", "linear_acceleration", "m/s^2"),
        ("a{} (m/s^2)", "linear_acceleration", "m/s^2"),
        ("w{} (deg/s)", "angular_velocity", "deg/s"),
        ("w{} (°/s)", "angular_velocity", "deg/s"),
        ("W{} (dps)", "angular_velocity", "deg/s"),
        ("G{}_rad_s", "angular_velocity", "rad/s"),
        ("al{}_rad_s2", "angular_acceleration", "rad/s^2"),
        ("alpha_{}_deg/s^2", "angular_acceleration", "deg/s^2"),
    ],
)
def test_units_are_read_from_headings_in_their_spellings(spelling: str, signal: str, unit: str):
    heading = ",".join(["t_ms", *(spelling.format(axis) for axis in "xyz")])
    found = getattr(one(table(heading)).recording, signal)
    assert found.unit == unit
    assert peaks(found) == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(("name", "factor"), [("t_s", 1.0), ("t_ms", 1e3), ("t_us", 1e6), ("time (µs)", 1e6)])
def test_the_unit_of_time_is_read_from_its_heading(name: str, factor: float):
    text = csv_text(heading=GENERIC.replace("t_s", name), rate_hz=1000.0 / factor)
    signal = one(text).recording.linear_acceleration
    assert signal is not None
    assert signal.sample_rate_hz == 1000.0


def test_headings_without_a_unit_are_refused_and_completed_by_a_mapping():
    text = table("t_ms,ax,ay,az,wx,wy,wz")
    problem = refused(text)
    assert problem.slug == "unreadable-file"
    assert codes(problem) == [("/linear_acceleration/unit", "unit-missing")]
    units = {"linear_acceleration": {"unit": "g"}, "angular_velocity": {"unit": "deg/s"}}
    recording = one(text, mapping=mapping(units)).recording
    assert recording.angular_velocity is not None
    assert recording.angular_velocity.unit == "deg/s"


def test_a_time_without_a_unit_is_no_time():
    assert codes(refused(table("time,ax_g,ay_g,az_g"))) == [("sample_rate_hz", "rate-missing")]


def test_components_in_two_units_are_refused():
    assert codes(refused(table("t_ms,ax_g,ay_m_s2,az_g"))) == [("/linear_acceleration/unit", "units-differ")]


def test_two_columns_for_one_component_are_refused():
    assert codes(refused(table("t_ms,ax_g,acc_x_g,ay_g,az_g"))) == [("/linear_acceleration", "heading-twice")]


PRESET_TABLES = {
    "headsport": "t_s,GX_rad_s,GY_rad_s,GZ_rad_s,AX_g,AY_g,AZ_g",
    "prevent": "t.ms,PAA.X.radsec^2,PAA.Y.radsec^2,PAA.Z.radsec^2,PAA.R.radsec^2,PAV.X.radsec,PAV.Y.radsec,"
    "PAV.Z.radsec,PAV.R.radsec,PLA.X.msec^2,PLA.Y.msec^2,PLA.Z.msec^2,PLA.R.msec^2",
    "athlete_intelligence": "Linear Accel X (g),Linear Accel Y (g),Linear Accel Z (g),Rotational Accel X (rad/s^2),"
    "Rotational Accel Y (rad/s^2),Rotational Accel Z (rad/s^2),Rotational Vel X (rad/s),Rotational Vel Y (rad/s),"
    "Rotational Vel Z (rad/s)",
    "biocore": "time_ms,Ah_x,Ah_y,Ah_z,ALP_x,ALP_y,ALP_z,W_x,W_y,W_z",
    "imperial": "t(ms),LinAccX,LinAccY,LinAccZ,RotVelX,RotVelY,RotVelZ,RotAccX,RotAccY,RotAccZ",
}


def test_a_prevent_file_is_recognised_in_metres_per_second_squared():
    for heading in (PRESET_TABLES["prevent"], PRESET_TABLES["prevent"].replace(".", "_").replace("^", "_")):
        record = one(table(heading))
        assert record.metadata["preset"] == "prevent"
        recording = record.recording
        assert recording.linear_acceleration is not None
        assert (recording.linear_acceleration.unit, recording.linear_acceleration.sample_rate_hz) == ("m/s^2", 1000.0)
        assert peaks(recording.angular_acceleration) == [1.0, 2.0, 3.0]
        assert peaks(recording.angular_velocity) == [5.0, 6.0, 7.0]
        assert peaks(recording.linear_acceleration) == [9.0, 10.0, 11.0]


def test_an_athlete_intelligence_file_needs_its_rate():
    text = untimed(table("t," + PRESET_TABLES["athlete_intelligence"]))
    assert codes(refused(text)) == [("sample_rate_hz", "rate-missing")]
    record = one(text, sample_rate_hz=1000.0)
    assert record.metadata["preset"] == "athlete_intelligence"
    assert peaks(record.recording.linear_acceleration) == [1.0, 2.0, 3.0]
    assert peaks(record.recording.angular_velocity) == [7.0, 8.0, 9.0]


def test_a_biocore_file_has_no_units_in_it_and_is_read_only_by_name():
    text = table(PRESET_TABLES["biocore"])
    assert refused(text).slug == "unreadable-file"
    recording = one(text, preset="biocore").recording
    assert recording.linear_acceleration is not None
    assert recording.linear_acceleration.unit == "m/s^2"
    assert peaks(recording.angular_acceleration) == [4.0, 5.0, 6.0]


def test_the_preset_whose_columns_these_are_is_named_and_no_signal_of_it_is_passed_over():
    text = table(PRESET_TABLES["biocore"])
    assert "preset biocore" in refused(text).detail
    units = {"angular_velocity": {"unit": "rad/s"}, "angular_acceleration": {"unit": "rad/s^2"}}
    assert "preset biocore" in refused(text, mapping=mapping({"angular_velocity": {"unit": "rad/s"}})).detail
    problem = refused(text, mapping=mapping(units))
    assert codes(problem) == [("/linear_acceleration", "columns-not-read")]
    assert "Ah_x, Ah_y, Ah_z" in problem.detail
    assert "preset biocore" in problem.detail
    assert (
        "preset"
        not in refused(text.replace("Ah_", "Bh_").replace("ALP", "XY")).detail.rpartition("nor in the preset")[2]
    )
    assert "preset imperial" in refused(table(PRESET_TABLES["imperial"])).detail


def test_an_imperial_file_needs_its_units_beside_the_preset():
    text = table(PRESET_TABLES["imperial"])
    assert codes(refused(text, preset="imperial")) == [("/linear_acceleration/unit", "unit-missing")]
    units = {
        "linear_acceleration": {"unit": "g"},
        "angular_velocity": {"unit": "rad/s"},
        "angular_acceleration": {"unit": "rad/s^2"},
    }
    record = one(text, preset="imperial", mapping=mapping(units))
    assert record.metadata["preset"] == "imperial"
    assert peaks(record.recording.angular_velocity) == [4.0, 5.0, 6.0]


SWA = (
    "Date,Time,Session ID,Player ID,Sensor ID,Impact ID,Sample Num,Linear Acc x g,Linear Acc y g,Linear Acc z g,"
    "Linear Acc Mag g,Angular Vel x rad/s,Angular Vel y rad/s,Angular Vel z rad/s,Angular Vel Mag rad/s,"
    "Angular Acc x rad/s2,Angular Acc y rad/s2,Angular Acc z rad/s2,Angular Acc Mag rad/s2"
)


def swa(*impacts: str, date: str = "2026-11-20", time: str = "19:04:05.123") -> str:
    waves = np.stack([half_sine(peak=float(i)) for i in range(1, 13)], axis=1)
    rows = [SWA]
    for impact in impacts:
        for number, row in enumerate(waves.tolist()):
            rows.append(f"{date},{time},s-1,p-9,sensor-3,{impact},{number}," + ",".join(map(repr, row)))
    return "\n".join(rows)


def test_an_swa_file_holds_several_impacts_and_needs_its_rate():
    assert codes(refused(swa("1"), time_zone="UTC")) == [("sample_rate_hz", "rate-missing")]
    records = read(swa("1", "2"), sample_rate_hz=1000.0, time_zone="Europe/London")
    assert len(records) == 2
    for record, number in zip(records, "12", strict=True):
        assert isinstance(record, ImpactRecord)
        assert record.metadata["preset"] == "swa"
        assert record.metadata["impact"].split()[-1] == number
        assert (record.athlete_external_id, record.device_serial) == ("p-9", "sensor-3")
        assert record.context == {"session_id": "s-1"}
        assert record.occurred_at == datetime(2026, 11, 20, 19, 4, 5, 123000, tzinfo=UTC)
        assert peaks(record.recording.linear_acceleration) == [1.0, 2.0, 3.0]
        assert peaks(record.recording.angular_velocity) == [5.0, 6.0, 7.0]
        assert peaks(record.recording.angular_acceleration) == [9.0, 10.0, 11.0]


def test_an_swa_files_broken_time_must_be_given_beside_it():
    problem = refused(swa("1", time="37:10.6"), sample_rate_hz=1000.0, time_zone="Europe/London")
    assert codes(problem) == [("occurred_at", "not-a-time")]
    assert "give occurred_at beside the file" in problem.detail
    when = datetime(2026, 11, 20, tzinfo=UTC)
    assert one(swa("1", time="37:10.6"), sample_rate_hz=1000.0, occurred_at=when).occurred_at == when


def test_an_swa_file_that_lacks_a_signal_is_one_all_the_same():
    lines = [line.rsplit(",", 4)[0] for line in swa("1", "2").split("\n")]
    first, second = read("\n".join(lines), sample_rate_hz=1000.0, time_zone="UTC")
    for record in (first, second):
        assert (record.metadata["preset"], record.device_serial, record.athlete_external_id) == (
            "swa",
            "sensor-3",
            "p-9",
        )
        assert [name for name, _ in record.recording.signals()] == ["linear_acceleration", "angular_velocity"]


def swa_without(*numbers: int) -> str:
    lines = swa("1").split("\n")
    return "\n".join(line for place, line in enumerate(lines, -1) if place not in numbers)


def test_a_sample_that_an_swa_files_own_numbers_leave_out_is_refused_unless_it_may_be_filled():
    stated = {"sample_rate_hz": 1000.0, "time_zone": "UTC"}
    whole, without = one(swa("1"), **stated), swa_without(7)
    problem = refused(without, **stated)
    assert codes(problem) == [(None, "sample-order")]
    assert "Sample 8 follows sample 6" in problem.detail
    filled = one(without, fill_gaps=True, **stated).recording
    motion = prepare(filled)
    assert [note.code for note in motion.notes if note.code == "gaps_filled"]
    assert motion.kinematics.samples == whole.recording.linear_acceleration.values.shape[0]
    with pytest.raises(TraceError, match="steps between time stamps"):  # too many to fill
        prepare(one(swa_without(*range(7, 12)), fill_gaps=True, **stated).recording)


def test_rows_that_an_swa_files_own_numbers_have_in_another_order_are_refused():
    heading, *rows = swa("1").split("\n")
    for fill_gaps in (False, True):
        problem = refused(
            "\n".join([heading, *rows[20:], *rows[:20]]), sample_rate_hz=1000.0, time_zone="UTC", fill_gaps=fill_gaps
        )
        assert codes(problem) == [(None, "sample-order")]
        assert "Sample 0 follows sample" in problem.detail
    doubled = refused("\n".join([heading, rows[0], *rows]), sample_rate_hz=1000.0, time_zone="UTC")
    assert "Sample 0 follows sample 0" in doubled.detail


def test_an_swa_files_local_time_needs_a_zone():
    assert codes(refused(swa("1"), sample_rate_hz=1000.0)) == [("occurred_at", "offset-missing")]


@pytest.mark.parametrize(
    "columns",
    [
        ["wx (mdps)", "wy (mdps)", "wz (mdps)"],
        ["Gyro X [rpm]", "Gyro Y [rpm]", "Gyro Z [rpm]"],
        ["ωx (krad/s)", "ωy (krad/s)", "ωz (krad/s)"],
        ["x rotational velocity filtered", "y rotational velocity filtered", "z rotational velocity filtered"],
    ],
)
def test_columns_that_seem_to_be_a_signal_are_never_passed_over(columns):
    text = table(",".join(["t_ms,ax_g,ay_g,az_g", *columns]))
    problem = refused(text)
    assert codes(problem) == [("/angular_velocity", "columns-not-read")]
    assert columns[0] in problem.detail
    only = {"linear_acceleration": {"unit": "g", "x": "ax_g", "y": "ay_g", "z": "az_g"}}
    record = one(text, mapping=mapping(only | {"time": {"column": "t_ms", "unit": "ms"}}))
    assert record.recording.angular_velocity is None


@pytest.mark.parametrize("again", ["ax_cg (g),ay_cg (g),az_cg (g)", "ax_filt (g),ay_filt (g),az_filt (g)"])
def test_a_second_set_of_a_signal_is_noted(again: str):
    [note] = one(table(f"t_ms,ax (g),ay (g),az (g),wx_rad_s,wy_rad_s,wz_rad_s,{again}")).notes
    assert (note.code, note.severity, note.signal) == ("channel_given_twice", "note", "linear_acceleration")
    assert again.replace(",", ", ") in note.detail


def test_three_axes_of_a_quantity_that_nobody_tells_are_noted_where_a_signal_is_missing():
    gyroscope, head = "t_ms,wx_rad_s,wy_rad_s,wz_rad_s", "HEAD CG X,HEAD CG Y,HEAD CG Z"
    [note] = one(table(f"{gyroscope},{head}")).notes
    assert (note.code, note.severity) == ("channel_missing", "note")
    assert "HEAD CG X, HEAD CG Y, HEAD CG Z have three axes and were not read" in note.detail
    assert one(table(f"{gyroscope},ax_g,ay_g,az_g,{head}")).notes == ()
    assert one(table(f"{gyroscope},HEAD CG X,HEAD CG Y")).notes == ()


@pytest.mark.parametrize(
    ("columns", "signal"),
    [
        ("Acceleration AP (g),Acceleration ML (g),Acceleration SI (g)", "linear_acceleration"),
        ("a1 (g),a2 (g),a3 (g)", "linear_acceleration"),
        ("Head AX,Head AY,Head AZ", "linear_acceleration"),
        ("11HEADCG00H3ACXA,11HEADCG00H3ACYA,11HEADCG00H3ACZA", "linear_acceleration"),
        ("Gyro 1,Gyro 2,Gyro 3", "angular_velocity"),
        ("p (deg/s),q (deg/s),r (deg/s)", "angular_velocity"),
    ],
)
def test_a_signal_whose_axes_are_called_otherwise_is_never_passed_over(columns: str, signal: str):
    is_linear = signal == "linear_acceleration"
    other = "wx_rad_s,wy_rad_s,wz_rad_s" if is_linear else "ax_g,ay_g,az_g"
    problem = refused(table(f"t_ms,{other},{columns}"))
    assert codes(problem) == [(f"/{signal}", "columns-not-read")]
    unit = {"unit": "g" if is_linear else "deg/s"} | dict(zip("xyz", columns.split(","), strict=True))
    other_unit = {"unit": "rad/s" if is_linear else "g"} | dict(zip("xyz", other.split(","), strict=True))
    both = {signal: unit, "angular_velocity" if is_linear else "linear_acceleration": other_unit}
    assert one(table(f"t_ms,{other},{columns}"), mapping=mapping(both)).notes == ()


@pytest.mark.parametrize(
    "extra", ["PLA (g),PLA time,Threshold (g),Range (g)", "Mag X,Mag Y,Mag Z", "Peak Acc 1,Peak Acc 2,Peak Acc 3"]
)
def test_what_is_no_signal_is_passed_over(extra: str):
    assert one(table("t_ms,wx_rad_s,wy_rad_s,wz_rad_s," + extra)).recording.linear_acceleration is None


def test_a_signal_that_a_mapping_does_not_name_is_noted():
    text = table("t_ms,ax_g,ay_g,az_g,wx_rad_s,wy_rad_s,wz_rad_s")
    only = {"linear_acceleration": {"unit": "g", "x": "ax_g", "y": "-ay_g", "z": "az_g"}}
    record = one(text, mapping=mapping(only))
    assert record.recording.angular_velocity is None
    (note,) = record.notes
    assert (note.code, note.severity, note.signal) == ("channel_missing", "warning", "angular_velocity")
    assert "wx_rad_s" in note.detail
    assert one(text, mapping=mapping(only | {"angular_velocity": None})).notes == ()


def test_beside_a_preset_a_mapping_settles_which_columns_are_meant():
    text = table("t_ms,Ax (m/s^2),Ay (m/s^2),Az (m/s^2),ax_g,ay_g,az_g,wx_rad_s,wy_rad_s,wz_rad_s")
    problem = refused(text)
    assert codes(problem) == [("/linear_acceleration", "heading-twice")]
    which = mapping({"linear_acceleration": {"unit": "g", "x": "ax_g", "y": "ay_g", "z": "az_g"}})
    record = one(text, mapping=which, preset="generic_six_axis")
    assert record.recording.linear_acceleration.unit == "g"
    assert record.recording.angular_velocity is not None


def test_a_devices_signal_in_another_unit_is_not_passed_over_by_its_preset():
    heading = "t.ms,PAV.X.radsec,PAV.Y.radsec,PAV.Z.radsec,PLA.X.g,PLA.Y.g,PLA.Z.g"
    assert codes(refused(table(heading), preset="prevent")) == [("/linear_acceleration", "columns-not-read")]


@pytest.mark.parametrize("extra", ["ayes,azes", "wx_ok,wy_ok", "wx_ok,wy_ok,wz_raw", "ax_raw,ay_raw,az_raw"])
def test_columns_that_are_no_whole_signal_or_a_signals_other_form_are_passed_over(extra):
    record = one(table("t_ms,ax_g,ay_g,az_g," + extra))
    assert record.recording.angular_velocity is None


@pytest.mark.parametrize(
    "spelling",
    [
        "Gyroscope {} (rad/s)",
        "gyroscope_{}_rad_s",
        "Angular Rate {} (rad/s)",
        "av{}_rad_s",
        "Angular velocity (rad/s) {}",
        "gyro [rad/s] {}",
        "omega_rad_s_{}",
        "Winkelgeschwindigkeit {} (rad/s)",
        "Drehrate {} [rad/s]",
        "rot_{} (rad/s)",
    ],
)
def test_rotation_is_found_under_its_other_names(spelling):
    record = one(table(",".join(["t_ms,ax_g,ay_g,az_g", *(spelling.format(axis) for axis in "xyz")])))
    assert peaks(record.recording.angular_velocity) == [4.0, 5.0, 6.0]
    assert record.recording.angular_velocity.unit == "rad/s"


def test_columns_in_a_unit_of_rotation_are_never_passed_over_whatever_they_are_called():
    problem = refused(table("t_ms,ax_g,ay_g,az_g,phi_x (deg/s),phi_y (deg/s),phi_z (deg/s)"))
    assert codes(problem) == [("/angular_velocity", "columns-not-read")]
    assert one(table("t_ms,ax_g,ay_g,az_g,roll_deg,pitch_deg,yaw_deg,qx,qy,qz,x_mm,y_mm,z_mm"))


def test_of_several_columns_of_times_that_of_the_samples_is_taken():
    text = table("t_ms,ax_g,ay_g,az_g").splitlines()
    stamped = "\n".join(["timestamp_ms," + text[0], *("1763665445123," + line for line in text[1:])])
    assert one(stamped).recording.linear_acceleration.sample_rate_hz == 1000.0


def test_greek_letters_and_signs_of_degrees_are_read():
    record = one(table("t_ms,ωx (°/s),ωy (°/s),ωz (°/s),αx (rad/s²),αy (rad/s²),αz (rad/s²)"))
    assert record.recording.angular_velocity.unit == "deg/s"
    assert record.recording.angular_acceleration.unit == "rad/s^2"


def test_a_named_preset_may_lack_a_whole_signal_but_not_a_part_of_one():
    record = one(table("t_s,AX_g,AY_g,AZ_g").replace(".0,", "e-3,", 1), preset="headsport")
    assert record.recording.angular_velocity is None
    problem = refused(table("t_s,AX_g,AY_g,AZ_g,GX_rad_s"), preset="headsport")
    assert codes(problem) == [("/angular_velocity/y", "column-missing")]


@pytest.mark.parametrize(("begins_ms", "before_ms"), [(0, None), (-10, 10.0)])
def test_headsports_times_count_from_the_start_unless_they_span_the_trigger(begins_ms: int, before_ms: float | None):
    rows = [f"{(begins_ms + n) / 1000},0,{n},0,{n % 7},1,{n % 5}" for n in range(40)]
    record = one("\n".join(["t_s,GX_rad_s,GY_rad_s,GZ_rad_s,AX_g,AY_g,AZ_g", *rows]))
    assert record.metadata["preset"] == "headsport"
    assert record.recording.pre_trigger_ms == before_ms


def test_a_named_preset_that_does_not_fit_is_refused():
    assert codes(refused(csv_text(), preset="swa")) == [("mapping", "layout-unknown")]
    assert "another kind of file" in refused(csv_text(), preset="nhtsa").detail


def test_an_unknown_preset_is_refused_with_the_names_of_all():
    problem = refused(csv_text(), preset="protecht")
    assert problem.slug == "invalid-parameter"
    assert codes(problem) == [("preset", "not-allowed")]
    assert all(name in problem.detail for name in presets())


def test_a_mapping_overrides_a_presets_members_one_by_one():
    below = presets()["headsport"].mapping
    over = mapping({"axes": "sae_j211", "linear_acceleration": {"y": "-AY_g"}})
    merged = merge(below, over)
    assert merged.axes == "sae_j211"
    assert merged.linear_acceleration is not None
    assert (merged.linear_acceleration.unit, merged.linear_acceleration.y) == ("g", ["-AY_g"])
    assert merged.time == below.time
    assert merge(below, None) is below


def test_every_preset_is_listed_with_its_columns_units_and_axes():
    listed = {preset["name"]: preset for preset in list_presets()}
    assert set(listed) >= set(PRESET_TABLES) | {"swa", "nhtsa", "generic_six_axis"}
    assert list(listed)[-1] == "generic_six_axis"
    for preset in listed.values():
        assert preset["axes"] in {"anatomical", "sae_j211"}
        assert preset["columns"]
        assert preset["title"]
    assert listed["nhtsa"]["filter"] == "none"
    assert {"signal": "linear_acceleration", "axis": "x", "unit": "m/s^2", "headings": ["PLA.X.msec^2"]} in listed[
        "prevent"
    ]["columns"]
    assert listed["swa"]["requires"] == ["sample_rate_hz", "occurred_at"]


def test_a_column_is_one_component_of_a_signal():
    columns = {"linear_acceleration": {"unit": "g", "x": "ax_g", "y": "-ax_g", "z": "az_g"}}
    problem = refused(table("t_s,ax_g,az_g"), mapping=mapping(columns | {"time": {"column": "t_s", "unit": "s"}}))
    assert codes(problem) == [("/linear_acceleration/x", "column-twice")]


def test_an_imperial_file_may_name_its_units_behind_its_headings():
    units = {"LinAcc": " (m/s^2)", "RotVel": " [deg/s]", "RotAcc": "_rad_s2"}
    headings = [
        heading + next((unit for name, unit in units.items() if heading.startswith(name)), "")
        for heading in PRESET_TABLES["imperial"].split(",")
    ]
    recording = one(table(",".join(headings)), preset="imperial").recording
    assert {name: signal.unit for name, signal in recording.signals()} == {
        "linear_acceleration": "m/s^2",
        "angular_velocity": "deg/s",
        "angular_acceleration": "rad/s^2",
    }


@pytest.mark.parametrize("name", [name for name in PRESET_TABLES if name not in {"biocore", "imperial"}] + ["swa"])
def test_a_device_preset_is_recognised_before_the_generic_one(name: str):
    heading = SWA if name == "swa" else PRESET_TABLES[name]
    found = recognise(Headings(heading.split(",")))
    assert found is not None
    assert found.name == name


def test_no_heading_of_the_vocabulary_has_two_meanings():
    table = presets()["generic_six_axis"].vocabulary
    assert table is not None
    Vocabulary(table)
    twice = table | {"angular_acceleration": table["angular_velocity"]}
    with pytest.raises(ValueError, match="two meanings"):
        Vocabulary(twice)


@given(st.text())
def test_compaction_is_stable(heading: str):
    assert compact(compact(heading)) == compact(heading)


@given(st.lists(st.text(max_size=12), max_size=8))
def test_any_headings_are_recognised_or_not(headings: list[str]):
    with suppress(Problem):
        recognise(Headings(headings))


FIELDS = {
    "occurred_at": "2026-11-20T19:04:05",
    "time_zone": "Europe/London",
    "sample_rate_hz": "1000",
    "axes": "sae_j211",
}


def test_fields_are_read_from_their_text():
    options = ImportOptions.from_fields(FIELDS | {"athlete": "p-1", "filter": "none", "device": ""}, filename="x.csv")
    assert options.occurred_at == datetime(2026, 11, 20, 19, 4, 5, tzinfo=UTC)
    assert (options.sample_rate_hz, options.axes, options.athlete) == (1000.0, "sae_j211", "p-1")
    assert options.low_pass is not None
    assert options.low_pass.name == "none"
    assert (options.device, options.filename) == (None, "x.csv")
    chosen = ImportOptions.from_fields({"filter": '{"linear_acceleration": 300}'}).low_pass
    assert chosen is not None
    assert (chosen.linear_acceleration, chosen.angular_velocity) == (300.0, None)
    sent = ImportOptions.from_fields({"mapping": '{"sample_rate_hz": 1000, "axes": "sae_j211"}'}).mapping
    assert sent is not None
    assert sent.sample_rate_hz == 1000.0


@pytest.mark.parametrize(
    ("fields", "fault"),
    [
        ({"sample_rate_hz": "100"}, ("sample_rate_hz", "out-of-range")),
        ({"sample_rate_hz": "nan"}, ("sample_rate_hz", "not-finite")),
        ({"sample_rate_hz": "fast"}, ("sample_rate_hz", "wrong-type")),
        ({"axes": "iso"}, ("axes", "not-allowed")),
        ({"filter": "CFC180"}, ("filter", "not-allowed")),
        ({"filter": "{"}, ("filter", "not-json")),
        ({"filter": '{"linear_acceleration": -1}'}, ("filter", "out-of-range")),
        ({"athlete": "a\0b"}, ("athlete", "control-character")),
        ({"device": "d" * 201}, ("device", "too-long")),
        ({"occurred_at": "yesterday"}, ("occurred_at", "not-a-time")),
        ({"occurred_at": "2026-11-20T19:04:05"}, ("occurred_at", "offset-missing")),
        ({"time_zone": "Mars/Olympus"}, ("time_zone", "unknown-zone")),
        ({"mapping": "[]"}, ("", "wrong-type")),
        ({"mapping": "{"}, ("", "not-json")),
        ({"mapping": '{"time": {"column": "t", "unit": "h"}}'}, ("/time/unit", "not-allowed")),
        ({"mapping": '{"scale": 2}'}, ("/scale", "unknown-field")),
        ({"mapping": '{"linear_acceleration": {"unit": "rad/s"}}'}, ("/linear_acceleration/unit", "not-allowed")),
        ({"mapping": '{"linear_acceleration": {"x": 3}}'}, ("/linear_acceleration/x", "wrong-type")),
    ],
)
def test_a_field_that_breaks_a_rule_is_named(fields: dict[str, str], fault: tuple[str, str]):
    with pytest.raises(Problem) as caught:
        ImportOptions.from_fields(fields)
    assert caught.value.slug == "invalid-parameter"
    assert codes(caught.value) == [fault]
    assert all(error.parameter in fields for error in caught.value.errors)


def test_all_faulty_fields_are_named_at_once():
    with pytest.raises(Problem) as caught:
        ImportOptions.from_fields({"axes": "iso", "occurred_at": "x", "mapping": "{", "sample_rate_hz": "1"})
    assert len(caught.value.errors) == 4


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(sorted(Mapping.model_fields)), inner),
    max_leaves=8,
)


@given(st.dictionaries(st.sampled_from(sorted(Mapping.model_fields)), json_values, max_size=4))
def test_any_mapping_is_taken_or_refused(document: dict[str, Any]):
    with suppress(Problem):
        options = ImportOptions.from_fields({"mapping": json.dumps(document)})
        assert statuses(outcome(csv_text(six_axis()), mapping=options.mapping)) <= {413, 422}


@pytest.mark.parametrize(
    "heading",
    [
        *(
            "CG_A{}_g",
            "head_a{}_g",
            "la{}_g",
            "LinearAcc_CG_{} (g)",
            "Acceleration Head CG {} (g)",
            "Lin_{}_g",
            "LA_{} (g)",
        ),
        *("{} (g)", "Head {} [m/s^2]", "sensor1 {} m/s²"),
    ],
)
def test_three_columns_in_a_unit_of_acceleration_are_not_passed_over(heading):
    linear = ",".join(heading.format(axis) for axis in "xyz")
    problem = refused(csv_text(heading=f"t_s,{linear},wx_rad_s,wy_rad_s,wz_rad_s"))
    assert codes(problem) == [("/linear_acceleration", "columns-not-read")]


@pytest.mark.parametrize(
    "heading", ["roll_rad_s,pitch_rad_s,yaw_rad_s", "Roll rate (deg/s),Pitch rate (deg/s),Yaw rate (deg/s)"]
)
def test_rates_of_turns_by_their_names_are_not_passed_over(heading):
    problem = refused(csv_text(heading=f"t_s,ax_g,ay_g,az_g,{heading}"))
    assert codes(problem) == [("/angular_velocity", "columns-not-read")]


def test_other_columns_in_g_beside_a_whole_signal_are_none_of_it():
    record = one(csv_text(np.hstack([six_axis(), six_axis()[:, :3]]), heading=f"{GENERIC},neck_x_g,neck_y_g,neck_z_g"))
    assert record.recording.linear_acceleration.values[:, 0].max() == six_axis()[:, 0].max()


def test_a_resultant_that_a_mapping_names_must_be_there():
    columns = {"unit": "g", "x": "ax_g", "y": "ay_g", "z": "az_g", "resultant": "a_mag"}
    named = Mapping.model_validate({"linear_acceleration": columns, "time": {"column": "t_s", "unit": "s"}})
    assert codes(refused(csv_text(), mapping=named)) == [("/linear_acceleration/resultant", "column-missing")]


def in_unit(
    unit: str, written: str, signal: str = "linear_acceleration", below: str = ""
) -> str | ImpactRecord | Problem:
    """What becomes of three columns whose headings end in `written`, under a mapping that says `unit`."""
    columns = [f"{axis}{written}" for axis in "XYZ"]
    text = table(",".join(["t_ms", *columns]))
    if below:
        head, rows = text.split("\n", 1)
        text = f"{head}\nms,{below},{below},{below}\n{rows}"
    document = {
        signal: {"unit": unit, **dict(zip("xyz", columns, strict=True))},
        "time": {"column": "t_ms", "unit": "ms"},
    }
    [found] = outcome(text, mapping=mapping(document))
    return found


@pytest.mark.parametrize(
    ("signal", "unit", "written"),
    [
        ("linear_acceleration", "g", " (m/s^2)"),
        ("linear_acceleration", "m/s^2", " [g]"),
        ("linear_acceleration", "g", " (mg)"),
        ("linear_acceleration", "m/s^2", " mm/s2"),
        ("linear_acceleration", "g", " (rad/s)"),
        ("angular_velocity", "rad/s", " (deg/s)"),
        ("angular_velocity", "deg/s", " [mdps]"),
        ("angular_velocity", "rad/s", " (rpm)"),
        ("angular_acceleration", "rad/s^2", " (krad/s²)"),
        ("angular_acceleration", "rad/s^2", " (rad/s)"),
    ],
)
def test_a_mappings_unit_must_be_that_of_the_heading(signal: str, unit: str, written: str):
    found = in_unit(unit, written, signal)
    assert isinstance(found, Problem)
    assert codes(found) == [(f"/{signal}/unit", "units-differ")]
    assert f"X{written.strip()[:2]}"[:1] in found.detail
    below = in_unit(unit, "", signal, below=written.strip(" ()[]"))
    assert isinstance(below, Problem)
    assert codes(below) == [(f"/{signal}/unit", "units-differ")]


@pytest.mark.parametrize(
    ("signal", "unit", "heading"),
    [
        *(
            ("linear_acceleration", "m/s^2", name)
            for name in ("a{}_g", "acc_{}_g", "linear_acceleration_{}_g", "Accel {} g")
        ),
        *(("linear_acceleration", "g", name) for name in ("a{}_ms2", "a{}_m_s2", "acc_{}_ms2", "Acc {} (ft/s^2)")),
        *(("angular_velocity", "deg/s", name) for name in ("w{}_rad_s", "gyro_{}_rad_s", "angular_velocity_{}_rad_s")),
        *(("angular_velocity", "rad/s", name) for name in ("gyro_{}_deg_s", "Gyro {} [°/s]", "Gyro {} (rev/min)")),
        ("angular_velocity", "deg/s", "Gyro {} [1/min]"),
    ],
)
def test_a_mappings_unit_must_be_that_of_a_heading_of_known_words(signal: str, unit: str, heading: str):
    columns = {axis: heading.format(axis) for axis in "xyz"}
    document = {signal: {"unit": unit, **columns}, "time": {"column": "t_ms", "unit": "ms"}}
    problem = refused(table(",".join(["t_ms", *columns.values()])), mapping=mapping(document))
    assert codes(problem) == [(f"/{signal}/unit", "units-differ")]


@pytest.mark.parametrize(
    ("signal", "unit", "written", "base", "size"),
    [
        ("linear_acceleration", "mg", " (mg)", "g", 1e-3),
        ("linear_acceleration", "mg", "", "g", 1e-3),
        ("linear_acceleration", "mm/s^2", " (mm/s²)", "m/s^2", 1e-3),
        ("linear_acceleration", "cm/s^2", " cm/s^2", "m/s^2", 1e-2),
        ("angular_velocity", "mdeg/s", " (mdps)", "deg/s", 1e-3),
        ("angular_velocity", "mrad/s", " (mrad/s)", "rad/s", 1e-3),
        ("angular_velocity", "rpm", " (rpm)", "deg/s", 6.0),
        ("angular_acceleration", "krad/s^2", " (krad/s²)", "rad/s^2", 1e3),
        ("angular_acceleration", "kdeg/s^2", " (kdeg/s^2)", "deg/s^2", 1e3),
        ("linear_acceleration", "g", "_axis", "g", 1.0),
    ],
)
def test_a_mapping_may_name_a_sensors_own_unit(signal: str, unit: str, written: str, base: str, size: float):
    record = in_unit(unit, written, signal)
    assert isinstance(record, ImpactRecord), record
    found = getattr(record.recording, signal)
    assert found.unit == base
    assert peaks(found) == pytest.approx([size, 2 * size, 3 * size], rel=1e-12)


def test_a_range_and_resultants_are_in_the_sensors_own_unit():
    rows = [
        "0,1000,0,0,1000",
        "1,3000,4000,0,5000",
        "2,0,0,0,0",
        "3,0,0,100,100",
        *(f"{n},0,0,0,0" for n in range(4, 40)),
    ]
    text = "\n".join(["t_ms,X,Y,Z,R", *rows])
    columns = {"unit": "mg", "x": "X", "y": "Y", "z": "Z", "resultant": "R", "range": 16000}
    document = {"linear_acceleration": columns, "time": {"column": "t_ms", "unit": "ms"}}
    record = one(text, mapping=mapping(document))
    assert record.recording.linear_acceleration is not None
    assert record.recording.linear_acceleration.declared_range == pytest.approx(16.0)
    assert "vendor_peak_mismatch" not in [note.code for note in record.notes]


@pytest.mark.parametrize(("heading", "unit"), [("Time (ms)", "us"), ("t_s", "ms"), ("Elapsed [us]", "ms")])
def test_a_mappings_unit_of_times_must_be_that_of_the_heading(heading: str, unit: str):
    document = {
        "linear_acceleration": {"unit": "g", "x": "X", "y": "Y", "z": "Z"},
        "time": {"column": heading, "unit": unit},
    }
    assert codes(refused(table(f"{heading},X,Y,Z"), mapping=mapping(document))) == [("/time", "units-differ")]
