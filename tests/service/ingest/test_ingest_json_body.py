"""The JSON form of an impact: what it takes, and a clear answer for everything that it does not."""

from __future__ import annotations

import json
import tracemalloc
from datetime import UTC, datetime
from typing import Any, get_args

import numpy as np
import pytest
from ingest_files import body, codes, encoded, kinematics, signal, six_axis

from headimpact.criteria import CRITERION_KEYS
from headimpact.cut_offs import NO_FILTER, PAPER
from headimpact.published import QUALITY_LIMITS
from headimpact_service.errors import Problem
from headimpact_service.ingest import impact_json
from headimpact_service.ingest.impact_json import CriterionKey, ImpactBody, ScoreBody
from headimpact_service.ingest.impact_reading import read_impact, read_score


def problem_of(document: Any) -> Problem:
    data = document if isinstance(document, bytes) else encoded(document)
    with pytest.raises(Problem) as caught:
        read_impact(data)
    return caught.value


def faults_of(document: Any) -> list[tuple[str | None, str]]:
    problem = problem_of(document)
    assert problem.slug == "invalid-payload"
    assert problem.status == 422
    return codes(problem)


def with_kinematics(**changes: Any) -> dict[str, Any]:
    return body(kinematics=kinematics(six_axis(), **changes))


def with_acceleration(**changes: Any) -> dict[str, Any]:
    acceleration = signal("g", six_axis()[:, :3]) | changes
    return with_kinematics(
        linear_acceleration={name: value for name, value in acceleration.items() if value != "absent"}
    )


def test_an_impact_becomes_a_record_with_its_samples_units_and_rate():
    samples = six_axis()
    record = read_impact(encoded(body()))
    assert record.external_id == "mg-0042/1763665445123"
    assert (record.athlete_id, record.athlete_external_id) == (None, "p-17")
    assert record.occurred_at == datetime(2026, 11, 20, 19, 4, 5, 123000, tzinfo=UTC)
    assert record.device_serial == "mg-0042"
    assert record.context["position"] == "LB"
    recording = record.recording
    assert recording.linear_acceleration is not None
    assert recording.angular_velocity is not None
    assert recording.angular_acceleration is None
    np.testing.assert_array_equal(recording.linear_acceleration.values, samples[:, :3])
    np.testing.assert_array_equal(recording.angular_velocity.values, samples[:, 3:])
    assert recording.linear_acceleration.values.flags.c_contiguous
    assert (recording.linear_acceleration.unit, recording.linear_acceleration.sample_rate_hz) == ("g", 1000.0)
    assert recording.low_pass is PAPER
    assert recording.pre_trigger_ms == 10.0
    assert not record.needs_device_mounting


def test_only_kinematics_are_needed_to_score():
    record = read_score(encoded({"kinematics": {"linear_acceleration": signal("g", six_axis()[:, :3])}}))
    assert record.external_id is record.occurred_at is record.device_serial is None
    assert record.recording.axes == "anatomical"
    assert record.recording.low_pass is PAPER
    assert record.operating_points is None


def test_a_body_to_score_takes_no_athlete():
    with pytest.raises(Problem) as caught:
        read_score(encoded(body()))
    assert codes(caught.value) == [("/athlete", "unknown-field")]


def test_an_impact_needs_its_athlete_by_exactly_one_id():
    assert faults_of(body(athlete=None)) == [("/athlete", "missing")]
    assert faults_of(body(athlete={})) == [("/athlete", "one-of")]
    assert faults_of(body(athlete={"id": "ath_1", "external_id": "p"})) == [("/athlete", "one-of")]
    assert read_impact(encoded(body(athlete={"id": "ath_1"}))).athlete_id == "ath_1"


