"""MATLAB files of version 5: the laboratory's arrays and structs by preset, any other array by a mapping."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from binary_files import mat, noise, structs
from ingest_files import codes, read, refused

from headimpact_service.errors import Problem
from headimpact_service.ingest.mapping import Mapping
from headimpact_service.ingest.record import ImpactRecord

PRESET = "stanford_mat"
TIMES_S = np.arange(-10, 90) / 1000.0


def records(data: bytes, **options: Any) -> list[ImpactRecord]:
    found = read(data, **options)
    assert all(isinstance(item, ImpactRecord) for item in found), found[0]
    return [item for item in found if isinstance(item, ImpactRecord)]


def samples_of(record: ImpactRecord) -> np.ndarray:
    return np.concatenate([signal.values for _, signal in record.recording.signals()], axis=1)


def impacts(values: np.ndarray, times: np.ndarray = TIMES_S, *, lying: bool = False) -> np.ndarray:
    """The laboratory's struct array."""
    turned = (lambda part: part.T) if lying else (lambda part: part)
    return structs(
        *(
            {
                "t": times if lying else times[:, None],
                "lin_acc_CG": turned(sent[:, :3]),
                "ang_vel": turned(sent[:, 3:]),
                "ang_acc": turned(sent[:, 3:] * 100.0),
                "name": f"hit {number}",
            }
            for number, sent in enumerate(values)
        )
    )


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("name", ["impacts", "x", "array"])
def test_an_array_of_impacts_is_read_by_the_preset(compressed: bool, name: str):
    values = noise(5, 100)
    found = records(mat({name: values, "label": "from the field"}, do_compression=compressed), preset=PRESET)
    np.testing.assert_array_equal(np.stack([samples_of(record) for record in found]), values)
    signals = found[0].recording.signals()
    assert [(which, signal.unit, signal.sample_rate_hz) for which, signal in signals] == [
        ("linear_acceleration", "g", 1000.0),
        ("angular_velocity", "rad/s", 1000.0),
    ]
    assert found[0].recording.pre_trigger_ms == 10.0
    assert found[0].metadata == {"format": "mat", "preset": PRESET}


def test_an_array_of_one_impact_may_have_lost_its_first_dimension():
    values = noise(1, 100)
    [record] = records(mat({"hit": values[0], "facts": np.zeros((100, 2))}), preset=PRESET)
    np.testing.assert_array_equal(samples_of(record), values[0])


@pytest.mark.parametrize("lying", [False, True])
@pytest.mark.parametrize("factor", [1.0, 1000.0])
def test_a_struct_array_has_times_of_its_own_in_seconds_or_milliseconds(factor: float, lying: bool):
    values = noise(3, 100)
    found = records(mat({"impact": impacts(values, TIMES_S * factor, lying=lying)}), preset=PRESET)
    for record, sent in zip(found, values, strict=True):
        expected = np.concatenate((sent, sent[:, 3:] * 100.0), axis=1)
        np.testing.assert_array_equal(samples_of(record), expected)
        assert [which for which, _ in record.recording.signals()][2] == "angular_acceleration"
        assert {signal.sample_rate_hz for _, signal in record.recording.signals()} == {1000.0}
        assert record.recording.pre_trigger_ms == 10.0


def test_a_struct_of_another_rate_is_not_taken_for_one_of_1_khz():
    data = mat({"impact": impacts(noise(2, 100), TIMES_S * 0.37)})
    assert codes(refused(data, preset=PRESET)) == [("sample_rate_hz", "rate-missing")]
    mapping = Mapping.model_validate({"time": {"column": "t", "unit": "s"}})
    found = records(data, preset=PRESET, mapping=mapping)
    assert found[0].recording.signals()[0][1].sample_rate_hz == pytest.approx(1000.0 / 0.37)
    assert found[0].recording.pre_trigger_ms == pytest.approx(3.7)


def test_elements_of_a_struct_may_differ_in_length():
    both = np.concatenate((impacts(noise(1, 100)), impacts(noise(1, 60), TIMES_S[:60])), axis=1)
    found = records(mat({"impact": both}), preset=PRESET)
    assert [record.recording.signals()[0][1].values.shape[0] for record in found] == [100, 60]


