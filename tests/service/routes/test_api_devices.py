"""/v1/devices."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from sending import Api, impact_body

MIRROR = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]
TURN = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
MOUNTING = {"accelerometer": {"rotation": TURN, "offset_mm": [70.0, 0.0, -60.0]}, "gyroscope": {"rotation": TURN}}


class TestPut:
    def test_a_device_is_made_then_replaced(self, api: Api) -> None:
        made = api.put("/v1/devices/mg-1", json={"maker": "Prevent Biometrics", "mounting": MOUNTING})
        assert (made.status_code, made.headers["location"]) == (201, "/v1/devices/mg-1")
        assert made.json()["mounting"] == MOUNTING
        replaced = api.put("/v1/devices/mg-1", json={"model": "MG-2"})
        assert (replaced.status_code, replaced.headers["etag"]) == (200, '"2"')
        assert (replaced.json()["maker"], replaced.json()["mounting"]) == (None, None)
        assert api.get("/v1/devices/mg-1").json() == replaced.json()

    def test_a_mirrored_axis_map_is_refused_with_the_reason(self, api: Api) -> None:
        answer = api.put(
            "/v1/devices/mg-1", json={"mounting": {"accelerometer": {"rotation": MIRROR, "offset_mm": [0, 0, 0]}}}
        )
        assert (answer.status_code, answer.json()["type"]) == (422, "/problems/improper-rotation")
        assert answer.json()["errors"][0]["pointer"] == "/mounting/accelerometer/rotation"
        assert api.get("/v1/devices/mg-1").status_code == 404

    @pytest.mark.parametrize("serial", ["mg/1", "mg 1", "MG-é", "a%b", "..."])
    def test_a_serial_is_whatever_the_maker_prints(self, api: Api, serial: str) -> None:
        from urllib.parse import quote

        address = f"/v1/devices/{quote(serial, safe='')}"
        made = api.put(address, json={})
        assert (made.status_code, made.json()["serial"]) == (201, serial)
        assert api.get(made.headers["location"]).json()["serial"] == serial

    def test_a_serial_that_no_impact_could_carry_is_422(self, api: Api) -> None:
        for serial in ("%00", "x" * 201):
            answer = api.put(f"/v1/devices/{serial}", json={})
            assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, "serial")

    def test_a_serial_with_a_line_feed_is_no_address(self, api: Api) -> None:
        assert api.put("/v1/devices/a%0Ab", json={}).status_code == 404

    def test_a_range_makes_a_flat_top_a_saturated_channel(self, api: Api) -> None:
        from sending import changed, half_sine, impact_body

        clipped = [min(value, 40.0) for value in half_sine(50)]
        body = changed(impact_body(device={"serial": "mg-1"}), "/kinematics/linear_acceleration/x", clipped)
        api.put("/v1/devices/mg-1", json={"linear_acceleration_range_g": 40})
        notes = api.post("/v1/impacts", json=body).json()["score"]["quality"]
        assert ("saturated", "x") in {(note["code"], note.get("channel")) for note in notes}

    def test_devices_of_another_organisation_are_not_seen(self, api: Api, make_key: Callable[..., str]) -> None:
        api.put("/v1/devices/mg-1", json={})
        other = make_key(organisation="other")
        assert api.get("/v1/devices/mg-1", key=other).status_code == 404
        assert api.get("/v1/devices", key=other).json()["data"] == []


def test_if_match_of_anything_names_nothing_that_is_not_there(api: Api) -> None:
    anything = {"If-Match": "*"}
    impact = f"/v1/impacts/{api.create('e-1')['id']}/label"
    label = {"outcome": "no_concussion", "basis": "other"}
    schedule = {"cron": "0 3 * * 1"}
    for address, body in (("/v1/devices/mg-1", {}), ("/v1/schedules/weekly", schedule), (impact, label)):
        assert api.put(address, json=body, headers=anything).status_code == 412, address
        assert api.put(address, json=body).status_code in {200, 201}, address
        assert api.put(address, json=body, headers=anything).status_code == 200, address
    api.delete(impact)
    assert api.put(impact, json=label, headers=anything).status_code == 412
    event = api.get("/v1/impacts").json()["data"][0]["id"]
    assert api.put(f"/v1/impacts/{event}", json=impact_body("e-1", 2.0), headers=anything).status_code == 200
    assert api.patch("/v1/settings", json={"incidence": 0.01}, headers=anything).status_code == 200