@pytest.mark.parametrize("blank", [" ", "   ", "\u00a0", "\u2003 "])
def test_a_name_of_blanks_alone_is_no_name(blank: str):
    for sent, place in (
        (body(external_id=blank), "/external_id"),
        (body(athlete={"external_id": blank}), "/athlete/external_id"),
        (body(device={"serial": blank}), "/device/serial"),
    ):
        assert faults_of(sent) == [(place, "control-character")]
    assert read_impact(encoded(body(external_id=f" a{blank}"))).external_id == f" a{blank}"


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "The body is empty"),
        (b"   ", "The body is empty"),
        (b"\xef\xbb\xbf{}", "byte order mark"),
        (b'{"kinematics": ', "ends before it is complete"),
        (b"{'a': 1}", "no text in double quotes"),
        (b"[" * 4000, "nested too deeply"),
        (b"[" * 100_000, "more than 5000 members"),
        (b'{"a":' * 4000, "nested too deeply"),
        (b'{"a":' * 100_000, "more than 5000 members"),
        (b'{"external_id": "\\ud800"}', "half a surrogate pair (line 1, column 24)"),
        (b'{"external_id": "\xed\xa0\x80"}', "not UTF-8"),
        (b'{"external_id": "\xff"}', "not UTF-8"),
        ('{"external_id": "a"}'.encode("utf-16"), "byte order mark"),
        (b'{"a": 1,', "it ends before it is complete (line 1, column 8)"),
        (b'{"a": 1,}', "a comma stands before a closing bracket"),
        (b'{"a" 1}', "a colon is missing"),
        (b'{"a": [1 2]}', "a comma or a closing bracket is missing"),
        (b"{a: 1}", "a member's name is no text in double quotes"),
        (b'{"a": 01}', "a number is not written as JSON has it"),
        (b'{"a": "\n"}', "a control character"),
        (b'{"a": 1} {"a": 2}', "stands behind its end"),
    ],
)
def test_a_body_that_is_not_json_is_400(data: bytes, said: str):
    problem = problem_of(data)
    assert problem.slug == "malformed-request"
    assert problem.status == 400
    assert said in problem.detail


@pytest.mark.parametrize("data", [b"[]", b"null", b"3", b'"text"', b"[{}]", b"true"])
def test_what_is_no_object_is_refused_at_the_root(data: bytes):
    assert faults_of(data) == [("", "wrong-type")]


@pytest.mark.parametrize("token", ["NaN", "Infinity", "-Infinity", "1e400", "-1e400"])
def test_a_number_that_is_not_finite_is_refused_where_it_stands(token: str):
    text = json.dumps(with_acceleration(y=[1.0, 77.125, 2.0] + [0.0] * 37)).replace("77.125", token)
    assert faults_of(text.encode()) == [("/kinematics/linear_acceleration/y/1", "not-finite")]


def test_a_whole_number_too_large_for_a_float_is_refused():
    text = json.dumps(with_acceleration(y=[1.0, 77.125, 2.0] + [0.0] * 37))
    for digits in (400, 4000):
        [(pointer, _)] = faults_of(text.replace("77.125", "1" + "0" * digits).encode())
        assert pointer == "/kinematics/linear_acceleration/y/1"
    assert problem_of(text.replace("77.125", "1" + "0" * 5000).encode()).status == 400


@pytest.mark.parametrize("value", ["1.5", True, False, None, [], {}])
def test_a_sample_that_is_no_number_is_refused_where_it_stands(value: Any):
    assert faults_of(with_acceleration(z=[0.0, 1.0, value, *[0.0] * 37])) == [
        ("/kinematics/linear_acceleration/z/2", "wrong-type")
    ]


@pytest.mark.parametrize("rate", ["1000", True, [1000], {}])
def test_a_rate_that_is_no_number_is_refused(rate: Any):
    assert faults_of(with_acceleration(sample_rate_hz=rate)) == [
        ("/kinematics/linear_acceleration/sample_rate_hz", "wrong-type")
    ]


@pytest.mark.parametrize("rate", [0, -1000, 100, 499.999, 5e-324, 1_000_001])
def test_a_rate_outside_the_bounds_is_refused_and_the_bound_is_named(rate: float):
    problem = problem_of(with_acceleration(sample_rate_hz=rate))
    assert codes(problem) == [("/kinematics/linear_acceleration/sample_rate_hz", "out-of-range")]
    assert "500" in problem.errors[0].detail or "1000000" in problem.errors[0].detail


def test_the_bounds_are_those_of_the_science():
    limits = QUALITY_LIMITS["record"]
    assert limits["minimum_samples"] == impact_json.MIN_SAMPLES
    assert limits["maximum_samples"] == impact_json.MAX_SAMPLES
    assert limits["minimum_rate_hz"] == impact_json.MIN_RATE_HZ
    assert limits["maximum_rate_hz"] == impact_json.MAX_RATE_HZ
    assert get_args(CriterionKey) == tuple(CRITERION_KEYS)


