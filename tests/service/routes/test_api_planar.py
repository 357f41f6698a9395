"""Records whose motion is held to a plane of the head, and the components that they may leave out."""

from __future__ import annotations

import json
from typing import Any

import pytest
from sending import Api, half_sine, impact_body, kinematics

IDENTITY = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
TURNED = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
"""The head's x is the sensor's y, the head's y its -x."""
TILTED = [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]
"""About the head's y: the sagittal plane stays what it is."""
FULL = {"linear_acceleration": "xyz", "angular_velocity": "xyz"}
OF_HEAD = {"linear_acceleration": "xz", "angular_velocity": "y"}
OF_TURNED = {"linear_acceleration": "yz", "angular_velocity": "x"}


def planar(sent: dict[str, str], rotation: Any = None, gyroscope: Any = None, **fields: Any) -> dict[str, Any]:
    """Kinematics of the sagittal plane with some components of each signal."""
    waves = {"linear_acceleration": ("g", (60, 40, -25)), "angular_velocity": ("rad/s", (9, 24, 5))}
    signals = {
        name: {"unit": unit, "sample_rate_hz": 1000}
        | {axis: half_sine(peak) for axis, peak in zip("xyz", peaks, strict=True) if axis in sent[name]}
        for name, (unit, peaks) in waves.items()
    }
    if rotation is not None:
        mounting = {"accelerometer": {"rotation": rotation, "offset_mm": [0.0, 0.0, 0.0]}}
        mounting |= {} if gyroscope is None else {"gyroscope": {"rotation": gyroscope}}
        signals |= {"location": "sensor", "mounting": mounting}
    return kinematics(constrained_plane="sagittal", **signals | fields)


def criteria(api: Api, sent: dict[str, Any]) -> Any:
    answer = api.post("/v1/score", json={"kinematics": sent})
    assert answer.status_code == 200, answer.text
    return answer.json()["criteria"]


def missing(api: Api, sent: dict[str, Any], **fields: Any) -> list[str]:
    answer = api.post("/v1/score", json={"kinematics": sent} | fields)
    assert (answer.status_code, answer.json()["type"]) == (422, "/problems/invalid-trace")
    assert {error["code"] for error in answer.json()["errors"]} == {"missing"}
    return [error["pointer"].removeprefix("/kinematics/") for error in answer.json()["errors"]]


def test_what_the_plane_of_the_head_holds_still_may_be_left_out(api: Api) -> None:
    found = criteria(api, planar(OF_HEAD))
    assert found["bam"]["value"]["y"] > 0
    assert found["bam"]["value"]["x"] == found["bam"]["value"]["z"] == 0
    assert found == criteria(api, planar(FULL))


@pytest.mark.parametrize("axes", ["anatomical", "sae_j211"])
def test_a_mounting_that_keeps_the_plane_lets_the_same_be_left_out(api: Api, axes: str) -> None:
    for rotation in (IDENTITY, TILTED):
        assert criteria(api, planar(OF_HEAD, rotation, axes=axes)) == criteria(api, planar(FULL, rotation, axes=axes))


@pytest.mark.parametrize("axes", ["anatomical", "sae_j211"])
def test_a_sensor_that_is_turned_needs_what_becomes_the_motion_inside_the_plane(api: Api, axes: str) -> None:
    refused = missing(api, planar(OF_HEAD, TURNED, axes=axes))
    assert refused == ["linear_acceleration/y", "angular_velocity/x"]
    assert criteria(api, planar(OF_TURNED, TURNED, axes=axes)) == criteria(api, planar(FULL, TURNED, axes=axes))


def test_each_signal_goes_by_the_rotation_of_its_own_sensor(api: Api) -> None:
    assert missing(api, planar(OF_HEAD, TURNED, IDENTITY)) == ["linear_acceleration/y"]
    assert missing(api, planar(OF_HEAD, IDENTITY, TURNED)) == ["angular_velocity/x"]


def test_the_refusal_names_the_signal_the_axis_and_the_reason(api: Api) -> None:
    answer = api.post("/v1/score", json={"kinematics": planar(OF_HEAD, TURNED)})
    detail = "The linear acceleration's y may not be left out: it is a part of the head's x, inside the sagittal plane."
    assert answer.json()["errors"][0]["detail"] == answer.json()["detail"] == detail


def test_a_signal_of_a_sensor_without_any_component_is_refused(api: Api) -> None:
    sent = planar({"linear_acceleration": "xz", "angular_velocity": ""}, TURNED)
    errors = api.post("/v1/score", json={"kinematics": sent}).json()["errors"]
    assert [error["pointer"] for error in errors] == [f"/kinematics/angular_velocity/{axis}" for axis in "xyz"]


def test_a_mounting_of_the_device_s_page_is_asked_too(api: Api) -> None:
    device = {"device": {"serial": "mg-1"}}
    page = {"mounting": {"accelerometer": {"rotation": TURNED, "offset_mm": [0.0, 0.0, 0.0]}}}
    assert api.put("/v1/devices/mg-1", json=page).status_code == 201
    sent = planar(OF_HEAD, location="sensor")
    assert missing(api, sent, **device) == ["linear_acceleration/y", "angular_velocity/x"]
    body = impact_body(kinematics=planar(OF_TURNED, location="sensor"), **device)
    assert api.post("/v1/impacts", json=body).json()["score"]["criteria"] == criteria(api, planar(FULL, TURNED))


@pytest.mark.parametrize("mounted_by", ["mapping", "device", "row"])
def test_a_table_goes_by_the_same_rule(api: Api, mounted_by: str) -> None:
    mounting = {"accelerometer": {"rotation": TURNED, "offset_mm": [0.0, 0.0, 0.0]}}
    assert api.put("/v1/devices/mg-1", json={"mounting": mounting}).status_code == 201
    waves = {"ay": half_sine(40), "az": half_sine(-25), "wx": half_sine(9), "wy": half_sine(24)}
    cell = json.dumps(json.dumps(mounting)).replace('\\"', '""')
    lines = [",".join([*waves, "mounting"])]
    lines += [",".join([*map(str, row), cell]) for row in zip(*waves.values(), strict=True)]
    mapping: dict[str, Any] = {
        "linear_acceleration": {"unit": "g", "y": "ay", "z": "az"},
        "angular_velocity": {"unit": "rad/s", "x": "wx"},
        "sample_rate_hz": 1000,
        "constrained_plane": "sagittal",
        "pre_trigger_ms": 10,
        "group_by": [],
    }
    mapping |= {
        "mapping": {"location": "sensor", "mounting": mounting},
        "device": {"location": "sensor"},
        "row": {"reading": {"mounting": "mounting"}},
    }[mounted_by]

    def imported(mapping: dict[str, Any]) -> Any:
        fields = {"mapping": json.dumps(mapping), "athlete": "p-17", "device": "mg-1"}
        answer = api.post("/v1/imports", data=fields, files={"file": ("planar.csv", "\n".join(lines).encode())})
        assert answer.status_code == 207, answer.text
        return answer.json()["data"][0]

    stored = imported(mapping)
    assert api.get(f"/v1/impacts/{stored['id']}").json()["score"]["criteria"] == criteria(api, planar(FULL, TURNED))
    wrong = mapping | {"angular_velocity": {"unit": "rad/s", "y": "wy"}}
    failed = imported(wrong)["problem"]["errors"]
    assert [error["pointer"] for error in failed] == ["/kinematics/angular_velocity/x"]
