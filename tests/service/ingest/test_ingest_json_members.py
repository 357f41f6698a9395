"""A JSON text that names a member of one object twice says two things: it is refused wherever it comes."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ingest_files import body, codes, csv_text, encoded, one, read, refused
from pydantic_core import from_json

from headimpact_service.errors import Problem
from headimpact_service.ingest.impact_reading import read_impact, read_score
from headimpact_service.ingest.json_members import repeated_members
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.record import ImpactRecord

IMPACT = encoded(body())
AXIS = b"[1.0, 2.0, 3.0]"
AGAIN = b'"linear_acceleration": {"unit": "m/s^2", "sample_rate_hz": 500, "x": %b, "y": %b, "z": %b}, ' % (
    AXIS,
    AXIS,
    AXIS,
)
TWICE = IMPACT.replace(b'"angular_velocity"', AGAIN + b'"angular_velocity"')
POINTER = "/kinematics/linear_acceleration"


def problem_of(read: Callable[[Any], Any], data: Any) -> Problem:
    with pytest.raises(Problem) as caught:
        read(data)
    return caught.value


@pytest.mark.parametrize(
    "data",
    [
        TWICE,
        TWICE.replace(b'"linear_acceleration": {"unit": "m', b'"linear_acceleration"\n : {"unit": "m'),
        TWICE.replace(b'"linear_acceleration": {"unit": "m', b'"linear\\u005facceleration": {"unit": "m'),
        TWICE.replace(b"mg-0042", b"mg\\u003a0042"),
        TWICE.replace(b"mg-0042/", b'mg\\"\\\\:\\u003A'),
    ],
    ids=["plain", "blanks before a colon", "an escaped name", "an escaped colon", "other escapes"],
)
def test_two_signals_of_one_name_are_refused(data: bytes):
    problem = problem_of(read_impact, data)
    assert (problem.slug, problem.status) == ("invalid-payload", 422)
    assert codes(problem) == [(POINTER, "member-twice")]


def test_every_member_that_stands_twice_is_named():
    point = b'{"criterion": "bam", "sensitivity": 0.5, "sensitivity": 0.75}'
    data = TWICE.replace(b'{"external_id"', b'{"operating_points": [%b, %b], "external_id"' % (point, point), 1)
    errors = codes(problem_of(read_impact, data))
    places = ["/operating_points/0/sensitivity", "/operating_points/1/sensitivity", POINTER]
    assert errors == [(place, "member-twice") for place in places]
    score = encoded({"kinematics": body()["kinematics"]}).replace(b'"axes"', b'"axes": "sae_j211", "axes"')
    assert codes(problem_of(read_score, score)) == [("/kinematics/axes", "member-twice")]


def test_a_text_that_says_all_once_is_taken_whatever_it_holds():
    told = {"external_id": 'a":b, {"x": [1]}', "context": {"session_id": "Zoë: \\", "event_definition": "::\u003a"}}
    for data in (encoded(body(**told)), json.dumps(body(**told), ensure_ascii=False, indent=2).encode()):
        assert read_impact(data).external_id == told["external_id"]


def test_files_of_json_are_refused_impact_by_impact():
    for data in (b"[%b, %b]" % (TWICE, IMPACT), b"%b\n%b" % (TWICE, IMPACT)):
        problem, record = read(data)
        assert codes(problem) == [(POINTER, "member-twice")]
        assert isinstance(record, ImpactRecord)


@pytest.mark.parametrize(
    ("fields", "pointer"),
    [
        ({"mapping": '{"angular_velocity": {"unit": "deg/s", "x": "a:b", "unit": "rad/s"}}'}, "/angular_velocity/unit"),
        ({"filter": '{"linear_acceleration": 300, "angular_velocity": null, "linear_acceleration": 30}'}, None),
    ],
)
def test_a_mapping_and_a_filter_beside_a_file_say_all_once(fields: dict[str, str], pointer: str | None):
    [name] = fields
    [error] = problem_of(ImportOptions.from_fields, fields).errors
    assert (error.parameter, error.code, error.pointer) == (name, "member-twice", pointer)


def test_an_object_in_a_cell_says_all_once():
    twice = '"{""linear_acceleration"": 300, ""angular_velocity"": 184, ""linear_acceleration"": 30}"'
    assert codes(refused(csv_text(before={"filter": twice})))[0][0] == "filter"
    assert one(csv_text(before={"filter": twice.replace(', ""linear_acceleration"": 30', "")}))


names = st.text(st.sampled_from('ab:"\\{}[, \u00e9'), max_size=4)
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | names,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(names, inner, max_size=4),
    max_leaves=20,
)


@given(values, st.booleans(), st.sampled_from([None, 1]), st.sampled_from([":", " : ", "\n:"]))
def test_no_text_that_says_all_once_is_refused(value: object, plain: bool, indent: int | None, colon: str):
    data = json.dumps(value, ensure_ascii=plain, indent=indent, separators=(",", colon)).encode()
    assert list(repeated_members(data, from_json(data))) == []


@given(st.dictionaries(names, values, min_size=1, max_size=4), values, st.booleans(), st.sampled_from([":", " :"]))
def test_a_member_that_is_added_again_is_found(value: dict[str, Any], other: object, plain: bool, colon: str):
    name = next(iter(value))
    text = json.dumps(value, ensure_ascii=plain)
    again = f"{json.dumps(name, ensure_ascii=not plain)}{colon}{json.dumps(other)}"
    data = f"[{text[:-1]},{again}}}]".encode()
    assert [0, name] in list(repeated_members(data, from_json(data)))