def test_the_impacts_may_stand_within_a_struct_of_their_session():
    values = noise(3, 100)
    session = structs({"day": "2026-11-20", "impact": impacts(values), "rate": np.array([[1000.0]])})
    for held in (session, structs({"session": session, "other": np.zeros((2, 2))})):
        found = records(mat({"data": held}), preset=PRESET)
        np.testing.assert_array_equal(np.stack([samples_of(record)[:, :6] for record in found]), values)


def test_an_impacts_samples_may_stand_in_structs_within_it():
    values = noise(2, 100)
    nested = structs(
        *(
            {
                "label": f"hit {number}",
                "signals": structs({"acc": structs({"raw": sent[:, :3]}), "gyro": sent[:, 3:]}),
            }
            for number, sent in enumerate(values)
        )
    )
    mapping = {
        "linear_acceleration": {"unit": "g"} | {axis: f"signals_acc_raw_{axis}" for axis in "xyz"},
        "angular_velocity": {"unit": "rad/s"} | {axis: f"signals_gyro_{axis}" for axis in "xyz"},
        "external_id": "label",
        "sample_rate_hz": 1000,
    }
    found = records(mat({"impact": nested}), mapping=Mapping.model_validate(mapping))
    np.testing.assert_array_equal(np.stack([samples_of(record) for record in found]), values)
    assert [record.external_id for record in found] == ["hit 0", "hit 1"]


def test_structs_within_structs_without_end_are_read_no_further():
    deep = structs({"acc": np.zeros((5, 3))})
    for _ in range(30):
        deep = structs({"s": deep})
    assert refused(mat({"impact": deep}), preset=PRESET).slug == "unreadable-file"


def test_fields_of_one_element_may_differ_in_length():
    [[element]] = impacts(noise(1, 100))
    element["ang_acc"] = element["ang_acc"][:80]
    [record] = records(mat({"impact": np.array([[element]])}), preset=PRESET)
    assert [signal.values.shape[0] for _, signal in record.recording.signals()] == [100, 100, 80]


def test_names_and_other_arrays_are_reached_by_a_mapping():
    mapping = {
        "linear_acceleration": {"unit": "m/s^2"} | {axis: f"acc_{axis}" for axis in "xyz"},
        "external_id": "names",
        "device": "mouthguard",
        "sample_rate_hz": 3200,
    }
    names = np.array(["first", "second"], dtype=object)
    data = mat({"acc": noise(2)[..., :3], "names": names, "mouthguard": np.array([[41.0], [42.0]])})
    first, second = records(data, mapping=Mapping.model_validate(mapping))
    assert (first.external_id, second.external_id) == ("first", "second")
    assert (first.device_serial, second.device_serial) == ("41", "42")
    assert first.recording.signals()[0][1].unit == "m/s^2"
    named = Mapping.model_validate({"external_id": "name"})
    assert [
        record.external_id for record in records(mat({"impact": impacts(noise(2, 100))}), preset=PRESET, mapping=named)
    ] == [
        "hit 0",
        "hit 1",
    ]


def test_without_the_preset_no_unit_is_guessed():
    assert codes(refused(mat({"impact": impacts(noise(1, 100))}))) == [("/angular_velocity/unit", "unit-missing")]
    assert codes(refused(mat({"impacts": noise(1, 100)}))) == [("mapping", "layout-unknown")]


