"""Resultants and peaks that a device supplies in a table: compared with the samples, never read as such."""

from __future__ import annotations

from collections.abc import Mapping as Fields
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from binary_files import mat, nested, noise, npz, parquet, structs
from ingest_files import GENERIC, codes, csv_text, one, read, refused, six_axis

from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

LINEAR = np.linalg.norm(six_axis()[:, :3], axis=1)
ANGULAR = np.linalg.norm(six_axis()[:, 3:], axis=1)
GRAVITY = 9.80665


def beside(heading: str, column: np.ndarray, axes: str = GENERIC) -> str:
    return csv_text(np.column_stack([six_axis(), column]), heading=f"{axes},{heading}")


def mismatches(record: ImpactRecord) -> list[str | None]:
    assert {note.code for note in record.notes} <= {"vendor_peak_mismatch"}
    return [note.signal for note in record.notes]


@pytest.mark.parametrize(
    ("heading", "factor"),
    [
        *(
            (name, 1.0)
            for name in ("ar_g", "a_res_g", "Resultant (g)", "Linear Acc Mag g", "PLA_R (g)", "aR [g]", "res_g")
        ),
        *((name, 1.0) for name in ("Resultant Linear Acceleration (g)", "Acc_Resultant_g", "Lin Acc Magnitude [g]")),
        ("ar_m_s2", GRAVITY),
    ],
)
def test_a_resultant_beside_the_axes_is_compared_in_its_own_unit(heading: str, factor: float) -> None:
    for off, found in ((1.0, []), (1.009, []), (1.011, ["linear_acceleration"]), (0.8, ["linear_acceleration"])):
        record = one(beside(heading, LINEAR * factor * off))
        assert mismatches(record) == found
        np.testing.assert_array_equal(record.recording.linear_acceleration.values, six_axis()[:, :3])


@pytest.mark.parametrize(
    ("heading", "of", "factor"),
    [
        *((name, LINEAR, 1.0) for name in ("PLA (g)", "Peak Linear Acceleration (g)", "peak_g", "Peak Lin Accel (g)")),
        *((name, LINEAR, 1.0) for name in ("Peak Resultant Linear Acceleration (g)", "resultant_peak_g", "acc_pk_g")),
        *((name, LINEAR, 1.0) for name in ("Max Resultant (g)", "resultant_max_g", "ar_max_g", "PLA Max (g)")),
        ("PLA (m/s^2)", LINEAR, GRAVITY),
        *((name, ANGULAR, 1.0) for name in ("PAV (rad/s)", "Peak Angular Velocity (rad/s)", "PRV [rad/s]")),
        ("peak omega (deg/s)", ANGULAR, 180.0 / np.pi),
    ],
)
def test_a_peak_that_a_column_states_is_compared_in_its_own_unit(heading: str, of: np.ndarray, factor: float) -> None:
    signal = "linear_acceleration" if of is LINEAR else "angular_velocity"
    for off, found in ((1.0, []), (1.009, []), (1.011, [signal]), (0.8, [signal])):
        assert mismatches(one(beside(heading, np.full(40, of.max() * factor * off)))) == found
    in_first_row = csv_text(heading=GENERIC).splitlines()
    peaks = [heading, "77", *[""] * 39]
    assert mismatches(one("\n".join(map(",".join, zip(in_first_row, peaks, strict=True))))) == [signal]


def test_what_is_called_a_peak_and_changes_from_sample_to_sample_is_compared_by_its_largest() -> None:
    assert mismatches(one(beside("PLA (g)", LINEAR))) == []
    assert mismatches(one(beside("PLA (g)", 1.2 * LINEAR))) == ["linear_acceleration"]


def test_both_numbers_are_named_in_the_samples_unit() -> None:
    [note] = one(beside("PLA (m/s^2)", np.full(40, 77.0 * GRAVITY))).notes
    assert note.detail == (
        f"The supplied peak resultant of the linear acceleration is 77 g where the samples give {LINEAR.max():.5g} g."
    )


@pytest.mark.parametrize(
    "heading", ["PLA", "peak", "ar", "HIC", "severity", "peak_x_g", "max_m", "PAA (rad/s^2)", "mag"]
)
def test_what_names_no_unit_or_no_signal_that_is_read_is_compared_with_nothing(heading: str) -> None:
    record = one(beside(heading, np.full(40, 77.0)))
    assert mismatches(record) == []
    np.testing.assert_array_equal(record.recording.linear_acceleration.values, six_axis()[:, :3])