def test_two_samples_are_too_few_and_20001_too_many():
    few = problem_of(with_acceleration(x=[0.0, 1.0], y=[0.0, 1.0], z=[0.0, 1.0]))
    assert codes(few) == [(f"/kinematics/linear_acceleration/{axis}", "too-short") for axis in "xyz"]
    assert few.errors[0].detail == "At least 3 samples are needed."
    many = [0.0] * 20_001
    problem = problem_of(with_acceleration(x=many, y=many, z=many))
    assert codes(problem) == [(f"/kinematics/linear_acceleration/{axis}", "too-long") for axis in "xyz"]
    assert problem.errors[0].detail == "At most 20000 samples are taken."


def test_20000_samples_are_taken():
    samples = np.zeros((20_000, 6))
    samples[1] = 1.0
    record = read_impact(encoded(body(kinematics=kinematics(samples))))
    assert record.recording.linear_acceleration is not None
    assert record.recording.linear_acceleration.values.shape == (20_000, 3)


def test_components_of_different_lengths_are_refused():
    problem = problem_of(with_acceleration(y=[0.0] * 39, z=[0.0] * 41))
    assert codes(problem) == [
        ("/kinematics/linear_acceleration/y", "length-mismatch"),
        ("/kinematics/linear_acceleration/z", "length-mismatch"),
    ]
    assert problem.errors[0].detail == "As many entries as in x are needed: 40."


def test_stamps_of_another_length_are_refused():
    changed = with_acceleration(sample_rate_hz="absent", time_ms=[float(i) for i in range(39)])
    assert faults_of(changed) == [("/kinematics/linear_acceleration/time_ms", "length-mismatch")]


def test_a_signal_has_a_rate_or_stamps_and_not_both():
    neither = with_acceleration(sample_rate_hz="absent")
    assert faults_of(neither) == [("/kinematics/linear_acceleration", "rate-or-times")]
    both = with_acceleration(time_ms=[float(i) for i in range(40)])
    assert faults_of(both) == [("/kinematics/linear_acceleration", "rate-or-times")]


def test_units_are_required_and_of_their_signal():
    assert faults_of(with_acceleration(unit="absent")) == [("/kinematics/linear_acceleration/unit", "missing")]
    for unit in ("rad/s", "G", "m/s2", "", 1):
        problem = problem_of(with_acceleration(unit=unit))
        assert codes(problem) == [("/kinematics/linear_acceleration/unit", "not-allowed")]
        assert problem.errors[0].detail == "One of these is needed: 'g' or 'm/s^2'."


def test_unknown_fields_are_refused_at_every_level():
    document = body(colour="red", device={"serial": "a", "kind": "b"}, context={"weather": "rain"})
    document["kinematics"]["rate"] = 1000
    document["kinematics"]["linear_acceleration"]["resultant"] = []
    assert set(faults_of(document)) == {
        ("/colour", "unknown-field"),
        ("/device/kind", "unknown-field"),
        ("/context/weather", "unknown-field"),
        ("/kinematics/rate", "unknown-field"),
        ("/kinematics/linear_acceleration/resultant", "unknown-field"),
    }


def test_pointers_are_escaped_and_bounded():
    assert faults_of(body(**{"a/b~c": 1})) == [("/a~1b~0c", "unknown-field")]
    [(pointer, _)] = faults_of(body(**{"k" * 10_000: 1}))
    assert pointer is not None
    assert len(pointer) == 200


def test_at_most_twenty_errors_are_listed_and_none_holds_the_value():
    document = with_acceleration(x=["secret-value"] * 100)
    problem = problem_of(document)
    assert len(problem.errors) == 20
    assert "secret-value" not in json.dumps(problem.as_dict())


def test_every_bad_sample_of_a_list_is_named():
    samples: list[Any] = [0.0] * 40
    samples[3:8] = ["1", True, None, float("nan"), 10**400]
    wrong = ["wrong-type", "wrong-type", "wrong-type", "not-finite", "not-finite"]
    expected = [(f"/kinematics/linear_acceleration/y/{3 + i}", code) for i, code in enumerate(wrong)]
    assert faults_of(with_acceleration(y=samples)) == expected


def peak_of_refusing(document: bytes) -> int:
    tracemalloc.start()
    problem = problem_of(document)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert problem.status in {400, 422}
    return peak


def test_a_body_of_nothing_but_faults_costs_little():
    keys = ("{" + ",".join(f'"a{i}":1' for i in range(500_000)) + "}").encode()
    assert peak_of_refusing(keys) < 100_000
    wrong = ["1"] * 20_000
    assert peak_of_refusing(encoded(with_acceleration(x=wrong, y=wrong, z=wrong))) < 5_000_000


