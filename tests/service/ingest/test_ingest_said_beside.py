"""What rows above a table's headings, and columns that are not read, say of its samples and of the impact."""

from __future__ import annotations

import datetime as dt
import io
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from binary_files import COLUMNS, mat, npz, parquet, xlsx
from ingest_files import GENERIC, codes, csv_text, one, read, refused, six_axis, zipped

from headimpact_service.ingest.facts_beside import facts_above
from headimpact_service.ingest.guarded.xlsx_file import _stated
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

SAMPLES = 120


def untimed(before: dict[str, Sequence[Any]] | None = None, rows: int = SAMPLES) -> list[list[Any]]:
    """Headings and samples without times, as rows; `before` are columns in front of them."""
    samples = six_axis(rows).tolist()
    columns = before or {}
    return [[*columns, *COLUMNS], *([*cells, *row] for *cells, row in zip(*columns.values(), samples, strict=True))]


def csv(rows: Sequence[Sequence[Any]], delimiter: str = ",") -> str:
    return "\n".join(delimiter.join("" if cell is None else str(cell) for cell in row) for row in rows)


def sheet(rows: Sequence[Sequence[Any]]) -> bytes:
    return xlsx({"a": rows})


TABLES = {"csv": csv, "xlsx": sheet}
every_table = pytest.mark.parametrize("write", TABLES.values(), ids=TABLES)


def shape(record: ImpactRecord) -> tuple[int, ...]:
    assert record.recording.linear_acceleration is not None
    return record.recording.linear_acceleration.values.shape


