"""Parquet and Arrow IPC: a row a sample, a row an impact with lists, or rows in the shape of our JSON."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from binary_files import COLUMNS, arrow, nested, noise, parquet, wide
from ingest_files import body, codes, one, read, refused

from headimpact.preparation import prepare
from headimpact_service.errors import Problem
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.upload import read_upload

WRITERS: dict[str, Callable[[pa.Table], bytes]] = {
    "parquet": parquet,
    "row groups of a few rows": lambda table: parquet(table, row_group_size=7),
    "zstd, version 1 pages": lambda table: parquet(table, compression="zstd", data_page_version="1.0"),
    "no dictionary": lambda table: parquet(table, use_dictionary=False),
    "arrow file": arrow,
    "arrow stream": lambda table: arrow(table, pa.ipc.new_stream),
    "arrow file, lz4": lambda table: arrow(table, compression="lz4"),
}
every_writer = pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)


def records(data: bytes, **options: Any) -> list[ImpactRecord]:
    found = read(data, **options)
    assert all(isinstance(item, ImpactRecord) for item in found), found[0]
    return [item for item in found if isinstance(item, ImpactRecord)]


def samples_of(record: ImpactRecord) -> np.ndarray:
    return np.concatenate([signal.values for _, signal in record.recording.signals()], axis=1)


@every_writer
@pytest.mark.parametrize("shape", [wide, nested])
def test_samples_come_back_to_the_last_bit(write: Callable[[pa.Table], bytes], shape: Callable[..., pa.Table]):
    values = noise()
    found = records(write(shape(values)))
    assert [record.external_id for record in found] == ["i0", "i1", "i2"]
    for record, sent in zip(found, values, strict=True):
        np.testing.assert_array_equal(samples_of(record), sent)
        assert [signal.unit for _, signal in record.recording.signals()] == ["g", "rad/s"]
        assert {signal.sample_rate_hz for _, signal in record.recording.signals()} == {1000.0}
    assert found[0].metadata["format"] in {"parquet", "arrow"}


@every_writer
def test_rows_in_the_shape_of_our_json_lose_nothing(write: Callable[[pa.Table], bytes]):
    mounting = {"accelerometer": {"rotation": np.eye(3).tolist(), "offset_mm": [70.0, 0.0, 10.0]}}
    bodies = [body(), body(external_id="b", athlete={"external_id": "p-18"})]
    bodies[1]["kinematics"] |= {"axes": "sae_j211", "location": "sensor", "mounting": mounting, "filter": "none"}
    del bodies[1]["kinematics"]["pre_trigger_ms"]
    first, second = records(write(pa.Table.from_pylist(bodies)))
    np.testing.assert_array_equal(samples_of(first), samples_of(one(parquet(pa.Table.from_pylist(bodies[:1])))))
    assert (first.external_id, first.athlete_external_id) == ("mg-0042/1763665445123", "p-17")
    assert first.context["position"] == "LB"
    assert first.recording.pre_trigger_ms == 10.0
    assert (second.recording.axes, second.recording.pre_trigger_ms) == ("sae_j211", None)
    assert second.recording.mounting is not None
    np.testing.assert_array_equal(second.recording.mounting.offset_m, [0.07, 0.0, 0.01])


def test_a_row_in_the_shape_of_our_json_keeps_its_rules_and_its_name():
    bad, good = read(parquet(pa.Table.from_pylist([body(external_id="b", sex="f"), body(external_id="a")])))
    assert isinstance(good, ImpactRecord)
    assert isinstance(bad, Problem)
    assert codes(bad) == [("/sex", "unknown-field")]
    assert getattr(bad, "external_id", None) == "b"
    problem = refused(parquet(pa.Table.from_pylist([body()])), preset="prevent")
    assert "names its own fields" in problem.detail


def test_times_in_rows_of_json_may_be_timestamps():
    row = body() | {"occurred_at": dt.datetime(2026, 11, 20, 19, 4, 5, tzinfo=dt.UTC)}
    assert one(parquet(pa.Table.from_pylist([row]))).occurred_at == row["occurred_at"]


def with_units(table: pa.Table, units: dict[str, str]) -> pa.Table:
    fields = [
        field.with_metadata({"unit": units[field.name]}) if field.name in units else field for field in table.schema
    ]
    return table.cast(pa.schema(fields))


@every_writer
def test_the_unit_of_a_column_may_stand_in_its_metadata(write: Callable[[pa.Table], bytes]):
    names = [f"{signal}_{axis}" for signal in ("linear_acceleration", "angular_velocity") for axis in "xyz"]
    plain = nested(noise()).rename_columns(["external_id", "time", *names])
    problem = refused(write(plain))
    assert codes(problem) == [("/linear_acceleration/unit", "unit-missing")]
    units = dict.fromkeys(names[:3], "m/s^2") | dict.fromkeys(names[3:], "deg/s") | {"time": "ms"}
    recording = records(write(with_units(plain, units)))[0].recording
    assert [(signal.unit, signal.sample_rate_hz) for _, signal in recording.signals()] == [
        ("m/s^2", 1000.0),
        ("deg/s", 1000.0),
    ]


def test_a_mapping_gives_names_signs_and_units():
    table = nested(noise()).rename_columns(["name", "clock", "a1", "a2", "a3", "w1", "w2", "w3"])
    mapping = {
        "linear_acceleration": {"unit": "g", "x": "a1", "y": "-a3", "z": "a2"},
        "time": {"column": "clock", "unit": "ms"},
        "external_id": "name",
    }
    [first, *_] = records(parquet(table), mapping=Mapping.model_validate(mapping))
    assert first.external_id == "i0"
    np.testing.assert_array_equal(samples_of(first), noise()[0][:, [0, 2, 1]] * [1.0, -1.0, 1.0])


@pytest.mark.parametrize("kind", [pa.float32(), pa.float16(), pa.int16(), pa.int64(), pa.decimal128(12, 3)])
@pytest.mark.parametrize("shape", [wide, nested])
def test_any_type_of_number_is_a_sample(kind: pa.DataType, shape: Callable[..., pa.Table]):
    table = shape(np.round(noise() * 8.0) * 4.0)
    kinds = [
        pa.field(field.name, pa.list_(kind) if pa.types.is_list(field.type) else kind)
        if field.name in COLUMNS
        else field
        for field in table.schema
    ]
    np.testing.assert_array_equal(
        samples_of(records(parquet(table.cast(pa.schema(kinds))))[0]), samples_of(records(parquet(table))[0])
    )


@pytest.mark.parametrize("kind", [pa.large_list(pa.float64()), pa.list_(pa.float64(), 40)])
def test_any_type_of_list_holds_samples(kind: pa.DataType):
    table = nested(noise())
    fields = [pa.field(field.name, kind) if field.name in COLUMNS else field for field in table.schema]
    for write in (parquet, arrow):
        np.testing.assert_array_equal(samples_of(records(write(table.cast(pa.schema(fields))))[2]), noise()[2])


def test_signals_of_unlike_lengths_end_where_their_lists_end():
    table = nested(noise(2)).drop_columns(["t_ms", *COLUMNS[3:]])
    short = [[list(row[:25]) for row in noise(2)[:, :, place]] for place in (3, 4, 5)]
    for name, lists in zip(COLUMNS[3:], short, strict=True):
        table = table.append_column(name, pa.array(lists))
    recording = records(parquet(table), sample_rate_hz=1000.0)[1].recording
    assert [signal.values.shape for _, signal in recording.signals()] == [(40, 3), (25, 3)]
    np.testing.assert_array_equal(recording.signals()[1][1].values, noise(2)[1, :25, 3:])


def test_a_signal_that_an_impact_lacks_is_null_in_its_row():
    table = nested(noise(2))
    for name in COLUMNS[3:]:
        place = table.schema.get_field_index(name)
        table = table.set_column(place, name, pa.array([None, table[name][1].as_py()], pa.list_(pa.float64())))
    first, second = records(parquet(table))
    assert [name for name, _ in first.recording.signals()] == ["linear_acceleration"]
    assert len(second.recording.signals()) == 2


def test_a_missing_sample_is_the_fault_of_its_own_impact():
    lists = nested(noise())["ay_g"].to_pylist()
    lists[1][5] = None
    table = nested(noise())
    good, bad, last = read(parquet(table.set_column(3, "ay_g", pa.array(lists))))
    assert isinstance(good, ImpactRecord)
    assert isinstance(last, ImpactRecord)
    assert isinstance(bad, Problem)
    assert [error.code for error in bad.errors] == ["missing-sample"]
    assert "sample 5" in bad.detail


def test_what_is_said_of_an_impact_is_read_as_text():
    table = nested(noise(2))
    said: dict[str, Any] = {
        "athlete_id": pa.array(["p-1", "p-2"]).dictionary_encode(),
        "device_serial": pa.array([12, None], pa.int64()),
        "session_id": pa.array([1.5, 2.0]),
        "occurred_at": pa.array([0, 10**6], pa.timestamp("ns", tz="Europe/Dublin")),
    }
    for name, column in said.items():
        table = table.append_column(name, column)
    for write in (parquet, arrow):
        first, second = records(write(table))
        assert (first.athlete_external_id, second.athlete_external_id) == ("p-1", "p-2")
        assert (first.device_serial, second.device_serial) == ("12", None)
        assert (first.context["session_id"], second.context["session_id"]) == ("1.5", "2")
        assert second.occurred_at == dt.datetime(1970, 1, 1, 0, 0, 0, 1000, tzinfo=dt.UTC)


@pytest.mark.parametrize(
    ("column", "zone", "expected"),
    [
        (pa.array([0], pa.timestamp("s")), "Europe/Dublin", dt.datetime(1969, 12, 31, 23, tzinfo=dt.UTC)),
        (pa.array(["2026-11-20T19:04:05Z"]), None, dt.datetime(2026, 11, 20, 19, 4, 5, tzinfo=dt.UTC)),
        (pa.array([2**62], pa.timestamp("us", tz="UTC")), None, None),
    ],
)
def test_times_without_a_zone_need_one_beside_the_file(
    column: pa.Array, zone: str | None, expected: dt.datetime | None
):
    table = nested(noise(1)).append_column("occurred_at", column)
    [found] = read(parquet(table), time_zone=zone)
    assert (found.occurred_at if isinstance(found, ImpactRecord) else None) == expected


def test_rows_may_stand_in_any_order_in_a_table_of_one_window():
    table = wide(noise())
    order = np.arange(table.num_rows).reshape(3, 40).T.reshape(-1)
    for record, sent in zip(records(parquet(table.take(order))), noise(), strict=True):
        np.testing.assert_array_equal(samples_of(record), sent)


def test_blocks_and_batches_make_no_difference(tmp_path: Path):
    values = noise(900, 40)
    path = tmp_path / "many.parquet"
    for shape in (wide, nested):
        path.write_bytes(parquet(shape(values), row_group_size=1000))
        found = [item for item in read_upload(path, ImportOptions()) if isinstance(item, ImpactRecord)]
        assert [record.external_id for record in found] == [f"i{number}" for number in range(900)]
        np.testing.assert_array_equal(np.stack([samples_of(record) for record in found]), values)


@every_writer
@pytest.mark.parametrize(
    ("table", "said"),
    [
        (pa.table({"a": [1.0]}), "The columns of no signal were found"),
        (wide(noise(0)), "no samples"),
        (nested(noise(1)).slice(1), "no samples"),
        (pa.table({"linear_acceleration": pa.array([], pa.struct([("x", pa.float64())]))}), "No signal"),
        (wide(noise(1)).append_column("ax_g", pa.array([0.0] * 40)), "same heading"),
        (wide(noise(1)).set_column(2, "ax_g", pa.array(["word"] * 40)), "holds no numbers"),
        (pa.table({f"c{i}": [0.0] for i in range(1025)}), "1024 columns"),
        (wide(noise(1)).set_column(0, "external_id", pa.array([["a"]] * 40)), "something else"),
        (wide(noise(1)).set_column(0, "external_id", pa.array(["a" * 1001] * 40)), "1000 characters"),
        (pa.table({"kinematics": pa.array([], pa.struct([("axes", pa.string())]))}), "no impact"),
    ],
)
def test_a_table_that_cannot_be_read_says_why(write: Callable[[pa.Table], bytes], table: pa.Table, said: str):
    problem = refused(write(table))
    assert problem.slug == "unreadable-file"
    assert said in problem.detail


@every_writer
def test_a_file_that_is_cut_off_is_refused_or_gives_its_first_impacts(write: Callable[[pa.Table], bytes]):
    data = write(nested(noise()))
    for length in (12, len(data) // 3, len(data) - 9):
        problem = refused(data[:length])
        assert problem.slug == "unreadable-file"
        assert problem.status == 422


@every_writer
@pytest.mark.parametrize(
    "times",
    [
        *(pa.array(np.arange(40) * step, pa.timestamp(unit)) for unit, step in (("ns", 500_000), ("us", 500))),
        pa.array(1_800_000_000_000_000_000 + np.arange(40) * 500_000, pa.timestamp("ns", "UTC")),
        *(pa.array(np.arange(40) * step, pa.duration(unit)) for unit, step in (("ns", 500_000), ("us", 500))),
    ],
    ids=lambda times: str(times.type),
)
def test_times_say_their_unit_by_their_type(write: Callable[[pa.Table], bytes], times: pa.Array):
    [values] = noise(1)
    columns = {"timestamp": times} | {name: pa.array(column) for name, column in zip(COLUMNS, values.T, strict=True)}
    [record] = records(write(pa.table(columns)))
    assert prepare(record.recording).kinematics.sample_rate_hz == 2000.0


def test_a_time_that_all_rows_share_is_the_impact_s_and_not_its_samples():
    [values] = noise(1)
    when = pa.array([1_800_000_000_000_000] * len(values), pa.timestamp("us", "UTC"))
    columns = {"timestamp": when} | {name: pa.array(column) for name, column in zip(COLUMNS, values.T, strict=True)}
    [record] = records(parquet(pa.table(columns)), sample_rate_hz=2000.0)
    assert record.recording.linear_acceleration.sample_rate_hz == 2000.0


@every_writer
def test_a_column_that_parts_rows_without_times_is_seen_beside_columns_of_any_type(
    write: Callable[[pa.Table], bytes],
):
    rows = len(noise()) * 40
    untimed = wide(noise()).drop_columns(["external_id", "t_ms"])
    untimed = untimed.append_column("marks", pa.array([[1, 2]] * rows, pa.list_(pa.int8())).cast(pa.list_(pa.string())))
    parted = untimed.append_column("k", pa.array(np.repeat([1.0, 2.0, 3.0], 40)))
    assert codes(refused(write(parted), sample_rate_hz=1000.0)) == [(None, "several-impacts")]
    [record] = records(write(untimed), sample_rate_hz=1000.0)
    assert samples_of(record).shape == (rows, 6)


@every_writer
def test_a_column_of_nulls_says_nothing(write: Callable[[pa.Table], bytes]):
    [record] = records(write(wide(noise(1)).append_column("athlete", pa.nulls(40))))
    assert record.athlete_external_id is None