def test_at_least_one_signal_is_needed():
    document = with_kinematics(linear_acceleration=None, angular_velocity=None)
    assert faults_of(document) == [("/kinematics", "no-signal")]
    assert faults_of(body(kinematics={})) == [("/kinematics", "no-signal")]


@pytest.mark.parametrize(
    ("plane", "linear", "angular"), [("sagittal", "xz", "y"), ("coronal", "yz", "x"), ("axial", "xy", "z")]
)
def test_components_outside_a_constrained_plane_may_be_absent_and_become_zero(plane: str, linear: str, angular: str):
    samples = six_axis()
    acceleration = signal("g", samples[:, :3])
    velocity = signal("rad/s", samples[:, 3:])
    planar = {name: acceleration[name] for name in ("unit", "sample_rate_hz", *linear)}
    about = {name: velocity[name] for name in ("unit", "sample_rate_hz")} | {
        axis: velocity[axis] if axis in angular else None for axis in "xyz"
    }
    document = with_kinematics(constrained_plane=plane, linear_acceleration=planar, angular_velocity=about)
    recording = read_impact(encoded(document)).recording
    assert recording.constrained_plane == plane
    assert recording.linear_acceleration is not None
    assert recording.angular_velocity is not None
    for column, axis in enumerate("xyz"):
        kept = samples[:, column] if axis in linear else np.zeros(40)
        np.testing.assert_array_equal(recording.linear_acceleration.values[:, column], kept)
        kept = samples[:, 3 + column] if axis in angular else np.zeros(40)
        np.testing.assert_array_equal(recording.angular_velocity.values[:, column], kept)


def test_a_component_inside_the_plane_is_needed_and_every_one_without_a_plane():
    assert faults_of(with_acceleration(y="absent")) == [("/kinematics/linear_acceleration/y", "missing")]
    assert faults_of(with_acceleration(x=None, y=None, z=None)) == [
        (f"/kinematics/linear_acceleration/{axis}", "missing") for axis in "xyz"
    ]
    assert faults_of(with_acceleration(y=None)) == [("/kinematics/linear_acceleration/y", "missing")]
    document = with_acceleration(x=None)
    document["kinematics"]["constrained_plane"] = "sagittal"
    assert faults_of(document) == [("/kinematics/linear_acceleration/x", "missing")]


def test_filters_by_name_in_hertz_and_by_class():
    assert read_impact(encoded(with_kinematics(filter="none"))).recording.low_pass is NO_FILTER
    chosen = read_impact(
        encoded(with_kinematics(filter={"linear_acceleration": "CFC180", "angular_velocity": 184}))
    ).recording.low_pass
    assert (chosen.linear_acceleration, chosen.angular_velocity) == ("CFC180", 184.0)
    partly = read_impact(encoded(with_kinematics(filter={"linear_acceleration": 300}))).recording.low_pass
    assert (partly.linear_acceleration, partly.angular_velocity) == (300.0, None)


@pytest.mark.parametrize(
    ("choice", "fault"),
    [
        ("CFC180", ("/kinematics/filter", "not-allowed")),
        (300, ("/kinematics/filter", "wrong-type")),
        (True, ("/kinematics/filter", "wrong-type")),
        (None, ("/kinematics/filter", "wrong-type")),
        ({"linear_acceleration": "CFC18"}, ("/kinematics/filter/linear_acceleration", "not-allowed")),
        ({"linear_acceleration": 0}, ("/kinematics/filter/linear_acceleration", "out-of-range")),
        ({"linear_acceleration": 5e-324}, ("/kinematics/filter/linear_acceleration", "out-of-range")),
        ({"angular_velocity": 0.9}, ("/kinematics/filter/angular_velocity", "out-of-range")),
        ({"linear_acceleration": False}, ("/kinematics/filter/linear_acceleration", "wrong-type")),
        ({"angular_acceleration": 100}, ("/kinematics/filter/angular_acceleration", "unknown-field")),
    ],
)
def test_other_filters_are_refused_where_they_stand(choice: Any, fault: tuple[str, str]):
    assert faults_of(with_kinematics(filter=choice)) == [fault]


MOUNTING = {
    "accelerometer": {"rotation": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], "offset_mm": [70, 0, -60]},
    "gyroscope": {"rotation": [[1, 0, 0], [0, 0, 1], [0, -1, 0]]},
}