class TestRowsOfSeveral:
    """Rows of two impacts without times are told apart, or refused."""

    FULL = ("A",) * 70 + ("B",) * 50
    FIRST = ("A",) + ("",) * 69 + ("B",) + ("",) * 49

    @every_table
    @pytest.mark.parametrize("heading", ["", "Label", "Remark", "Foo"])
    @pytest.mark.parametrize("cells", [FULL, FIRST], ids=["full", "first row"])
    def test_words_that_name_many_rows_each(self, write: Any, heading: str, cells: Sequence[str]) -> None:
        table = write(untimed({heading: [cell or None for cell in cells]}))
        problem = refused(table, sample_rate_hz=1000.0)
        assert codes(problem) == [(None, "several-impacts")]
        assert f'["{heading or "Column 1"}"]' in problem.detail
        assert shape(one(table, sample_rate_hz=1000.0, mapping=Mapping(group_by=[]))) == (SAMPLES, 3)
        if cells is self.FULL:
            named = Mapping.model_validate({"group_by": [heading or "column 1"]})
            assert [shape(item) for item in read(table, sample_rate_hz=1000.0, mapping=named)] == [(70, 3), (50, 3)]

    @every_table
    def test_a_data_frame_s_index_that_begins_anew(self, write: Any) -> None:
        table = write(untimed({"": [*range(70), *range(50)]}))
        assert codes(refused(table, sample_rate_hz=1000.0)) == [(None, "several-impacts")]
        assert shape(one(write(untimed({"": range(SAMPLES)})), sample_rate_hz=1000.0)) == (SAMPLES, 3)

    @every_table
    @pytest.mark.parametrize(
        "cells",
        [
            ["pre"] * 40 + ["impact"] * 30 + ["post"] * 50,
            ["good contact", *[""] * 119],
            [*[""] * 20, "trigger", *[""] * 99],
            ["yes"] * 70 + ["no"] * 50,
            ["logger started", *[""] * 49, "strap loose", *[""] * 69],
            [36.6 + n // 40 / 10 for n in range(SAMPLES)],
        ],
    )
    def test_what_is_said_within_one_impact_leaves_it_one(self, write: Any, cells: Sequence[Any]) -> None:
        heading = "comment" if "strap loose" in cells else "Foo"
        table = write(untimed({heading: [None if cell == "" else cell for cell in cells]}))
        assert shape(one(table, sample_rate_hz=1000.0)) == (SAMPLES, 3)

    @every_table
    def test_a_video_s_frames_have_several_samples(self, write: Any) -> None:
        table = write(untimed({"video_frame": [n // 8 for n in range(SAMPLES)]}))
        assert shape(one(table, sample_rate_hz=1000.0)) == (SAMPLES, 3)

    @every_table
    def test_a_counter_beside_what_the_sender_says_tells_impacts_apart(self, write: Any) -> None:
        frames = [n // 8 for n in range(SAMPLES)]
        table = write(untimed({"impact_id": ["a"] * 70 + ["b"] * 50, "frame": frames}))
        assert codes(read(table, sample_rate_hz=1000.0)[0]) == [(None, "several-impacts")]
        named = Mapping(group_by=["impact_id"])
        assert [shape(item) for item in read(table, sample_rate_hz=1000.0, mapping=named)] == [(70, 3), (50, 3)]

    def test_headings_that_stand_again_in_a_sheet_join_two_tables(self) -> None:
        rows = untimed()
        table = sheet([*rows, [], *rows])
        problem = refused(table, sample_rate_hz=1000.0)
        assert codes(problem) == [(None, "several-impacts")]
        assert "headings stand again" in problem.detail
        named = untimed({"impact_id": ["a"] * SAMPLES})
        other = untimed({"impact_id": ["b"] * SAMPLES})
        assert len(read(sheet([*named, [], *other]), sample_rate_hz=1000.0)) == 2


class TestRowsThatAreNoSamples:
    """A column gives them a name where it numbers the samples, or says nothing of them."""

    @every_table
    @pytest.mark.parametrize(
        ("heading", "names", "at_end"),
        [
            ("", ["Range"], False),
            ("", ["Range", "Offset"], False),
            ("Name", ["Length"], False),
            ("", ["max", "min", "mean"], True),
            ("", ["count", "mean", "std", "min", "25%", "50%", "75%", "max"], True),
        ],
    )
    def test_they_are_refused(self, write: Any, heading: str, names: list[str], at_end: bool) -> None:
        unnamed: list[Any] = list(range(SAMPLES - len(names))) if at_end else [None] * (SAMPLES - len(names))
        cells = [*unnamed, *names] if at_end else [*names, *unnamed]
        problem = refused(write(untimed({heading: cells})), sample_rate_hz=1000.0)
        assert codes(problem) == [(None, "labelled-row")]
        row = SAMPLES - len(names) + 1 if at_end else 1
        assert f"calls row {row} below the headings {names[0]}," in problem.detail
        said = one(write(untimed({heading: cells})), sample_rate_hz=1000.0, mapping=Mapping(group_by=[]))
        assert shape(said) == (SAMPLES, 3)

    @every_table
    def test_a_number_of_samples_that_ends_in_a_word(self, write: Any) -> None:
        cells = [*range(SAMPLES - 1), "Max"]
        assert codes(refused(write(untimed({"Sample": cells})), sample_rate_hz=1000.0)) == [(None, "labelled-row")]


class TestRates:
    """A rate that a row above the headings states must be that of the samples."""

    @pytest.mark.parametrize(
        "row",
        [
            "Data were sampled at 2000 Hz",
            "# Data were sampled at 2 kHz",
            "Sampling interval 0.5 ms",
            "2000 samples per second",
            "2000 samples/s",
            "2 kS/s",
            "Samples/s,2000",
            "Sample rate,2,kS/s",
            "Taux (Hz),2000",
            "Delta_X,0.0005,s",
            "Period,0.5 ms",
            '"Sample rate (Hz)","2,000"',
            "Sample rate (Hz),2.000",
            "Sample rate: 2,000 Hz",
            "Sampling rate: 2k",
            "Data filtered at 1000 Hz and sampled at 2000 Hz",
            "Filtered at 1000 Hz, sampled at 2000 Hz",
            "Filter 1000 Hz. Sample rate: 2000 Hz.",
        ],
    )
    def test_in_words_or_in_cells(self, row: str) -> None:
        text = f"{row}\n{csv_text()}"
        problem = refused(text)
        assert codes(problem) == [("sample_rate_hz", "rate-differs")]
        assert "says 2000 samples per second" in problem.detail
        assert one(f"{row}\n{csv_text(rate_hz=2000.0)}").recording.linear_acceleration.sample_rate_hz == 2000.0

    @pytest.mark.parametrize(
        "row",
        [
            "Filtered at 300 Hz",
            "Low-pass filter cutoff 2000 Hz",
            "Video recorded at 120 Hz",
            "Trigger rate 2000 Hz",
            "Record of 2 s",
            "Period,2",
            "Period,2,s",
            "Samples per impact: 100",
            "Sample rate: 1,000 Hz",
            "Sampling rate: 1k",
            "Filtered at 300 Hz (4th order), sampled at 1000 Hz",
            "Acceleration data were filtered at 1650 Hz; sampling at 1 kHz",
            "Sample rate code: 7",
            "Dominant frequency (Hz),120",
            "Nyquist frequency: 500 Hz",
            "Loading rate: 300 Hz",
            "Data rate: 250 kHz",
            "Load cell sample rate: 20000 Hz",
            "Pressure sampled at 100 Hz",
            "Supported sample rates: 1000, 2000, 3200 Hz",
            "Data were sampled at 20000 Hz and decimated to 1000 Hz",
            "Sample rate,e.g. 3200 Hz",
            "ODR: 3200 Hz (decimated to 1000 Hz)",
            "Player 2000",
            "Sampled by 2 persons",
        ],
    )
    def test_of_something_else_none_is_taken(self, row: str) -> None:
        assert one(f"{row}\n{csv_text()}").recording.linear_acceleration.sample_rate_hz == 1000.0

    def test_in_a_sheet_before_the_table(self) -> None:
        rows = [GENERIC.split(","), *([n / 1000.0, *row] for n, row in enumerate(six_axis().tolist()))]
        info = [["Player", "p-17"], ["Sample rate (Hz)", 2000]]
        assert codes(refused(xlsx({"Info": info, "Data": rows}))) == [("sample_rate_hz", "rate-differs")]
        info[1][1] = 1000
        assert one(xlsx({"Info": info, "Data": rows})).athlete_external_id is None  # of whichever table it is

    def test_in_the_sheet_that_comes_last_before_each_table(self) -> None:
        sheets: dict[str, Any] = {}
        for rate in (1000, 2000):
            times = (n / rate for n in range(len(six_axis())))
            sheets[f"Info {rate}"] = [["Sample rate (Hz)", rate], ["Changed", "sampled at 500 Hz before"]]
            table = [[time, *row] for time, row in zip(times, six_axis().tolist(), strict=True)]
            sheets[f"Data {rate}"] = [GENERIC.split(","), *table]
        assert [isinstance(item, ImpactRecord) for item in read(xlsx(sheets))] == [True, True]

    @pytest.mark.parametrize("attributes", [{"fs": 2000}, {"sampling_rate": "2 kHz"}])
    def test_in_what_a_data_frame_says_of_itself(self, attributes: dict[str, Any]) -> None:
        table = pa.table(dict(zip(COLUMNS, six_axis(SAMPLES).T, strict=True)))
        attrs = table.replace_schema_metadata({"PANDAS_ATTRS": json.dumps(attributes)})
        assert codes(refused(parquet(attrs), sample_rate_hz=1000.0)) == [("sample_rate_hz", "rate-differs")]
        for text in ("{", "[]", "1", '{"fs": [2000]}', '{"fs": {"a": 2000}}'):
            other = table.replace_schema_metadata({"PANDAS_ATTRS": text})
            assert one(parquet(other), sample_rate_hz=1000.0)

    @pytest.mark.parametrize("name", ["fs_gyro", "fs_gyr", "fs_acc"])
    def test_fs_before_a_sensor_s_name_is_its_rate(self, name: str) -> None:
        samples = six_axis()
        arrays = {"linear_acceleration_g": samples[:, :3], "angular_velocity_rad_s": samples[:, 3:], name: 2000.0}
        assert codes(refused(npz(**arrays), sample_rate_hz=1000.0)) == [("sample_rate_hz", "rate-differs")]
        assert codes(refused(mat(arrays), sample_rate_hz=1000.0, mapping=_arrays())) == [
            ("sample_rate_hz", "rate-differs")
        ]

    def test_a_sensor_s_own_rate_in_a_mapping_stands_beside_the_others_(self) -> None:
        samples = six_axis()
        twice = np.repeat(samples[:, 3:], 2, axis=0)
        arrays = {"linear_acceleration_g": samples[:, :3], "angular_velocity_rad_s": twice, "fs_gyro": 2000.0}
        own = Mapping.model_validate({"angular_velocity": {"sample_rate_hz": 2000}})
        record = one(npz(**arrays), sample_rate_hz=1000.0, mapping=own)
        assert [signal.sample_rate_hz for _, signal in record.recording.signals()] == [1000.0, 2000.0]
        each = {"linear_acceleration": {"sample_rate_hz": 1000}, "angular_velocity": {"sample_rate_hz": 2000}}
        both = Mapping.model_validate(each)
        assert codes(refused(npz(**arrays), sample_rate_hz=1000.0, mapping=both)) == [
            ("sample_rate_hz", "rate-differs")
        ]


def _arrays() -> Mapping:
    return Mapping.model_validate(
        {
            signal: {"unit": unit} | {axis: f"{signal}_{ending}_{axis}" for axis in "xyz"}
            for signal, unit, ending in (
                ("linear_acceleration", "g", "g"),
                ("angular_velocity", "rad/s", "rad_s"),
            )
        }
    )


class TestAxes:
    """Axes that are said to be those of SAE J211 are not taken for anatomical ones."""

    WORDS = ("SAE J211", "sae_j211", "J211-1", "SAE", "SAE J211/1", "SAE J1733", "ISO 6487 / SAE J211")

    @pytest.mark.parametrize(
        ("name", "said"),
        [
            *(("Axes", said) for said in (*WORDS, "x forward, y right, z down", "z: down", "y to the right")),
            *((name, "J211") for name in ("Frame", "Achsen", "Vorzeichen", "Sign convention")),
        ],
    )
    def test_by_a_row_above_the_headings(self, name: str, said: str) -> None:
        text = (
            f'{name}: "{said}"\n{csv_text()}'.replace('"', "") if "," not in said else f"{name}: {said}\n{csv_text()}"
        )
        assert codes(refused(text)) == [("axes", "axes-unclear")]
        assert one(text, axes="sae_j211").recording.axes == "sae_j211"
        assert one(text, axes="anatomical").recording.axes == "anatomical"

    @pytest.mark.parametrize(
        "rows",
        [
            "y right; z down",
            "x forward, y right, z down",
            "y axis: right\nz axis: down",
            "+Y right, +Z down",
            "y,right",
        ],
    )
    def test_by_their_directions(self, rows: str) -> None:
        assert codes(refused(f"{rows}\n{csv_text()}")) == [("axes", "axes-unclear")]

    @pytest.mark.parametrize(
        ("heading", "said"),
        [
            *(("frame", said) for said in WORDS),
            *((heading, "J211") for heading in ("coordinate_system", "Convention", "axis_system")),
        ],
    )
    def test_by_a_column(self, heading: str, said: str) -> None:
        text = csv_text(before={heading: said})
        assert codes(refused(text)) == [("axes", "axes-unclear")]
        assert one(text, axes="sae_j211").recording.axes == "sae_j211"
        mapped = Mapping.model_validate({"axes": "anatomical"})
        assert one(text, mapping=mapped).recording.axes == "anatomical"

    @pytest.mark.parametrize(
        "said",
        ["head", "anatomical", "x forward, y left, z up", "2110", "right-handed", "12", "SAE J211 or anatomical"],
    )
    def test_other_words_for_axes_are_none_of_theirs(self, said: str) -> None:
        assert one(csv_text(before={"frame": f'"{said}"'})).recording.axes == "anatomical"
        assert one(f"Axes: {said}\n{csv_text()}").recording.axes == "anatomical"

    def test_by_an_array_of_text(self) -> None:
        samples = six_axis()
        arrays = {"linear_acceleration_g": samples[:, :3], "angular_velocity_rad_s": samples[:, 3:]}
        file = npz(**arrays, frame=np.array("SAE J211"))
        assert codes(refused(file, sample_rate_hz=1000.0)) == [("axes", "axes-unclear")]


class TestUnits:
    @pytest.mark.parametrize("said", ["m/s^2", "m/s2", "m/s^2; deg/s", "g, deg/s"])
    def test_a_column_of_another_unit_is_held_against_the_headings(self, said: str) -> None:
        text = csv_text(before={"units": f'"{said}"'})
        assert codes(refused(text)) == [("mapping", "units-differ")]
        assert one(text, mapping=_generic()).recording.linear_acceleration.unit == "g"

    def test_one_behind_a_column_that_is_not_read_may_be_of_that(self) -> None:
        lines = [
            f"gravity,unit,{row}" if n == 0 else f"9.81,m/s^2,{row}" for n, row in enumerate(csv_text().splitlines())
        ]
        assert one("\n".join(lines)).recording.linear_acceleration.unit == "g"

    @pytest.mark.parametrize("said", ["g", "g, rad/s", "g rad/s", "g / rad/s", "g+rad/s", "g_rad/s", "mixed", "", "ms"])
    def test_a_column_of_the_same_or_of_none(self, said: str) -> None:
        assert one(csv_text(before={"Unit": f'"{said}"'})).recording.linear_acceleration.unit == "g"

    def test_each_impact_has_its_own(self) -> None:
        lines = csv_text(before={"impact_id": "a", "unit": "g"}).splitlines()
        others = csv_text(before={"impact_id": "b", "unit": "m/s^2"}).splitlines()[1:]
        first, second = read("\n".join([*lines, *others]))
        assert isinstance(first, ImpactRecord)
        assert not isinstance(second, ImpactRecord)
        assert codes(second) == [("mapping", "units-differ")]


def _generic() -> Mapping:
    names = iter(GENERIC.split(",")[1:])
    return Mapping.model_validate(
        {
            "linear_acceleration": {"unit": "g"} | {axis: next(names) for axis in "xyz"},
            "angular_velocity": {"unit": "rad/s"} | {axis: next(names) for axis in "xyz"},
            "time": {"column": GENERIC.split(",")[0], "unit": "s"},
        }
    )


def test_a_heading_that_begins_with_a_minus_is_for_a_mapping_to_explain() -> None:
    text = csv_text(heading="t_s,ax_g,-ay_g,-az_g,wx_rad_s,wy_rad_s,wz_rad_s")
    assert refused(text).status == 422
    columns = {"x": "ax_g", "y": "ay_g", "z": "-az_g", "unit": "g"}
    rotation = {axis: f"w{axis}_rad_s" for axis in "xyz"} | {"unit": "rad/s"}
    mapping = {"linear_acceleration": columns, "angular_velocity": rotation, "time": {"column": "t_s", "unit": "s"}}
    record = one(text, mapping=Mapping.model_validate(mapping))
    assert record.recording.linear_acceleration is not None
    np.testing.assert_array_equal(record.recording.linear_acceleration.values, six_axis()[:, :3] * (1, 1, -1))


@pytest.mark.parametrize("names", ["Rx,Ry,Rz", "Rx (r/s),Ry (r/s),Rz (r/s)", "x_dot,y_dot,z_dot"])
def test_three_columns_of_unknown_words_are_noted_where_rotation_lacks(names: str) -> None:
    record = one(csv_text(heading=f"t_s,ax_g,ay_g,az_g,{names}"))
    assert [name for name, _ in record.recording.signals()] == ["linear_acceleration"]
    assert [note.code for note in record.notes] == ["channel_missing"]


def test_omega_on_axes_of_the_body_is_not_passed_over() -> None:
    problem = refused(csv_text(heading="t_s,ax_g,ay_g,az_g,w_sag,w_cor,w_ax"))
    assert codes(problem) == [("/angular_velocity", "columns-not-read")]


class TestFacts:
    """Whose the impact is, from which device and when."""

    WHEN = dt.datetime(2026, 3, 5, 14, 5, 22, tzinfo=dt.UTC)

    @pytest.mark.parametrize("player", ["Player", "Player ID", "Athlete", "Player Name", "# Player"])
    @pytest.mark.parametrize("device", ["Device ID", "Serial Number"])
    def test_rows_above_the_headings_say_them(self, player: str, device: str) -> None:
        rows = f"{player},p-17\nEvent time,2026-03-05T14:05:22Z\n{device}: mg-42\n"
        record = one(rows + csv_text())
        assert (record.athlete_external_id, record.device_serial, record.occurred_at) == ("p-17", "mg-42", self.WHEN)

    def test_an_id_counts_before_a_name_and_none_where_a_mapping_reads_none(self) -> None:
        rows = "Player: Tom Jones\nPlayer ID: 17\nDevice ID: mg-1\n"
        assert one(rows + csv_text()).athlete_external_id == "17"
        record = one(rows + csv_text(), mapping=Mapping.model_validate({"athlete": None, "device": None}))
        assert (record.athlete_external_id, record.device_serial) == (None, None)

    def test_a_workbook_s_own_date_above_the_table_is_a_time(self) -> None:
        cell = dt.datetime(2026, 3, 5, 14, 5, 22)  # noqa: DTZ001 - as a sheet has it
        assert facts_above([["Event time", _stated(cell)]], "UTC").occurred_at == self.WHEN

    def test_what_stands_nearer_counts(self) -> None:
        rows = "Player,p-17\nEvent time,2026-03-05T14:05:22Z\nDevice ID,mg-42\n"
        text = rows + csv_text(before={"athlete": "p-1", "device": "mg-1", "occurred_at": "2026-01-01T00:00:00Z"})
        record = one(text)
        assert (record.athlete_external_id, record.device_serial) == ("p-1", "mg-1")
        assert record.occurred_at == dt.datetime(2026, 1, 1, tzinfo=dt.UTC)
        beside = one(rows + csv_text(), athlete="p-2", device="mg-2", occurred_at=self.WHEN + dt.timedelta(1))
        assert (beside.athlete_external_id, beside.device_serial) == ("p-2", "mg-2")
        assert beside.occurred_at == self.WHEN + dt.timedelta(1)

    def test_a_time_above_is_that_of_one_impact(self) -> None:
        rows = "Player,p-17\nEvent time,2026-03-05T14:05:22Z\n"
        record = one(rows + csv_text(before={"impact_id": "a"}))
        assert (record.athlete_external_id, record.occurred_at) == ("p-17", None)

    def test_a_name_that_is_none_is_refused(self) -> None:
        problem = refused(f"Player,{'p' * 201}\n{csv_text()}")
        assert codes(problem) == [("athlete", "name-form")]

    @pytest.mark.parametrize(
        "rows", ["Device,Mouthguard 3\n", "Event time,5 March\n", "Date,05/03/2026\nTime,14:05:22\n"]
    )
    def test_what_is_not_sure_is_left_alone(self, rows: str) -> None:
        record = one(rows + csv_text(), time_zone="Europe/Dublin")
        assert (record.athlete_external_id, record.device_serial, record.occurred_at) == (None, None, None)

    @pytest.mark.parametrize("heading", ["Event Time", "impact_time", "timestamp", "DateTime"])
    def test_a_column_says_when_each_impact_was(self, heading: str) -> None:
        text = csv_text(before={"impact_id": "a", heading: "2026-03-05T14:05:22Z"})
        assert one(text).occurred_at == self.WHEN
        local = csv_text(before={"impact_id": "a", heading: "2026-03-05 14:05:22"})
        assert one(local).occurred_at is None
        assert one(local, time_zone="UTC").occurred_at == self.WHEN

    def test_so_do_a_date_s_and_a_time_s(self) -> None:
        text = csv_text(before={"impact_id": "a", "date": "2026-03-05", "time": "14:05:22"}, heading=GENERIC)
        assert one(text, time_zone="UTC").occurred_at == self.WHEN
        assert one(text).occurred_at is None


def test_axes_below_quantities_that_stand_above_each_of_them_are_headings() -> None:
    upper = ["t", *["acc (g)"] * 3, *["gyro (rad/s)"] * 3]
    rows = [upper, ["s", "x", "y", "z", "x", "y", "z"]]
    samples = [[n / 1000.0, *row] for n, row in enumerate(six_axis().tolist())]
    expected = one(csv_text()).recording
    merged = [[None, *upper], [None, *rows[1]], [], *([n, *row] for n, row in enumerate(samples))]
    for table in (csv([*rows, *samples]), csv([*rows, *samples], ";"), sheet([*rows, *samples]), sheet(merged)):
        found = one(table).recording
        for (_, signal), (_, other) in zip(found.signals(), expected.signals(), strict=True):
            np.testing.assert_array_equal(signal.values, other.values)
        assert found.linear_acceleration is not None
        assert found.linear_acceleration.sample_rate_hz == 1000.0


@pytest.mark.parametrize("heading", ["t_ms", "t_us", "time", "time (s)"])
@pytest.mark.parametrize("unit", ["s", "ms", "us", None])
def test_a_duration_s_type_says_its_unit(heading: str, unit: str | None) -> None:
    columns: dict[str, Any] = dict(zip(COLUMNS, six_axis(SAMPLES).T, strict=True))
    table = pa.table({heading: pa.array(np.arange(SAMPLES) * 500, pa.duration("us"))} | columns)
    mapping = None if unit is None else Mapping.model_validate({"time": {"column": heading, "unit": unit}})
    assert one(parquet(table), mapping=mapping).recording.linear_acceleration.sample_rate_hz == 2000.0


@pytest.mark.parametrize("name", ["a.parquet", "deep/a.MAT", "a.json"])
def test_a_file_that_is_read_by_itself_is_named_where_it_comes_in_an_archive(name: str) -> None:
    buffer = io.BytesIO(zipped({"readme.txt": "x", name: b"PAR1"}))
    problem = refused(buffer.getvalue())
    assert (problem.slug, problem.detail) == (
        "unsupported-media-type",
        f"Of an archive, {name} is not read: send it by itself.",
    )
