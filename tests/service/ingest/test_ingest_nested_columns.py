"""Parquet and Arrow columns of structs and of lists within lists, laid out as columns of their own."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from binary_files import arrow, noise, parquet
from ingest_files import read, refused

from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

IMPACTS, SAMPLES = 3, 40
NAMES = ("acc_g", "gyro_rad_s")


def vectors() -> list[np.ndarray]:
    """Acceleration and angular velocity, each impacts x samples x 3."""
    values = noise(IMPACTS, SAMPLES)
    return [values[..., :3], values[..., 3:]]


def by_axis(samples: np.ndarray) -> dict[str, Any]:
    return {axis: samples[..., place].tolist() for place, axis in enumerate("xyz")}


def of_impacts(cell: Callable[[np.ndarray], Any]) -> dict[str, Any]:
    """A row an impact: a cell of each signal, from samples x 3."""
    columns = zip(NAMES, vectors(), strict=True)
    return {"external_id": ["i0", "i1", "i2"]} | {name: [cell(one) for one in values] for name, values in columns}


def of_samples(cell: Callable[[np.ndarray], Any], kind: pa.DataType) -> dict[str, Any]:
    """A row a sample: a cell of each signal, from 3 components."""
    columns = zip(NAMES, vectors(), strict=True)
    return {
        "external_id": np.repeat(["i0", "i1", "i2"], SAMPLES),
        "t_ms": np.tile(np.arange(SAMPLES) * 1.0, IMPACTS),
    } | {name: pa.array([cell(row) for row in values.reshape(-1, 3)], kind) for name, values in columns}


POINT = pa.struct([(axis, pa.float64()) for axis in "xyz"])
SHAPES: dict[str, dict[str, Any]] = {
    "lists of triples": of_impacts(np.ndarray.tolist),
    "lists of structs": of_impacts(lambda one: [by_axis(row) for row in one]),
    "structs of lists": of_impacts(by_axis),
    "three lists in one": of_impacts(lambda one: one.T.tolist()),
    "structs within structs": of_impacts(lambda one: {"of": by_axis(one)}),
    "a struct a sample": of_samples(by_axis, POINT),
    "a vector a sample": of_samples(np.ndarray.tolist, pa.list_(pa.float64(), 3)),
    "a list of three a sample": of_samples(np.ndarray.tolist, pa.list_(pa.float64())),
}
MAPPING = {
    name: {"unit": unit} | {axis: f"{column}_of_{axis}" for axis in "xyz"}
    for name, unit, column in (
        ("linear_acceleration", "g", NAMES[0]),
        ("angular_velocity", "rad/s", NAMES[1]),
    )
} | {"external_id": "external_id"}


@pytest.mark.parametrize(
    "write", [parquet, lambda table: parquet(table, row_group_size=7), arrow], ids=["parquet", "row groups", "arrow"]
)
@pytest.mark.parametrize("shape", SHAPES)
def test_samples_come_back_to_the_last_bit(write: Callable[[pa.Table], bytes], shape: str):
    options: dict[str, Any] = {} if "sample" in shape else {"sample_rate_hz": 1000.0}
    if "within" in shape:
        options["mapping"] = Mapping.model_validate(MAPPING)
    found = read(write(pa.table(SHAPES[shape])), **options)
    assert len(found) == IMPACTS
    for number, record in enumerate(found):
        assert isinstance(record, ImpactRecord), record.as_dict()
        assert record.external_id == f"i{number}"
        signals = [signal for _, signal in record.recording.signals()]
        assert [(signal.unit, signal.sample_rate_hz) for signal in signals] == [("g", 1000.0), ("rad/s", 1000.0)]
        for signal, sent in zip(signals, vectors(), strict=True):
            np.testing.assert_array_equal(signal.values, sent[number])


def test_six_axes_in_one_list_are_numbered_for_a_mapping():
    table = pa.table({"imu": list(noise(2).tolist())})
    mapping = {
        "linear_acceleration": {"unit": "g", "x": "imu_1", "y": "imu_2", "z": "imu_3"},
        "angular_velocity": {"unit": "rad/s", "x": "imu_4", "y": "imu_5", "z": "imu_6"},
        "sample_rate_hz": 1000.0,
    }
    [first, _] = read(parquet(table), mapping=Mapping.model_validate(mapping))
    assert isinstance(first, ImpactRecord)
    np.testing.assert_array_equal(np.hstack([signal.values for _, signal in first.recording.signals()]), noise(2)[0])


def test_a_signal_that_an_impact_lacks_is_null():
    acceleration, velocity = (values.tolist() for values in vectors())
    table = pa.table({NAMES[0]: acceleration, NAMES[1]: [velocity[0], None, velocity[2]]})
    found = read(parquet(table), sample_rate_hz=1000.0)
    lengths = [len(record.recording.signals()) for record in found if isinstance(record, ImpactRecord)]
    assert lengths == [2, 1, 2]


def test_the_unit_of_a_column_holds_for_its_parts():
    kind = pa.list_(pa.list_(pa.float64()))
    fields = [
        pa.field("linear_acceleration", kind, metadata={"unit": "m/s^2"}),
        pa.field("angular_velocity", kind, metadata={"unit": "deg/s"}),
    ]
    columns = [pa.array(values.tolist(), kind) for values in vectors()]
    [first, *_] = read(parquet(pa.table(columns, schema=pa.schema(fields))), sample_rate_hz=1000.0)
    assert isinstance(first, ImpactRecord)
    assert [signal.unit for _, signal in first.recording.signals()] == ["m/s^2", "deg/s"]


@pytest.mark.parametrize("ragged", [[1.0, 2.0], [1.0, 2.0, 3.0, 4.0], []])
def test_vectors_of_unlike_lengths_are_refused_by_name(ragged: list[float]):
    cells = vectors()[0].tolist()
    cells[1][7] = ragged
    problem = refused(parquet(pa.table({NAMES[0]: cells})), sample_rate_hz=1000.0)
    assert problem.slug == "unreadable-file"
    assert problem.detail == "The lists within acc_g differ in length: the first has 3 components."


def test_a_vector_that_is_missing_is_a_missing_sample():
    cells = vectors()[0].tolist()
    cells[0][7] = None
    bad, *_ = read(parquet(pa.table({NAMES[0]: cells})), sample_rate_hz=1000.0)
    assert not isinstance(bad, ImpactRecord)
    assert [error.code for error in bad.errors] == ["missing-sample"]


def test_thousands_of_parts_are_too_many_columns():
    wide = pa.struct([(f"f{number}", pa.float32()) for number in range(2000)])
    problem = refused(parquet(pa.table({"a": pa.array([None], wide)})))
    assert "at most 1024 columns" in problem.detail


def test_a_table_without_rows_is_laid_out_by_its_types():
    empty = pa.table({NAMES[0]: pa.array([], pa.list_(pa.list_(pa.float64()))), NAMES[1]: pa.array([], POINT)})
    assert refused(parquet(empty)).status == 422


def test_three_numbers_beside_lists_of_samples_are_no_vectors_of_samples():
    columns = {f"{name}_{axis}": noise(9)[..., at].tolist() for at, (name, axis) in enumerate(product(NAMES, "xyz"))}
    found = read(parquet(pa.table(columns | {"place_mm": [[70.0, 0.0, -60.0]] * 9})), sample_rate_hz=1000.0)
    assert [isinstance(record, ImpactRecord) for record in found] == [True] * 9


@pytest.mark.parametrize(
    "kind", [pa.time64("us"), pa.time64("ns"), pa.time32("ms"), pa.duration("us"), pa.timestamp("us")], ids=str
)
def test_times_of_any_type_are_those_of_samples(kind: pa.DataType):
    begins = 43_200_000 if pa.types.is_time(kind) else 0
    per_ms = {"ms": 1, "us": 1000, "ns": 1_000_000}[kind.unit]
    stamps = [(begins + 2 * number) * per_ms for number in range(SAMPLES)]
    table = of_samples(np.ndarray.tolist, pa.list_(pa.float64(), 3))
    whole = pa.int64() if kind.bit_width == 64 else pa.int32()
    a_sample = {name: column for name, column in table.items() if name != "t_ms"}
    a_sample["time"] = pa.array(stamps * IMPACTS, whole).cast(kind)
    an_impact = of_impacts(np.ndarray.tolist)
    an_impact["time"] = pa.array([stamps] * IMPACTS, pa.list_(whole)).cast(pa.list_(kind))
    for columns in (a_sample, an_impact):
        found = read(parquet(pa.table(columns)))
        assert len(found) == IMPACTS
        for record in found:
            assert isinstance(record, ImpactRecord), record.as_dict()
            for _, signal in record.recording.signals():
                assert signal.sample_rate_hz == 500.0


@pytest.mark.parametrize("name", ["context", "meta", "Metadata", "info"])
def test_facts_in_a_struct_are_called_by_their_own_names(name: str):
    facts = [
        {"session_id": f"s-{n}", "athlete": f"p-{n}", "sample_rate_hz": 2000.0, "external_id": "x"} for n in range(3)
    ]
    found = read(parquet(pa.table(of_impacts(np.ndarray.tolist) | {name: facts})))
    for number, record in enumerate(found):
        assert isinstance(record, ImpactRecord)
        assert record.context == {"session_id": f"s-{number}"}
        assert (record.external_id, record.athlete_external_id) == (f"i{number}", f"p-{number}")
        assert [signal.sample_rate_hz for _, signal in record.recording.signals()] == [2000.0, 2000.0]


@pytest.mark.parametrize(
    "beside", [[[1.0, 0.0, 0.0, 0.0]] * 120, [["a", "b"]] * 120, [[]] * 120], ids=["quat", "tags", "none"]
)
def test_other_lists_leave_vectors_what_they_are(beside: list[Any]):
    table = of_samples(np.ndarray.tolist, pa.list_(pa.float64())) | {"beside": beside}
    assert all(isinstance(record, ImpactRecord) for record in read(parquet(pa.table(table))))


@pytest.mark.parametrize("shape", ["a sample", "an impact"])
def test_clocks_go_on_behind_midnight(shape: str):
    stamps = [(86_400_000 - 20 + n) % 86_400_000 for n in range(SAMPLES)]
    if shape == "a sample":
        columns = of_samples(np.ndarray.tolist, pa.list_(pa.float64(), 3))
        del columns["t_ms"]
        columns["time"] = pa.array(stamps * IMPACTS, pa.int32()).cast(pa.time32("ms"))
    else:
        columns = of_impacts(np.ndarray.tolist)
        columns["time"] = pa.array([stamps] * IMPACTS, pa.list_(pa.int32())).cast(pa.list_(pa.time32("ms")))
    for record in read(parquet(pa.table(columns))):
        assert isinstance(record, ImpactRecord), record.as_dict()
        assert {signal.sample_rate_hz for _, signal in record.recording.signals()} == {1000.0}