@pytest.mark.parametrize("preset", [PRESET, None])
def test_arrays_that_no_preset_reads_are_named_with_the_shape_that_is_wanted(preset: str | None):
    two = {"impacts": noise(2), "nonimpacts": noise(2)}
    for variables, columns in (
        (two, "impacts_1 to impacts_6, nonimpacts_1 to nonimpacts_6"),
        ({"impacts": noise(2).transpose(1, 2, 0)}, "impacts_1 to impacts_2"),
        ({"impacts": np.zeros((2, 40, 9))}, "impacts_1 to impacts_9"),
    ):
        problem = refused(mat(variables), preset=preset)
        assert codes(problem) == [("mapping", "layout-unknown")]
        assert f"The file has the columns {columns};" in problem.detail
        assert "an array impacts x samples x components has one for each component" in problem.detail
        assert ("name a preset" in problem.detail) == (preset is None)
    mapping = {"linear_acceleration": {"unit": "g"} | {a: f"impacts_{n}" for n, a in enumerate("xyz", 1)}}
    assert len(records(mat(two), mapping=Mapping.model_validate(mapping | {"sample_rate_hz": 1000}))) == 2


def test_many_impacts_come_block_by_block():
    values = noise(400, 100)
    found = records(mat({"a": values}), preset=PRESET)
    np.testing.assert_array_equal(np.stack([samples_of(record) for record in found]), values)
    found = records(mat({"impact": impacts(values)}), preset=PRESET)
    np.testing.assert_array_equal(np.stack([samples_of(record)[:, :6] for record in found]), values)


@pytest.mark.parametrize(
    ("variables", "said"),
    [
        ({}, "neither a struct array nor"),
        ({"a": np.zeros((3, 3))}, "neither a struct array nor"),
        ({"a": "text"}, "neither a struct array nor"),
        ({"a": np.zeros((2, 3, 65))}, "1 to 64 components"),
        ({"a": np.zeros((2, 3, 6)), "b": np.zeros((3, 3, 6))}, "number of impacts"),
        ({"impact": {f"f{i}": 1.0 for i in range(101)}}, "100 fields"),
        ({"impact": {"lin_acc_CG": np.zeros((9, 3)), "t": "word"}}, "no column of numbers"),
    ],
)
def test_a_file_that_holds_no_impacts_says_why(variables: dict[str, Any], said: str):
    mapping = Mapping.model_validate({"time": {"column": "t", "unit": "s"}}) if "impact" in variables else None
    problem = refused(mat(variables), preset=PRESET, mapping=mapping)
    assert problem.slug == "unreadable-file"
    assert said in problem.detail or codes(problem)[0][1] == "layout-unknown"


def test_a_file_that_is_cut_off_is_refused():
    for data in (mat({"a": noise(2)}), mat({"a": noise(2)}, do_compression=True)):
        for length in (30, 127, 130, 200, len(data) - 9):
            assert refused(data[:length], preset=PRESET).status == 422
    assert "header" in refused(mat({"a": noise(1)})[:126] + b"XX" + b"\0" * 20).detail


T_2KHZ = np.arange(100) / 2000.0
SIGNALS = {
    "linear_acceleration": {"unit": "g", "x": "ax", "y": "ay", "z": "az"},
    "angular_velocity": {"unit": "rad/s", "x": "wx", "y": "wy", "z": "wz"},
}