@pytest.mark.parametrize(
    ("heading", "full_scale"),
    [
        *((name, 200.0) for name in ("Accel Max (g)", "acc_max_g", "a_max_g", "Max Acceleration (g)", "max_g")),
        *((name, 200.0) for name in ("Accelerometer Max (g)", "Maximum (g)", "Max Lin Accel (g)")),
        *((name, 2000.0) for name in ("Gyro Max (deg/s)", "gyro_max_dps", "Max Angular Velocity (deg/s)")),
    ],
)
def test_the_most_that_a_sensor_measures_is_no_peak(heading: str, full_scale: float) -> None:
    assert mismatches(one(beside(heading, np.full(40, full_scale)))) == []


def of_each_axis(heading: str, columns: np.ndarray) -> str:
    headings = ",".join(heading.format(axis) for axis in "xyz")
    return csv_text(np.column_stack([six_axis(), columns]), heading=f"{GENERIC},{headings}")


@pytest.mark.parametrize(
    ("heading", "of"),
    [
        *((name, slice(0, 3)) for name in ("PLA {} (g)", "PLA_{}_g", "{} PLA (g)", "Peak Linear Acceleration {} (g)")),
        *((name, slice(3, 6)) for name in ("PAV {} (rad/s)", "Peak Angular Velocity {} (rad/s)")),
    ],
)
def test_peaks_of_each_axis_are_no_axes_where_these_are_clear_without_them(heading: str, of: slice) -> None:
    peaks = np.abs(six_axis()[:, of]).max(axis=0)
    record = one(of_each_axis(heading, np.tile(peaks, (40, 1))))
    assert mismatches(record) == []
    np.testing.assert_array_equal(record.recording.linear_acceleration.values, six_axis()[:, :3])
    np.testing.assert_array_equal(record.recording.angular_velocity.values, six_axis()[:, 3:])
    lone = csv_text(np.column_stack([six_axis(), np.full(40, peaks[0])]), heading=f"{GENERIC},{heading.format('x')}")
    assert mismatches(one(lone)) == []


def test_samples_that_are_called_peaks_are_read_alone_and_ask_for_a_mapping_beside_others() -> None:
    named = GENERIC.replace("ax_g,ay_g,az_g", "PLA x (g),PLA y (g),PLA z (g)")
    np.testing.assert_array_equal(one(csv_text(heading=named)).recording.linear_acceleration.values, six_axis()[:, :3])
    both = of_each_axis("PLA {} (g)", 1.1 * six_axis()[:, :3])
    assert codes(refused(both)) == [("/linear_acceleration", "heading-twice")]
    for columns in ("a{}_g", "PLA {} (g)"):
        chosen = {"unit": "g", **{axis: columns.format(axis) for axis in "xyz"}}
        turns = {"unit": "rad/s", **{axis: f"w{axis}_rad_s" for axis in "xyz"}}
        mapping = Mapping.model_validate({"linear_acceleration": chosen, "angular_velocity": turns})
        for preset in (None, "generic_six_axis"):
            values = one(
                both, mapping=mapping, preset=preset, sample_rate_hz=1000.0
            ).recording.linear_acceleration.values
            np.testing.assert_array_equal(values, (1.0 if columns == "a{}_g" else 1.1) * six_axis()[:, :3])


def test_samples_in_lists_that_are_called_peaks_ask_for_a_mapping_too() -> None:
    values = noise()
    columns = {f"{name}{axis}_g": values[:, :, place] for name in ("a", "PLA ") for place, axis in enumerate("xyz")}
    table = pa.table({name: pa.array(cells.tolist()) for name, cells in columns.items()})
    assert codes(refused(parquet(table), sample_rate_hz=1000.0)) == [("/linear_acceleration", "heading-twice")]


def test_a_cell_that_is_no_number_is_compared_with_nothing() -> None:
    for heading, cell in (("ar_g", "n/a"), ("ar_g", "off"), ("PLA (g)", "high"), ("PLA (g)", "")):
        lines = csv_text().splitlines()
        text = "\n".join([f"{lines[0]},{heading}", *(f"{line},{cell}" for line in lines[1:])])
        assert mismatches(one(text)) == []


@pytest.mark.parametrize(
    ("axes", "resultant"),
    [
        (
            "Linear Accel X (g),Linear Accel Y (g),Linear Accel Z (g),"
            "Rotational Vel X (rad/s),Rotational Vel Y (rad/s),Rotational Vel Z (rad/s)",
            "Linear Accel Resultant (g)",
        ),
        ("AX_g,AY_g,AZ_g,GX_rad_s,GY_rad_s,GZ_rad_s", "AR_g"),
    ],
)
def test_resultants_are_compared_beside_a_devices_own_columns(axes: str, resultant: str) -> None:
    assert mismatches(one(beside(resultant, LINEAR, axes=f"t_s,{axes}"))) == []
    assert mismatches(one(beside(resultant, LINEAR + 5.0, axes=f"t_s,{axes}"))) == ["linear_acceleration"]