def test_a_sensor_brings_its_mounting_or_waits_for_the_device():
    record = read_impact(encoded(with_kinematics(location="sensor", mounting=MOUNTING)))
    mounting = record.recording.mounting
    assert mounting is not None
    assert not record.needs_device_mounting
    np.testing.assert_array_equal(mounting.offset_m, [0.07, 0.0, -0.06])
    np.testing.assert_array_equal(mounting.gyroscope_rotation[1], [0, 0, 1])
    waiting = read_impact(encoded(with_kinematics(location="sensor")))
    assert waiting.needs_device_mounting
    assert waiting.recording.mounting is None


def test_a_gyroscope_without_its_own_rotation_shares_the_accelerometers():
    document = with_kinematics(location="sensor", mounting={"accelerometer": MOUNTING["accelerometer"]})
    mounting = read_impact(encoded(document)).recording.mounting
    assert mounting is not None
    np.testing.assert_array_equal(mounting.gyroscope_rotation, mounting.accelerometer_rotation)


def test_a_mounting_without_a_sensor_is_a_contradiction():
    assert faults_of(with_kinematics(mounting=MOUNTING)) == [("/kinematics/mounting", "mounting-not-needed")]


@pytest.mark.parametrize("rotation", [[[1, 0, 0], [0, 1, 0], [0, 0, -1]], [[1, 0, 0], [0, 2, 0], [0, 0, 1]]])
@pytest.mark.parametrize("sensor", ["accelerometer", "gyroscope"])
def test_a_matrix_that_is_no_rotation_is_refused_by_name(rotation: list[list[int]], sensor: str):
    mounting: dict[str, Any] = {**MOUNTING, sensor: {**MOUNTING[sensor], "rotation": rotation}}
    problem = problem_of(with_kinematics(location="sensor", mounting=mounting))
    assert problem.slug == "improper-rotation"
    assert problem.status == 422
    assert codes(problem) == [(f"/kinematics/mounting/{sensor}/rotation", "improper-rotation")]


def test_a_rotation_is_three_rows_of_three():
    mounting: dict[str, Any] = {"accelerometer": {"rotation": [[1, 0], [0, 1]], "offset_mm": [0, 0]}}
    places = {pointer for pointer, _ in faults_of(with_kinematics(location="sensor", mounting=mounting))}
    assert "/kinematics/mounting/accelerometer/rotation/0" in places
    assert "/kinematics/mounting/accelerometer/offset_mm" in places


@pytest.mark.parametrize("value", [-1, 60_001, "10", True])
def test_a_pre_trigger_time_is_a_number_of_milliseconds(value: Any):
    [(pointer, _)] = faults_of(with_kinematics(pre_trigger_ms=value))
    assert pointer == "/kinematics/pre_trigger_ms"


def stamped(first: float, **changes: Any) -> dict[str, Any]:
    """Kinematics without a word on the trigger, with stamps of 1 ms from `first` on."""
    kinematics = body()["kinematics"] | changes
    for name in ("linear_acceleration", "angular_velocity"):
        del kinematics[name]["sample_rate_hz"]
        kinematics[name]["time_ms"] = [first + i for i in range(40)]
    return kinematics


def said_nothing(kinematics: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in kinematics.items() if name != "pre_trigger_ms"}


@pytest.mark.parametrize(("first", "before"), [(-10.0, 10.0), (-39.0, 39.0), (0.0, None), (-40.0, None), (5.0, None)])
def test_zero_is_the_trigger_where_stamps_span_it(first: float, before: float | None):
    record = read_score(encoded({"kinematics": said_nothing(stamped(first))}))
    assert record.recording.pre_trigger_ms == before


def test_the_trigger_is_where_the_sender_says_whatever_the_stamps():
    for said in (None, 0.0, 7.0):
        record = read_score(encoded({"kinematics": stamped(-10.0) | {"pre_trigger_ms": said}}))
        assert record.recording.pre_trigger_ms == said


@pytest.mark.parametrize("name", ["", "a\u0000b", "a\nb", "x" * 201])
def test_a_name_is_printable_and_bounded(name: str):
    [(pointer, _)] = faults_of(body(external_id=name))
    assert pointer == "/external_id"


def test_champ_metadata_are_known_fields():
    context = {"video_verified": True, "event_definition": "over 8 g", "worn": False, "trigger_threshold_g": 8}
    assert read_impact(encoded(body(context=context))).context == {**context, "trigger_threshold_g": 8.0}
    assert faults_of(body(context={"video_verified": "yes"})) == [("/context/video_verified", "wrong-type")]