class TestRates:
    """What a file itself says of its rate goes before what its laboratory's files usually have."""

    @pytest.mark.parametrize("name", ["t_gyro", "t_ang", "time_ang_vel", "t_w", "tg"])
    def test_times_of_one_sensor_in_a_struct_are_not_passed_over(self, name: str):
        values = noise(1, 100)[0]
        fields = {"t": TIMES_S[:, None], "lin_acc_CG": values[:, :3], "ang_vel": values[:, 3:]}
        other = structs(fields | {name: TIMES_S[:, None] / 2.0})
        assert codes(refused(mat({"impact": other}), preset=PRESET)) == [("sample_rate_hz", "rate-differs")]
        alike = structs(fields | {name: TIMES_S[:, None] * 1000.0})
        (record,) = records(mat({"impact": alike}), preset=PRESET)
        assert record.recording.angular_velocity.sample_rate_hz == 1000.0

    @pytest.mark.parametrize("name", ["srate", "sr", "fsamp", "ODR", "sampling", "timestep", "tt", "timebase", "ms"])
    def test_a_rate_by_another_name_is_not_replaced_by_the_usual_one(self, name: str):
        problem = refused(mat({"impacts": noise(3, 100), name: 2000.0}), preset=PRESET)
        assert codes(problem) == [("sample_rate_hz", "rate-unclear")]

    @pytest.mark.parametrize(
        "beside",
        [
            {"t": T_2KHZ},
            {"t": T_2KHZ[:, None] * 1000.0},
            {"time": np.tile(T_2KHZ, (3, 1))},
            {"rate": 2000.0},
            {"frequency_hz": 2000.0},
            {"fs_khz": 2.0},
            {"tvec": T_2KHZ},
            {"sampling_interval_us": 500.0},
            {"dt": np.full((3, 1), 0.0005)},
            {"Ts": 0.0005},
        ],
    )
    def test_one_that_is_not_read_is_not_passed_over(self, beside: dict[str, Any]):
        problem = refused(mat({"impacts": noise(3, 100)} | beside), preset=PRESET)
        assert codes(problem) == [("sample_rate_hz", "rate-missing" if "t" in beside else "rate-unclear")]
        found = records(mat({"impacts": noise(3, 100)} | beside), preset=PRESET, sample_rate_hz=2000.0)
        assert {record.recording.linear_acceleration.sample_rate_hz for record in found} == {2000.0}

    def test_a_struct_beside_arrays_says_something_of_all_of_them(self):
        told = {"subject": "p-1", "fs": 2000.0, "rotation": np.eye(3)}
        found = records(mat({"impacts": noise(3, 100), "info": told}), preset=PRESET)
        assert {record.recording.linear_acceleration.sample_rate_hz for record in found} == {2000.0}
        assert [record.recording.linear_acceleration.values.shape for record in found] == [(100, 3)] * 3

    @pytest.mark.parametrize("struct", [False, True])
    def test_a_lone_number_is_no_column_of_times(self, struct: bool):
        values = noise(1, 100)[0]
        fields = {"acc": values[:, :3], "Ts": 0.0005}
        data = mat({"impact": structs(fields)} if struct else fields)
        unit = {"linear_acceleration": {"unit": "g"} | {axis: f"acc_{axis}" for axis in "xyz"}}
        mapping = Mapping.model_validate(unit)
        assert codes(refused(data, mapping=mapping)) == [("sample_rate_hz", "rate-missing")]
        (record,) = records(data, mapping=mapping, sample_rate_hz=2000.0)
        assert record.recording.linear_acceleration.sample_rate_hz == 2000.0

    @pytest.mark.parametrize(
        "beside",
        [
            {"time_ms": T_2KHZ * 1000.0},
            {"time_s": np.tile(T_2KHZ, (3, 1))},
            {"sample_rate_hz": 2000.0},
            {"sample_rate_hz": np.full((1, 3), 2000.0)},
            {"fs": 2000.0},
            {"Fs": np.full((3, 1), 2000.0)},
            {"sampling_rate": 2000.0},
        ],
    )
    def test_one_that_names_its_unit_is_read(self, beside: dict[str, Any]):
        found = records(mat({"impacts": noise(3, 100)} | beside), preset=PRESET)
        assert {record.recording.linear_acceleration.sample_rate_hz for record in found} == {2000.0}

    @pytest.mark.parametrize("times", [TIMES_S, TIMES_S * 1000.0, np.tile(TIMES_S, (3, 1))])
    def test_times_of_1_khz_are_seconds_or_milliseconds(self, times: np.ndarray):
        found = records(mat({"impacts": noise(3, 100), "t": times}), preset=PRESET)
        assert {record.recording.linear_acceleration.sample_rate_hz for record in found} == {1000.0}
        assert {record.recording.pre_trigger_ms for record in found} == {10.0}

    def test_a_rate_stands_in_a_struct_beside_it_or_in_the_one_around_it(self):
        values = noise(2, 100)
        both = [{"lin_acc_CG": sent[:, :3], "ang_vel": sent[:, 3:]} for sent in values]
        files = (
            {"impact": structs(*(one | {"fs": 2000.0} for one in both))},
            {"impact": structs(*both), "fs": 2000.0},
            {"session": {"impact": structs(*both), "fs": 2000.0, "player": "p-1"}},
        )
        for variables in files:
            found = records(mat(variables), preset=PRESET)
            assert {record.recording.linear_acceleration.sample_rate_hz for record in found} == {2000.0}

    def test_a_rate_that_the_times_or_the_sender_contradict_is_refused(self):
        for variables in ({"impact": impacts(noise(1, 100)), "fs": 2000.0}, {"hits": noise(1, 100), "fs": 1000.0}):
            [problem] = read(mat(variables), preset=PRESET, sample_rate_hz=None if "impact" in variables else 2000.0)
            assert codes(problem) == [("sample_rate_hz", "rate-differs")]


