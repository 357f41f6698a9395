"""NumPy archives: arrays of samples by name, units beside them, and never a pickle."""

from __future__ import annotations

import io
import zipfile
from typing import Any

import numpy as np
import pytest
from binary_files import noise, npz
from ingest_files import codes, one, read, refused, six_axis

from headimpact_service.errors import Problem
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

UNITS = {"linear_acceleration_unit": "g", "angular_velocity_unit": "rad/s"}


def arrays(values: np.ndarray, **others: Any) -> dict[str, Any]:
    """The convention: a signal an array, its unit beside it."""
    return {"linear_acceleration": values[..., :3], "angular_velocity": values[..., 3:], **UNITS, **others}


def records(data: bytes, **options: Any) -> list[ImpactRecord]:
    found = read(data, **options)
    assert all(isinstance(item, ImpactRecord) for item in found), found[0]
    return [item for item in found if isinstance(item, ImpactRecord)]


def samples_of(record: ImpactRecord) -> np.ndarray:
    return np.concatenate([signal.values for _, signal in record.recording.signals()], axis=1)


@pytest.mark.parametrize(
    "times",
    [
        {"time_ms": np.arange(40) / 3.2},
        {"time_s": np.tile(np.arange(40) / 3200.0, (5, 1))},
        {"sample_rate_hz": np.array(3200.0)},
        {"sample_rate_hz": np.full(5, 3200)},
    ],
)
def test_signals_units_and_times_are_read_by_their_names(times: dict[str, np.ndarray]):
    values = noise(5)
    found = records(npz(**arrays(values), **times, external_id=np.array(list("abcde"))))
    assert [record.external_id for record in found] == list("abcde")
    for record, sent in zip(found, values, strict=True):
        np.testing.assert_array_equal(samples_of(record), sent)
        assert [signal.unit for _, signal in record.recording.signals()] == ["g", "rad/s"]
        assert {signal.sample_rate_hz for _, signal in record.recording.signals()} == {3200.0}
    assert found[0].metadata == {"format": "npz", "preset": "generic_six_axis"}