def test_each_impact_has_its_own_peak() -> None:
    lines = csv_text(heading=f"{GENERIC}").splitlines()
    rows = [f"{name},{peak},{line}" for name, peak in (("a", LINEAR.max()), ("b", 77.0)) for line in lines[1:]]
    found = read("\n".join([f"impact_id,PLA (g),{lines[0]}", *rows]))
    assert [mismatches(record) for record in found] == [[], ["linear_acceleration"]]


def test_a_mapping_names_peaks_and_resultants() -> None:
    columns = {"unit": "g", "x": "ax_g", "y": "ay_g", "z": "az_g", "peak": "P", "resultant": "R (m/s^2)"}
    time = {"column": "t_s", "unit": "s"}
    mapping = Mapping.model_validate({"linear_acceleration": columns, "angular_velocity": None, "time": time})
    table = np.column_stack([six_axis(), LINEAR * GRAVITY, np.full(40, LINEAR.max())])
    assert mismatches(one(csv_text(table, heading=f"{GENERIC},R (m/s^2),P"), mapping=mapping)) == []
    table[:, 7] = 77.0
    assert mismatches(one(csv_text(table, heading=f"{GENERIC},R (m/s^2),P"), mapping=mapping)) == [
        "linear_acceleration"
    ]
    problem = refused(csv_text(table, heading=f"{GENERIC},R (m/s^2),Q"), mapping=mapping)
    assert codes(problem) == [("/linear_acceleration/peak", "column-missing")]


def peaks_of(values: np.ndarray) -> np.ndarray:
    found: np.ndarray = np.linalg.norm(values[:, :, :3], axis=2).max(axis=1)
    return found


def as_parquet(values: np.ndarray, said: Fields[str, Any]) -> bytes:
    table = nested(values)
    for name, cells in said.items():
        table = table.append_column(name, pa.array(list(cells)))
    return parquet(table)


def as_npz(values: np.ndarray, said: Fields[str, Any]) -> bytes:
    signals = {"linear_acceleration": values[:, :, :3], "angular_velocity": values[:, :, 3:]}
    units = {"linear_acceleration_unit": "g", "angular_velocity_unit": "rad/s"}
    return npz(**signals, **units, sample_rate_hz=1000.0, **said)


@pytest.mark.parametrize("write", [as_parquet, as_npz])
def test_tables_of_arrays_are_compared_too(write: Any) -> None:
    values, wrong = noise(), np.array([1.0, 1.2, 1.0])
    given = [[], ["linear_acceleration"], []]
    peaks = peaks_of(values) * wrong
    assert [mismatches(record) for record in read(write(values, {"peak_g": peaks}))] == given
    traces = np.linalg.norm(values[:, :, :3], axis=2) * wrong[:, None]
    assert [mismatches(record) for record in read(write(values, {"ar_g": traces}))] == given
    # a resultant that is one number an impact is no trace
    assert [mismatches(record) for record in read(write(values, {"ar_g": peaks}))] == [[], [], []]


def test_a_struct_states_its_peaks() -> None:
    values, peaks = noise(), peaks_of(noise()) * np.array([1.0, 1.2, 1.0])
    impacts = [
        {"t": np.arange(40) / 1000.0, "lin_acc_CG": one_of[:, :3], "ang_vel": one_of[:, 3:], "peak_g": peak}
        for one_of, peak in zip(values, peaks, strict=True)
    ]
    found = read(mat({"impact": structs(*impacts)}), preset="stanford_mat")
    assert [mismatches(record) for record in found] == [[], ["linear_acceleration"], []]


@pytest.mark.parametrize("heading", ["Betrag (g)", "Vector sum (g)", "Résultante (g)", "acc Betrag (g)", "SVM (g)"])
def test_resultants_in_other_words_are_held_against_the_samples(heading: str):
    first, *lines = csv_text().splitlines()
    twice = [2.0 * float(np.linalg.norm(row[:3])) for row in six_axis()]
    text = "\n".join([f"{first},{heading}", *(f"{line},{value}" for line, value in zip(lines, twice, strict=True))])
    assert "vendor_peak_mismatch" in [note.code for note in one(text).notes]
