"""Bad input gets a clear answer, and nothing is stored."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
from sending import Api, changed, half_sine, impact_body, kinematics, signal, zipped

from headimpact_service.settings import Settings

LINEAR = "/kinematics/linear_acceleration"
STILL = [float(i) for i in range(50)] + [49.0] + [float(i) for i in range(51, 100)]
BACK = [float(i) for i in range(50)] + [48.0] + [float(i) for i in range(51, 100)]
ROTATION = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
MIRROR = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]
SECRET = "Zyxw-very-private"


def timed(stamps: list[float]) -> dict[str, Any]:
    sent = signal("g", (50, 10, 10))
    del sent["sample_rate_hz"]
    return {"linear_acceleration": sent | {"time_ms": stamps}}


def samples(count: int) -> dict[str, Any]:
    return {"linear_acceleration": signal("g", (50, 10, 10), rate=20_000, samples=count)}


def mounted(rotation: list[list[float]], offset_mm: float = 0.0, scale: float = 1.0) -> dict[str, Any]:
    mounting = {"accelerometer": {"rotation": rotation, "offset_mm": [offset_mm, 0.0, 0.0]}}
    return kinematics(scale, location="sensor", mounting=mounting)


# name -> (body, problem, pointer of the first error)
BODIES: dict[str, tuple[dict[str, Any], str, str]] = {
    "no units": (changed(impact_body(), f"{LINEAR}/unit", ...), "invalid-payload", f"{LINEAR}/unit"),
    "an unknown unit": (changed(impact_body(), f"{LINEAR}/unit", SECRET), "invalid-payload", f"{LINEAR}/unit"),
    "a string for a number": (changed(impact_body(), f"{LINEAR}/x/3", "1.0"), "invalid-payload", f"{LINEAR}/x/3"),
    "a boolean for a number": (changed(impact_body(), f"{LINEAR}/x/3", False), "invalid-payload", f"{LINEAR}/x/3"),
    "a null among samples": (changed(impact_body(), f"{LINEAR}/x/3", None), "invalid-payload", f"{LINEAR}/x/3"),
    "a boolean for a rate": (
        changed(impact_body(), f"{LINEAR}/sample_rate_hz", True),
        "invalid-payload",
        f"{LINEAR}/sample_rate_hz",
    ),
    "lengths that differ": (changed(impact_body(), f"{LINEAR}/y", half_sine(1)[:-1]), "invalid-payload", f"{LINEAR}/y"),
    "two samples": (impact_body(kinematics=samples(2)), "invalid-payload", f"{LINEAR}/x"),
    "20 001 samples": (impact_body(kinematics=samples(20_001)), "invalid-payload", f"{LINEAR}/x"),
    "time that stands still": (impact_body(kinematics=timed(STILL)), "invalid-trace", f"{LINEAR}/time_ms/50"),
    "time that runs backwards": (impact_body(kinematics=timed(BACK)), "invalid-trace", f"{LINEAR}/time_ms/50"),
    "a rate of 100 Hz": (
        changed(impact_body(), f"{LINEAR}/sample_rate_hz", 100),
        "invalid-payload",
        f"{LINEAR}/sample_rate_hz",
    ),
    "stamps at 100 Hz": (impact_body(kinematics=timed([10.0 * i for i in range(100)])), "invalid-trace", LINEAR),
    "rate and stamps together": (
        changed(impact_body(), f"{LINEAR}/time_ms", [float(i) for i in range(100)]),
        "invalid-payload",
        LINEAR,
    ),
    "an improper rotation": (
        impact_body(kinematics=mounted(MIRROR)),
        "improper-rotation",
        "/kinematics/mounting/accelerometer/rotation",
    ),
    "an offset of a kilometre": (
        impact_body(kinematics=mounted(ROTATION, 1e6)),
        "invalid-payload",
        "/kinematics/mounting/accelerometer/offset_mm/0",
    ),
    "an offset beyond every number": (
        impact_body(kinematics=mounted(ROTATION, -1e308)),
        "invalid-payload",
        "/kinematics/mounting/accelerometer/offset_mm/0",
    ),
    "an offset that makes more than 1000 g": (
        impact_body(kinematics=mounted(ROTATION, 1000.0, 3.0)),
        "invalid-trace",
        LINEAR,
    ),
    "a sensor without a mounting": (
        impact_body(kinematics=kinematics(location="sensor")),
        "mounting-missing",
        "/kinematics/mounting",
    ),
    "an unknown field": (changed(impact_body(), "/colour", SECRET), "invalid-payload", "/colour"),
    "an unknown field within": (changed(impact_body(), f"{LINEAR}/w", [1.0]), "invalid-payload", f"{LINEAR}/w"),
    "no kinematics": (changed(impact_body(), "/kinematics", ...), "invalid-payload", "/kinematics"),
    "no signal": (impact_body(kinematics={}), "invalid-payload", "/kinematics"),
    "no athlete": (changed(impact_body(), "/athlete", ...), "invalid-payload", "/athlete"),
    "a time without an offset": (
        changed(impact_body(), "/occurred_at", "2026-11-20T19:04:05"),
        "invalid-payload",
        "/occurred_at",
    ),
    "beyond 1000 g": (impact_body(scale=30.0), "invalid-trace", LINEAR),
    "nothing moves": (impact_body(scale=0.0), "invalid-trace", "/kinematics"),
    "an operating point that no model has": (
        impact_body(operating_points=[{"criterion": "bam", "sensitivity": 0.99}]),
        "operating-point-unreachable",
        "/operating_points/0",
    ),
    "an unknown criterion": (impact_body(extra_criteria=[SECRET]), "invalid-payload", "/extra_criteria/0"),
}


class TestBodies:
    @pytest.mark.parametrize("name", BODIES)
    def test_it_is_422_at_its_place_and_stores_nothing(self, api: Api, name: str) -> None:
        body, slug, pointer = BODIES[name]
        answer = api.post("/v1/impacts", json=body)
        problem = answer.json()
        assert (answer.status_code, problem["type"]) == (422, f"/problems/{slug}"), answer.text
        assert problem["errors"][0]["pointer"].startswith(pointer)
        assert SECRET not in answer.text
        assert_nothing_stored(api)

    @pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e400"])
    def test_a_number_that_is_none_is_refused_wherever_it_stands(self, api: Api, number: str) -> None:
        for pointer in (f"{LINEAR}/x/3", f"{LINEAR}/sample_rate_hz", "/kinematics/pre_trigger_ms"):
            text = json.dumps(changed(impact_body(), pointer, "@")).replace('"@"', number)
            answer = post(api, text.encode())
            assert answer.status_code in {400, 422}, (pointer, answer.text)
            assert number not in answer.text.replace("NaN and Infinity are refused", "")
        assert_nothing_stored(api)

    def test_a_member_that_is_named_twice_is_refused_at_its_place(self, api: Api) -> None:
        for path, body in (("/v1/score", {"kinematics": kinematics()}), ("/v1/impacts", impact_body())):
            twice = json.dumps(body).replace('"linear_acceleration"', '"axes": "sae_j211", "linear_acceleration"')
            answer = api.post(path, content=twice, headers={"Content-Type": "application/json"})
            assert answer.status_code == 422, answer.text
            [error] = answer.json()["errors"]
            assert (error["pointer"], error["code"]) == ("/kinematics/axes", "member-twice")
        assert_nothing_stored(api)

    def test_up_to_twenty_errors_are_listed(self, api: Api) -> None:
        body = impact_body()
        body["kinematics"]["linear_acceleration"]["x"] = ["1"] * 100
        assert len(api.post("/v1/impacts", json=body).json()["errors"]) == 20


class TestForms:
    def test_an_empty_body_is_400(self, api: Api) -> None:
        assert post(api, b"").status_code == 400

    @pytest.mark.parametrize(
        "body", [b"{", b"nonsense", b"\xff\xfe", b'{"a": "\xc3\x28"}', b'{"a": "\\ud800"}', b"{} {}"]
    )
    def test_what_is_not_json_is_400(self, api: Api, body: bytes) -> None:
        answer = post(api, body)
        assert (answer.status_code, answer.json()["type"]) == (400, "/problems/malformed-request")

    @pytest.mark.parametrize("body", [b"[]", b"1", b"null", b'"text"', b"true"])
    def test_anything_but_an_object_at_the_top_is_422(self, api: Api, body: bytes) -> None:
        answer = post(api, body)
        assert (answer.status_code, answer.json()["type"]) == (422, "/problems/invalid-payload")

    @pytest.mark.parametrize("depth", [500, 200_000])
    def test_deep_nesting_is_400(self, api: Api, depth: int) -> None:
        for body in (b"[" * depth + b"]" * depth, b'{"a":' * depth + b"1" + b"}" * depth):
            assert post(api, body).status_code == 400

    @pytest.mark.parametrize(
        "content_type", [None, "text/plain", "application/xml", "application/jsonx", "a/b; c=application/json"]
    )
    def test_another_content_type_is_415(self, api: Api, content_type: str | None) -> None:
        headers = {} if content_type is None else {"Content-Type": content_type}
        answer = api.post("/v1/impacts", content=json.dumps(impact_body()), headers=headers)
        assert (answer.status_code, answer.json()["type"]) == (415, "/problems/unsupported-media-type")
        assert "application/json" in answer.json()["detail"]

    @pytest.mark.parametrize("content_type", ["application/json; charset=utf-8", "Application/JSON"])
    def test_the_content_type_may_carry_a_charset(self, api: Api, content_type: str) -> None:
        assert post(api, json.dumps(impact_body()).encode(), **{"Content-Type": content_type}).status_code == 201


class TestSize:
    @pytest.fixture
    def settings(self) -> Settings:
        return Settings(max_body=20_000)

    @staticmethod
    def padded(size: int) -> bytes:
        text = json.dumps(impact_body("e-1")).encode()
        return text + b" " * (size - len(text))

    def test_a_body_at_the_bound_is_taken(self, api: Api) -> None:
        assert post(api, self.padded(20_000)).status_code == 201

    def test_one_byte_more_is_413_and_names_the_bound(self, api: Api) -> None:
        answer = post(api, self.padded(20_001))
        assert (answer.status_code, answer.json()["type"]) == (413, "/problems/body-too-large")
        assert "20000" in answer.json()["detail"]
        assert_nothing_stored(api)

    def test_so_is_a_body_that_does_not_say_its_length(self, api: Api) -> None:
        async def parts() -> Any:
            for _ in range(21):
                yield b" " * 1000

        assert post(api, parts()).status_code == 413

    def test_a_gzip_body_is_taken_and_inflates_under_the_same_bound(self, api: Api) -> None:
        encoded = {"Content-Encoding": "gzip"}
        assert post(api, zipped(self.padded(20_000)), **encoded).status_code == 201
        assert post(api, zipped(self.padded(20_001)), **encoded).status_code == 413
        assert post(api, zipped(b" " * 50_000_000), **encoded).status_code == 413

    @pytest.mark.parametrize(
        "damage", [b"nonsense", zipped(b"{}")[:-4], zipped(b"{}") + b"tail", b"", zipped(b"") * 100]
    )
    def test_a_damaged_gzip_body_is_400(self, api: Api, damage: bytes) -> None:
        answer = post(api, damage, **{"Content-Encoding": "gzip"})
        assert (answer.status_code, answer.json()["type"]) == (400, "/problems/malformed-request")

    def test_a_gzip_body_may_have_several_members(self, api: Api) -> None:
        whole = self.padded(20_000)
        assert post(api, zipped(whole[:500]) + zipped(whole[500:]), **{"Content-Encoding": "gzip"}).status_code == 201

    def test_another_encoding_is_415(self, api: Api) -> None:
        assert post(api, b"{}", **{"Content-Encoding": "br"}).status_code == 415


def test_the_default_bound_is_8_mib(api: Api) -> None:
    assert post(api, b" " * (8 * 1024 * 1024 + 1)).status_code == 413
    assert post(api, b" " * (8 * 1024 * 1024)).status_code == 400


def post(api: Api, body: bytes | Iterator[bytes], **headers: str) -> Any:
    return api.post("/v1/impacts", content=body, headers={"Content-Type": "application/json"} | headers)


def assert_nothing_stored(api: Api) -> None:
    for path in ("/v1/impacts", "/v1/athletes", "/v1/devices"):
        assert api.get(path).json()["data"] == []