@pytest.mark.parametrize("kind", [np.float32, np.float16, np.int16, ">f8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_any_type_and_order_of_numbers_is_read(kind: Any, order: Any):
    values = np.round(noise(3) * 8.0)
    stored = {
        name: np.array(part, dtype=kind, order=order) if part.ndim > 2 else part
        for name, part in ((n, np.asarray(p)) for n, p in arrays(values).items())
    }
    for record, sent in zip(records(npz(**stored, sample_rate_hz=1000.0)), values, strict=True):
        np.testing.assert_array_equal(samples_of(record), sent)


def test_arrays_of_two_dimensions_are_one_impact():
    [record] = records(npz(**arrays(six_axis()), time_ms=np.arange(40.0), external_id=np.array("a")))
    np.testing.assert_array_equal(samples_of(record), six_axis())
    assert record.external_id == "a"


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("length", [40, 100])
def test_components_may_be_arrays_of_impacts_by_samples(named: bool, length: int):
    values = noise(3, length)
    names = ("ax_g", "ay_g", "az_g", "wx_rad_s", "wy_rad_s", "wz_rad_s") if named else tuple("abcdef")
    stored = {name: values[..., place] for place, name in enumerate(names)}
    mapping = Mapping.model_validate(
        {
            "sample_rate_hz": 1000,
            "linear_acceleration": {"unit": "g", "x": "a", "y": "b", "z": "c"},
            "angular_velocity": {"unit": "rad/s", "x": "d", "y": "e", "z": "f"},
        }
    )
    found = records(npz(**stored), **({"sample_rate_hz": 1000.0} if named else {"mapping": mapping}))
    for record, sent in zip(found, values, strict=True):
        np.testing.assert_array_equal(samples_of(record), sent)


def test_signals_may_have_records_of_their_own_length():
    values = noise(3)
    data = npz(**arrays(values) | {"angular_velocity": values[:, :25, 3:]}, sample_rate_hz=1000.0)
    for record, sent in zip(records(data), values, strict=True):
        assert [signal.values.shape for _, signal in record.recording.signals()] == [(40, 3), (25, 3)]
        np.testing.assert_array_equal(record.recording.signals()[1][1].values, sent[:25, 3:])


def test_signals_may_have_times_of_their_own():
    values = noise(2)
    times = {"time_a": np.arange(40) / 1600.0, "time_w": np.arange(25) / 1000.0}
    stored = {"a": values[..., :3], "w": values[:, :25, 3:], **times}
    mapping = {
        signal: {"unit": unit, "time": {"column": f"time_{name}", "unit": "s"}}
        | {axis: f"{name}_{axis}" for axis in "xyz"}
        for signal, unit, name in (("linear_acceleration", "g", "a"), ("angular_velocity", "deg/s", "w"))
    }
    for record in records(npz(**stored), mapping=Mapping.model_validate(mapping)):
        a, w = (signal for _, signal in record.recording.signals())
        assert (a.sample_rate_hz, w.sample_rate_hz) == (1600.0, 1000.0)
        assert (a.values.shape, w.values.shape) == ((40, 3), (25, 3))


def test_a_helmet_set_with_its_y_axis_up_is_turned_by_a_mapping():
    values = noise(4, 81)
    mapping = {
        "linear_acceleration": {"unit": "g", "x": "acc_x", "y": "-acc_z", "z": "acc_y"},
        "angular_velocity": {"unit": "deg/s", "x": "gyro_x", "y": "-gyro_z", "z": "gyro_y"},
        "sample_rate_hz": 1024,
    }
    data = npz(acc=values[..., :3], gyro=values[..., 3:], labels=np.arange(4))
    for record, sent in zip(records(data, mapping=Mapping.model_validate(mapping)), values, strict=True):
        np.testing.assert_array_equal(samples_of(record), sent[:, [0, 2, 1, 3, 5, 4]] * [1, -1, 1, 1, -1, 1])
        assert {signal.sample_rate_hz for _, signal in record.recording.signals()} == {1024.0}


def test_six_components_are_numbered():
    mapping = {
        "linear_acceleration": {"unit": "g", "x": "hits_1", "y": "hits_2", "z": "hits_3"},
        "angular_velocity": {"unit": "rad/s", "x": "hits_4", "y": "hits_5", "z": "hits_6"},
    }
    found = records(npz(hits=noise(3)), mapping=Mapping.model_validate(mapping), sample_rate_hz=1000.0)
    np.testing.assert_array_equal(np.stack([samples_of(record) for record in found]), noise(3))


def test_facts_are_read_one_an_impact_or_one_for_all():
    when = np.array(["2026-11-20T19:04:05.123", "2026-11-21T00:00:00"], "datetime64[ms]")
    data = npz(**arrays(noise(2)), sample_rate_hz=1000.0, occurred_at=when, athlete_id=np.array(b"p-1"), device=[7, 8])
    first, second = records(data)
    assert str(first.occurred_at) == "2026-11-20 19:04:05.123000+00:00"
    assert (first.athlete_external_id, second.athlete_external_id) == ("p-1", "p-1")
    assert (first.device_serial, second.device_serial) == ("7", "8")


def test_many_impacts_come_block_by_block():
    values = noise(900)
    found = records(npz(**arrays(values), sample_rate_hz=1000.0))
    np.testing.assert_array_equal(np.stack([samples_of(record) for record in found]), values)


def test_a_unit_is_never_guessed():
    data = npz(linear_acceleration=noise(2)[..., :3], sample_rate_hz=1000.0)
    assert codes(refused(data)) == [("/linear_acceleration/unit", "unit-missing")]


class _Planted:
    """Unpickled, it would leave its mark."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (open, ("/tmp/headimpact-unpickled", "w"))


def raw(**members: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return buffer.getvalue()


def header(text: str, version: bytes = b"\x01\x00") -> bytes:
    return b"\x93NUMPY" + version + len(text).to_bytes(2, "little") + text.encode()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (npz(linear_acceleration=np.array([_Planted(), 1], dtype=object)), "pickles"),
        (npz(a=np.zeros((2, 3, 3)), b=np.array([{"x": 1}], dtype=object)), "pickles"),
        (npz(a=np.zeros(3, dtype=[("x", "f8")])), "hold numbers, text or times"),
        (npz(a=np.zeros((2, 3, 3), dtype=complex)), "hold numbers, text or times"),
        (npz(a=np.arange(3.0)), "columns of no signal"),
        (npz(a=np.zeros((2, 3, 3, 3))), "no array of samples"),
        (npz(a=np.zeros((2, 3, 3)), b=np.zeros((2, 3, 3, 3))), "three dimensions"),
        (npz(a=np.zeros((2, 3, 65))), "1 to 64 components"),
        (npz(a=np.zeros((2, 3, 0))), "1 to 64 components"),
        (npz(a=np.zeros((2, 3, 3)), b=np.zeros((3, 3, 3))), "number of impacts"),
        (npz(a=np.zeros((2, 3, 3)), b=np.zeros(7)), "for each impact or for each sample"),
        (npz(a=np.zeros((2, 3, 3)), b=np.array(["x" * 1001, "y"])), "1000 characters"),
        (npz(**{f"a{i}": np.zeros((1, 3, 3)) for i in range(342)}), "1024 columns"),
        (raw(a=b"not numpy at all"), "header of an array"),
        (raw(a=header("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3, 3), }\n")), "not the one its header"),
        (raw(a=header("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3, 99999999999), }\n")), "not the one"),
        (raw(a=header("{'descr': '<f8', 'fortran_order': False, 'shape': (-2, 3, 3), }\n") + b"\0" * 144), "header"),
        (raw(a=header("__import__('os').system('true')\n")), "header of an array"),
        (raw(a=header("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3, 3), }\n", b"\x09\x00")), "header"),
        (raw(a=header("(" * 3000 + "\n")), "header of an array"),
    ],
)
def test_what_is_no_plain_array_is_refused(data: bytes, said: str):
    problem = refused(data)
    assert problem.slug == "unreadable-file"
    assert said in problem.detail


def test_an_archive_holds_nothing_but_arrays():
    data = io.BytesIO(npz(**arrays(noise(2))))
    with zipfile.ZipFile(data, "a") as archive:
        archive.writestr("notes.txt", "hello")
    assert "nothing but arrays" in refused(data.getvalue()).detail


@pytest.mark.parametrize("name", ["../a.npy", "/etc/a.npy", "a/../../b.npy", "c:a.npy"])
def test_paths_that_lead_out_are_refused(name: str):
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr(name, b"x")
    assert "leads out" in refused(data.getvalue()).detail


def test_names_that_are_asked_for_as_samples_and_the_reverse_are_refused():
    mapping = {"linear_acceleration": {"unit": "g", "x": "a_x", "y": "a_y", "z": "b"}, "sample_rate_hz": 1000}
    stored = npz(a=np.zeros((2, 9, 3)), b=np.zeros(2))
    assert "no samples" in refused(stored, mapping=Mapping.model_validate(mapping)).detail
    named = {"linear_acceleration": {"unit": "g", "x": "a_x", "y": "a_y", "z": "a_z"}, "external_id": "a_x"}
    problem = refused(stored, mapping=Mapping.model_validate(named), sample_rate_hz=1000.0)
    assert isinstance(problem, Problem)
    assert "not one value an impact" in problem.detail or "one value an impact" in problem.detail


def test_an_array_for_each_channel_is_one_impact():
    values = noise(1)[0]
    names = [f"{symbol}{axis}" for symbol in "aw" for axis in "xyz"]
    mapping = {
        signal: {"unit": unit} | {axis: f"{symbol}{axis}" for axis in "xyz"}
        for signal, unit, symbol in (("linear_acceleration", "g", "a"), ("angular_velocity", "rad/s", "w"))
    } | {"time": {"column": "t", "unit": "ms"}}
    channels = {name: values[:, column] for column, name in enumerate(names)}
    (found,) = records(
        npz(**channels, t=np.arange(40) / 3.2, external_id=np.array("one")), mapping=Mapping.model_validate(mapping)
    )
    np.testing.assert_array_equal(samples_of(found), values)


@pytest.mark.parametrize(
    ("arrays_", "told"),
    [
        ({"ax": np.zeros(5), "ay": np.zeros(6)}, "differ in length"),
        ({"name": np.array("x")}, "no array of samples"),
    ],
)
def test_channels_that_do_not_fit_are_refused(arrays_: dict[str, Any], told: str):
    assert told in refused(npz(**arrays_)).detail


@pytest.mark.parametrize("name", ["unit", "units"])
@pytest.mark.parametrize("said", ["g", "SI", "ms"])
def test_a_unit_of_no_array_is_none_of_the_times_(name: str, said: str):
    values = noise(1)[0]
    arrays = {"linear_acceleration": values[:, :3], "angular_velocity": values[:, 3:], "time_ms": np.arange(40.0)}
    units = {"linear_acceleration_unit": "g", "angular_velocity_unit": "rad/s", name: said}
    assert one(npz(**arrays, **{key: np.array(text) for key, text in units.items()})).recording.linear_acceleration