class TestOtherShapes:
    """What people save who have no struct array."""

    @pytest.mark.parametrize("kind", ["column", "row"])
    def test_a_row_a_channel_is_one_impact(self, kind: Any):
        [values] = noise(1, 100)
        channels = dict(zip(("ax", "ay", "az", "wx", "wy", "wz"), values.T, strict=True))
        mapping = Mapping.model_validate(SIGNALS | {"time": {"column": "t", "unit": "s"}})
        [record] = records(mat({"t": TIMES_S} | channels, oned_as=kind), mapping=mapping)
        np.testing.assert_array_equal(samples_of(record), values)
        assert record.recording.pre_trigger_ms == 10.0

    def test_arrays_of_one_impact_share_their_times(self):
        [values] = noise(1, 100)
        named = {
            signal: columns | {axis: f"{name}_{axis}" for axis in "xyz"}
            for (signal, columns), name in zip(SIGNALS.items(), ("acc", "gyr"), strict=True)
        }
        mapping = Mapping.model_validate(named | {"time": {"column": "t", "unit": "s"}})
        [record] = records(mat({"acc": values[:, :3], "gyr": values[:, 3:], "t": TIMES_S}), mapping=mapping)
        np.testing.assert_array_equal(samples_of(record), values)

    def test_a_cell_holds_an_impact(self):
        values = noise(3, 100)
        cells = np.empty((1, 3), dtype=object)
        for number, sent in enumerate(values):
            cells[0, number] = sent[: 100 - number]
        found = records(mat({"hits": cells}), preset=PRESET)
        assert [samples_of(record).shape for record in found] == [(100, 6), (99, 6), (98, 6)]
        np.testing.assert_array_equal(samples_of(found[1]), values[1, :99])

    def test_a_cell_may_hold_a_struct(self):
        values = noise(2, 100)
        cells = np.empty((2, 1), dtype=object)
        for number, sent in enumerate(values):
            cells[number, 0] = {"t": TIMES_S[:, None], "lin_acc_CG": sent[:, :3], "ang_vel": sent[:, 3:]}
        found = records(mat({"hits": cells}), preset=PRESET)
        np.testing.assert_array_equal(np.stack([samples_of(record) for record in found]), values)

    def test_a_session_may_hold_one_impact(self):
        [values] = noise(1, 100)
        impact = structs({"t": TIMES_S[:, None], "lin_acc_CG": values[:, :3], "ang_vel": values[:, 3:]})
        [record] = records(mat({"session": {"player": "p-1", "impact": impact}}), preset=PRESET)
        np.testing.assert_array_equal(samples_of(record), values)

    def test_a_struct_may_hold_the_arrays_of_all_impacts(self):
        values = noise(3, 100)
        session = {"lin_acc_CG": values[:, :, :3], "ang_vel": values[:, :, 3:], "t": TIMES_S}
        found = records(mat({"session": session}), preset=PRESET)
        np.testing.assert_array_equal(np.stack([samples_of(record) for record in found]), values)

    @pytest.mark.parametrize("shape", [(100, 7), (100, 6, 8), (8, 6, 60), (100, 8, 6), (8, 100, 9)])
    def test_what_is_not_impacts_x_samples_x_six_is_not_the_laboratory_s(self, shape: tuple[int, ...]):
        data = mat({"data": np.random.default_rng(3).normal(size=shape)})
        found = read_or_refused(data, preset=PRESET)
        assert all(isinstance(item, Problem) for item in found)

    def test_what_stands_beside_cells_and_arrays_counts_for_all_impacts(self):
        values = noise(2, 100)
        cells = np.empty((1, 2), dtype=object)
        for number, sent in enumerate(values):
            cells[0, number] = sent
        arrays = {"lin_acc_CG": values[:, :, :3], "ang_vel": values[:, :, 3:]}
        both = structs(*({"lin_acc_CG": sent[:, :3], "ang_vel": sent[:, 3:]} for sent in values))
        for variables in ({"hits": cells}, {"session": arrays}, {"impact": both}):
            for beside in ({"fs": 2000.0}, {"time_ms": T_2KHZ * 1000.0}):
                found = records(mat(variables | beside), preset=PRESET)
                assert {record.recording.linear_acceleration.sample_rate_hz for record in found} == {2000.0}