def test_operating_points_keep_their_order_and_name_exactly_one_quantity():
    points = [{"criterion": "bam", "sensitivity": 0.9}, {"criterion": "hic15", "threshold": 0.2}]
    asked = read_impact(encoded(body(operating_points=points))).operating_points
    assert asked is not None
    assert [(p.criterion, p.requested) for p in asked] == [("bam", {"sensitivity": 0.9}), ("hic15", {"threshold": 0.2})]
    wrong = [{"criterion": "bam"}, {"criterion": "bam", "sensitivity": 0.9, "threshold": 0.1}]
    places = faults_of(body(operating_points=wrong))
    assert places == [("/operating_points/0", "one-of"), ("/operating_points/1", "one-of")]
    assert faults_of(body(operating_points=[{"criterion": "gsi", "threshold": 0.1}])) == [
        ("/operating_points/0/criterion", "not-allowed")
    ]
    assert faults_of(body(operating_points=[{"criterion": "bam", "sensitivity": 1.0}])) == [
        ("/operating_points/0/sensitivity", "out-of-range")
    ]


def test_traces_and_extra_criteria_are_asked_for_by_name():
    record = read_impact(encoded(body(include=["traces"], extra_criteria=["damage"])))
    assert record.include == ("traces",)
    assert record.extra_criteria == ("damage",)
    assert faults_of(body(include=["everything"])) == [("/include/0", "not-allowed")]
    assert faults_of(body(extra_criteria=["damage", "hic15"])) == [("/extra_criteria/1", "not-allowed")]


def test_uniform_stamps_say_the_rate_and_jittered_ones_stay():
    stamps = [i * 0.3125 for i in range(40)]
    samples = six_axis()
    uniform = read_impact(
        encoded(
            with_kinematics(
                linear_acceleration=signal("g", samples[:, :3], time_ms=stamps),
                angular_velocity=signal("rad/s", samples[:, 3:], time_ms=stamps),
            )
        )
    ).recording.linear_acceleration
    assert uniform is not None
    assert (uniform.sample_rate_hz, uniform.time_s) == (3200.0, None)
    stamps[7] += 0.01
    jittered = read_impact(
        encoded(with_acceleration(sample_rate_hz="absent", time_ms=stamps))
    ).recording.linear_acceleration
    assert jittered is not None
    assert jittered.sample_rate_hz is None
    np.testing.assert_array_equal(jittered.time_s, np.array(stamps) / 1000.0)


def test_signals_that_start_at_different_times_keep_their_stamps():
    samples = six_axis()
    recording = read_impact(
        encoded(
            with_kinematics(
                linear_acceleration=signal("g", samples[:, :3], time_ms=[float(i) for i in range(40)]),
                angular_velocity=signal("rad/s", samples[:, 3:], time_ms=[float(i + 2) for i in range(40)]),
            )
        )
    ).recording
    assert recording.angular_velocity is not None
    assert recording.angular_velocity.time_s is not None
    assert recording.angular_velocity.time_s[0] == 0.002


@pytest.mark.parametrize(("rate", "kept"), [(1000.5, True), (1000.0, False), (2000.0, False)])
def test_stamps_that_nearly_say_one_rate_are_kept(rate: float, kept: bool):
    samples = six_axis()
    recording = read_impact(
        encoded(
            with_kinematics(
                linear_acceleration=signal("g", samples[:, :3], time_ms=[float(i) for i in range(40)]),
                angular_velocity=signal("rad/s", samples[:, 3:], time_ms=[i * 1000.0 / rate for i in range(40)]),
            )
        )
    ).recording
    rates = [None if sent is None else sent.sample_rate_hz for _, sent in recording.signals()]
    assert rates == ([None, None] if kept else [1000.0, rate])


@pytest.mark.parametrize("model", [ImpactBody, ScoreBody])
def test_the_models_describe_themselves_for_openapi(model: type[ScoreBody]):
    schema = model.model_json_schema()
    signal_schema = schema["$defs"]["LinearAccelerationBody"]
    assert signal_schema["properties"]["unit"]["enum"] == ["g", "m/s^2"]
    assert signal_schema["additionalProperties"] is False
    assert "[Hz]" in signal_schema["properties"]["sample_rate_hz"]["description"]
    assert ("athlete" in schema.get("required", [])) == (model is ImpactBody)
