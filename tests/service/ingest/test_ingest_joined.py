"""A device's files joined into one table, with columns that say whose each impact is and how it is read."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from binary_files import mat, structs, xlsx
from ingest_files import codes, read, refused, six_axis
from making import athlete_intelligence, biocore, prevent

from headimpact.errors import TraceError
from headimpact.preparation import prepare
from headimpact_service.errors import Problem
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord


def records(data: bytes | str, **options: Any) -> list[ImpactRecord]:
    found = read(data, **options)
    assert all(isinstance(item, ImpactRecord) for item in found), found[0]
    return [item for item in found if isinstance(item, ImpactRecord)]


def joined(text: str, heading: str, *labels: str) -> str:
    """The rows of one file once for each label, which stands in a column of its own."""
    first, *rows = text.strip().splitlines()
    return "\n".join([f"{first},{heading}", *(f"{row},{label}" for label in labels for row in rows)])


def text_of(made: Any) -> str:
    return made.data if isinstance(made.data, str) else made.data.decode()


@pytest.mark.parametrize(
    ("make", "options"),
    [(athlete_intelligence, {"sample_rate_hz": 1000.0}), (biocore, {"preset": "biocore"}), (prevent, {})],
)
def test_columns_beside_a_devices_own_say_whose_each_impact_is(make: Any, options: dict[str, Any]) -> None:
    heading = "impact_id,athlete,device,occurred_at,axes,pre_trigger_ms"
    labels = [f"{n},p-{n},d-{n},2026-11-20T10:00:0{n}Z,sae_j211,{n + 3}" for n in (1, 2)]
    found = records(joined(text_of(make()), heading, *labels), **options)
    assert [(record.athlete_external_id, record.device_serial) for record in found] == [("p-1", "d-1"), ("p-2", "d-2")]
    assert [record.occurred_at.second for record in found] == [1, 2]
    assert [record.recording.axes for record in found] == ["sae_j211"] * 2
    assert [record.recording.pre_trigger_ms for record in found] == [4.0, 5.0]


def test_a_devices_file_that_lacks_a_signal_is_its_own_by_its_resultants() -> None:
    rows = [line.split(",") for line in text_of(prevent()).strip().splitlines()]
    kept = [place for place, name in enumerate(rows[0]) if not name.startswith("PAA")]
    lacking = "\n".join(",".join(row[place] for place in kept) for row in rows)
    [record] = records(lacking, filename="MG0042-17-2026-11-20T190405.123Z.csv")
    assert (record.metadata["preset"], record.device_serial) == ("prevent", "0042")
    assert record.recording.pre_trigger_ms == 10.0


def generic(**columns: list[Any]) -> str:
    names = ["ax_g", "ay_g", "az_g", "wx_rad_s", "wy_rad_s", "wz_rad_s", *columns]
    rows = zip(*six_axis().T.tolist(), *columns.values(), strict=True)
    return "\n".join([",".join(names), *(",".join(map(str, row)) for row in rows)])


def test_of_two_columns_that_tell_impacts_apart_both_count() -> None:
    found = records(generic(external_id=[""] * 40, impact_id=["1"] * 20 + ["2"] * 20), sample_rate_hz=1000.0)
    assert [record.recording.linear_acceleration.values.shape[0] for record in found] == [20, 20]


def test_a_sensors_own_rate_counts_beside_times_that_the_signals_share() -> None:
    times = [float(i) for i in range(40)]
    own = Mapping.model_validate({"angular_velocity": {"sample_rate_hz": 2000}})
    [record] = records(generic(t_ms=times), preset="generic_six_axis", mapping=own)
    assert [signal.sample_rate_hz for _, signal in record.recording.signals()][1] == 2000.0
    [record] = records(generic(sample_rate_hz=["1000"] * 40), preset="generic_six_axis", mapping=own)
    assert [signal.sample_rate_hz for _, signal in record.recording.signals()] == [1000.0, 2000.0]
    [record] = records(generic(t_ms=times), preset="generic_six_axis", mapping=own, sample_rate_hz=1000.0)
    assert [signal.sample_rate_hz for _, signal in record.recording.signals()] == [1000.0, 2000.0]
    [problem] = read(generic(t_ms=times), preset="generic_six_axis", mapping=own, sample_rate_hz=2000.0)
    assert codes(problem) == [("sample_rate_hz", "rate-differs")]
    asked = Mapping.model_validate({"sample_rate_hz": 1000.5})
    [record] = records(generic(t_ms=times), preset="generic_six_axis", mapping=asked)
    assert [signal.sample_rate_hz for _, signal in record.recording.signals()] == [1000.5, 1000.5]


@pytest.mark.parametrize("rate_hz", [1000.0, 500.0])
def test_epoch_stamps_in_seconds_say_the_rate_that_they_mean(rate_hz: float) -> None:
    stamps = [repr(1763665445.1234 + i / rate_hz) for i in range(40)]
    [record] = records(generic(t_s=stamps))
    assert record.recording.linear_acceleration.sample_rate_hz == rate_hz


@pytest.mark.parametrize("absent", [np.zeros((0, 0)), np.array([[np.nan]]), np.zeros((0, 3))])
def test_an_element_of_a_struct_that_lacks_a_signal_takes_it_from_no_other(absent: Any) -> None:
    a, w = six_axis()[:, :3], six_axis()[:, 3:]
    times = np.arange(40.0)[:, None]
    both = structs({"t": times, "lin_acc_CG": a, "ang_vel": w}, {"t": times, "lin_acc_CG": a, "ang_vel": absent})
    whole, lacking = records(mat({"impact": both}), preset="stanford_mat")
    assert [name for name, _ in whole.recording.signals()] == ["linear_acceleration", "angular_velocity"]
    assert [name for name, _ in lacking.recording.signals()] == ["linear_acceleration"]


def test_where_an_array_goes_on_behind_an_impacts_last_sample_is_noted() -> None:
    values = np.stack([six_axis(), six_axis() / 2])
    values[1, 30:] = np.nan
    dropped = Mapping.model_validate({"drop_rows": 1})
    whole, shorter = records(mat({"impacts": values}), preset="stanford_mat", mapping=dropped)
    assert [note.code for note in whole.notes] == ["edge_glitch"]
    assert [(note.code, note.severity) for note in shorter.notes] == [
        ("sample_count_mismatch", "note"),
        ("edge_glitch", "note"),
    ]
    assert "last 10 of the impact's 40 rows" in shorter.notes[0].detail
    assert shorter.recording.linear_acceleration.values.shape == (29, 3)


def test_an_impact_without_a_single_row_is_its_own_fault() -> None:
    samples = [six_axis().T.tolist(), [[]] * 6]
    names = ["ax_g", "ay_g", "az_g", "wx_rad_s", "wy_rad_s", "wz_rad_s"]
    buffer = io.BytesIO()
    pq.write_table(pa.table({name: [impact[i] for impact in samples] for i, name in enumerate(names)}), buffer)
    whole, empty = read(buffer.getvalue(), sample_rate_hz=1000.0)
    assert isinstance(whole, ImpactRecord)
    with pytest.raises(TraceError, match="3 to 20000 samples"):
        prepare(empty.recording)


def sheet(rows: np.ndarray, *headings: str) -> list[list[Any]]:
    return [list(headings), *rows.tolist()]


def test_what_is_wrong_with_one_sheet_is_its_own() -> None:
    timed = np.column_stack([np.arange(40) / 1000.0, six_axis()])
    good = sheet(timed, "t_s", "ax_g", "ay_g", "az_g", "wx_rad_s", "wy_rad_s", "wz_rad_s")
    peaks = sheet(np.array([[1.0, 2.0, 3.0]] * 4), "ax (g)", "ay (g)", "az (g)")
    found = read(xlsx({"Event 1": good, "Peaks": peaks}))
    assert isinstance(found[0], ImpactRecord)
    assert isinstance(found[1], Problem)
    assert found[1].detail.startswith("Sheet Peaks: ")
    assert codes(refused(xlsx({"Peaks": peaks}))) == [("sample_rate_hz", "rate-missing")]


def test_texts_among_a_sheets_numbers_are_no_empty_cells() -> None:
    timed = np.column_stack([np.arange(40) / 1000.0, six_axis()]).tolist()
    headings = ["t_s", "ax_g", "ay_g", "az_g", "wx_rad_s", "wy_rad_s", "wz_rad_s"]
    for cell, signals in (("err", None), (None, 1), ("NA", 1)):
        rows = [headings, *([*row[:4], cell, cell, cell] for row in timed)]
        [item] = read(xlsx({"a": rows}))
        if signals is None:
            assert codes(item) == [(None, "missing-sample")]
        else:
            assert len(item.recording.signals()) == signals


@pytest.mark.parametrize("lost", [["NaN"] * 6, [None] * 6])
def test_a_row_of_a_sheet_that_holds_nothing_is_a_lost_sample(lost: list[Any]) -> None:
    headings = ["ax_g", "ay_g", "az_g", "wx_rad_s", "wy_rad_s", "wz_rad_s"]
    rows = six_axis().tolist()
    [item] = read(xlsx({"a": [headings, *rows[:20], lost, *rows[21:]]}), sample_rate_hz=1000.0)
    assert codes(item) == [(None, "missing-sample")]
    [record] = records(xlsx({"a": [headings, *rows, lost, lost]}), sample_rate_hz=1000.0)
    assert record.recording.linear_acceleration.values.shape == (40, 3)


@pytest.mark.parametrize(("number", "name"), [(20.1, "20.1"), (4.0, "4"), (0.1, "0.1")])
def test_a_number_that_is_a_name_has_no_more_digits_than_it_needs(number: float, name: str) -> None:
    headings = ["athlete", "ax_g", "ay_g", "az_g", "wx_rad_s", "wy_rad_s", "wz_rad_s"]
    rows = [[number, *row] for row in six_axis().tolist()]
    [record] = records(xlsx({"a": [headings, *rows]}), sample_rate_hz=1000.0)
    assert record.athlete_external_id == name


@pytest.mark.parametrize("shared", [True, False])
def test_the_rows_of_the_slower_sensor_end_where_its_cells_are_empty(shared: bool) -> None:
    first, *rows = generic().splitlines()
    text = "\n".join([first, *rows[:20], *(",".join(["", "", "", *row.split(",")[3:]]) for row in rows[20:])])
    own: dict[str, Any] = {"angular_velocity": {"sample_rate_hz": 2000}}
    rate = {"sample_rate_hz": 1000} if shared else {"linear_acceleration": {"sample_rate_hz": 1000}}
    [record] = records(text, preset="generic_six_axis", mapping=Mapping.model_validate(own | rate))
    assert [(signal.values.shape[0], signal.sample_rate_hz) for _, signal in record.recording.signals()] == [
        (20, 1000.0),
        (40, 2000.0),
    ]