def read_or_refused(data: bytes, **options: Any) -> list[ImpactRecord | Problem]:
    try:
        return read(data, **options)
    except Problem as problem:
        return [problem]


@pytest.mark.parametrize(
    "said",
    [
        {"lin_acc_CG_unit": "m/s^2", "ang_vel_unit": "rad/s"},
        {"lin_acc_CG_units": "m/s^2"},
        {"unit_lin_acc_CG": "m/s^2"},
        {"units": "m/s^2"},
    ],
)
def test_units_that_a_struct_states_are_held_against_the_preset(said: dict[str, str]):
    values = noise(1, 100)[0]
    fields = {"t": TIMES_S[:, None], "lin_acc_CG": values[:, :3], "ang_vel": values[:, 3:]}
    data = mat({"impact": structs(fields | said)})
    assert codes(refused(data, preset=PRESET)) == [("/linear_acceleration/unit", "units-differ")]
    right = {name: text.replace("m/s^2", "g") for name, text in said.items()}
    assert len(records(mat({"impact": structs(fields | right)}), preset=PRESET)) == 1


def test_units_that_arrays_state_are_held_against_the_preset():
    values = noise(2, 100)
    arrays = {"kin": values, "kin_unit": "g; deg/s"}
    assert codes(refused(mat(arrays), preset=PRESET)) == [("/angular_velocity/unit", "units-differ")]
    assert len(records(mat(arrays | {"kin_unit": "g; rad/s"}), preset=PRESET)) == 2
    mapping = {
        "linear_acceleration": {"x": "kin_1", "y": "kin_2", "z": "kin_3"},
        "angular_velocity": {"x": "kin_4", "y": "kin_5", "z": "kin_6"},
        "sample_rate_hz": 1000,
    }
    [first, _] = records(mat(arrays), mapping=Mapping.model_validate(mapping))
    assert [signal.unit for _, signal in first.recording.signals()] == ["g", "deg/s"]


@pytest.mark.parametrize("name", ["units", "unit"])
def test_units_may_stand_in_a_struct_by_the_names_of_their_arrays(name: str):
    values = noise(1, 100)[0]
    columns = {
        signal: {axis: f"{array}_{axis}" for axis in "xyz"}
        for signal, array in (("linear_acceleration", "acc"), ("angular_velocity", "gyro"))
    }
    mapping = Mapping.model_validate(columns | {"sample_rate_hz": 1000})
    arrays = {"acc": values[:, :3], "gyro": values[:, 3:], name: {"acc": "m/s^2", "gyro": "deg/s"}}
    [one] = records(mat(arrays), mapping=mapping)
    assert [signal.unit for _, signal in one.recording.signals()] == ["m/s^2", "deg/s"]
    [one] = records(mat({"impact": structs(arrays)}), mapping=mapping)
    assert [signal.unit for _, signal in one.recording.signals()] == ["m/s^2", "deg/s"]


@pytest.mark.parametrize("behind", [b"\0" * 100, b"x" * 100, bytes(range(1, 101))])
def test_what_stands_behind_the_variables_is_named(behind: bytes):
    problem = refused(mat({"hit": noise(1, 100)[0]}) + behind, preset=PRESET)
    assert problem.detail == "Behind a variable of the MATLAB file stands what is none: the file is broken."
