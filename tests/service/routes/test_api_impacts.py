"""/v1/impacts and what hangs on it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest
from sending import ONSET, Api, changed, half_sine, impact_body, kinematics, score_body, signal

UNKNOWN = "imp_00000000000000000000000000"
TURNED = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]


class TestSend:
    def test_a_stored_impact_is_answered_with_its_score_and_address(self, api: Api) -> None:
        answer = api.post("/v1/impacts", json=impact_body("e-1"))
        assert answer.status_code == 201
        impact = answer.json()
        assert answer.headers["location"] == f"/v1/impacts/{impact['id']}"
        assert answer.headers["etag"] == '"1"'
        assert impact["id"].startswith("imp_")
        assert impact["athlete"]["external_id"] == "p-17"
        assert impact["score"]["state"] == "scored"

    def test_get_answers_the_same_as_post(self, api: Api) -> None:
        sent = api.post("/v1/impacts", json=impact_body("e-1", device={"serial": "mg-1"}))
        assert api.get(sent.headers["location"]).json() == sent.json()

    def test_a_stored_impact_has_the_score_of_one_that_is_not_stored(self, api: Api) -> None:
        assert api.create()["score"] == api.post("/v1/score", json=score_body()).json()

    def test_the_same_content_again_is_200_and_one_row(self, api: Api) -> None:
        first = api.post("/v1/impacts", json=impact_body("e-1"))
        again = api.post("/v1/impacts", json=impact_body("e-1"))
        assert (first.status_code, again.status_code) == (201, 200)
        assert again.json() == first.json()
        assert len(api.get("/v1/impacts").json()["data"]) == 1

    def test_the_same_athlete_by_another_name_is_the_same_content(self, api: Api) -> None:
        first = api.create("e-1")
        by_id = {"id": first["athlete"]["id"]}
        renamed = {"external_id": "p-18"}
        assert api.post("/v1/impacts", json=impact_body("e-1", athlete=renamed)).status_code == 409
        assert api.post("/v1/impacts", json=impact_body("e-1", athlete=by_id)).json() == first
        sent = api.patch(f"/v1/athletes/{by_id['id']}", json=renamed, headers={"If-Match": "*"})
        assert sent.status_code == 200
        for athlete in (renamed, by_id, {"external_id": "p-17"}):
            again = api.post("/v1/impacts", json=impact_body("e-1", athlete=athlete))
            assert (again.status_code, again.json()["id"]) == (200, first["id"]), athlete
            other = api.post("/v1/impacts", json=impact_body("e-1", athlete=athlete, scale=1.1))
            assert other.status_code == 409
        for change in ({"occurred_at": None}, {"device": {"serial": "d-9"}}, {"context": {"activity": "game"}}):
            assert api.post("/v1/impacts", json=impact_body("e-1", athlete=by_id, **change)).status_code == 409
        assert [row["external_id"] for row in api.get("/v1/athletes").json()["data"]] == ["p-18"]

    def test_other_content_under_the_same_name_is_409(self, api: Api) -> None:
        api.create("e-1")
        answer = api.post("/v1/impacts", json=impact_body("e-1", scale=1.1))
        assert answer.status_code == 409
        assert answer.json()["type"] == "/problems/external-id-conflict"

    def test_twenty_concurrent_senders_make_one_row(self, api: Api) -> None:
        async def senders() -> list[int]:
            sends = [
                api._send("POST", "/v1/impacts", {"Authorization": f"Bearer {api.key}"}, {"json": impact_body("e-1")})
                for _ in range(20)
            ]
            return [answer.status_code for answer in await asyncio.gather(*sends)]

        statuses = api.portal.call(senders)
        assert sorted(statuses) == [200] * 19 + [201]
        assert len(api.get("/v1/impacts").json()["data"]) == 1

    def test_the_same_signals_under_another_name_are_stored_with_a_note(self, api: Api) -> None:
        first, second = api.create("e-1"), api.create("e-2")
        assert second["duplicate_of"] == first["id"]
        assert "duplicate_content" in {note["code"] for note in second["score"]["quality"]}
        assert api.get(f"/v1/impacts/{second['id']}").json() == second

    def test_an_unknown_device_is_made(self, api: Api) -> None:
        api.create(device={"serial": "mg-0042"})
        assert api.get("/v1/devices/mg-0042").status_code == 200

    def test_signals_of_a_sensor_take_the_mounting_of_their_device(self, api: Api) -> None:
        mounting = {"accelerometer": {"rotation": TURNED, "offset_mm": [70.0, 0.0, -60.0]}}
        sensor = kinematics(location="sensor")
        assert api.post("/v1/impacts", json=impact_body(kinematics=sensor)).status_code == 422
        assert api.put("/v1/devices/mg-1", json={"mounting": mounting}).status_code == 201
        by_device = api.post("/v1/impacts", json=impact_body(kinematics=sensor, device={"serial": "mg-1"}))
        inline = api.post("/v1/score", json=score_body(kinematics=sensor | {"mounting": mounting}))
        assert by_device.status_code == 201
        assert by_device.json()["score"]["criteria"] == inline.json()["criteria"]
        assert by_device.json()["kinematics"]["mounting"]["accelerometer"]["offset_mm"] == [70.0, 0.0, -60.0]

    def test_an_athlete_outside_adult_men_is_noted(self, api: Api) -> None:
        api.post("/v1/athletes", json={"external_id": "p-17", "sex": "female"})
        codes = {note["code"] for note in api.create()["score"]["quality"]}
        assert "outside_model_population" in codes

    def test_a_device_that_was_not_worn_is_noted(self, api: Api) -> None:
        codes = {note["code"] for note in api.create(context={"worn": False})["score"]["quality"]}
        assert "not_worn" in codes

    def test_an_unknown_athlete_id_is_404_and_stores_nothing(self, api: Api) -> None:
        for athlete_id in ("ath_00000000000000000000000000", "nobody"):
            answer = api.post("/v1/impacts", json=impact_body(athlete={"id": athlete_id}))
            assert answer.status_code == 404
            assert answer.json()["errors"][0]["pointer"] == "/athlete/id"
        assert api.get("/v1/impacts").json()["data"] == []

    def test_a_redelivery_answers_what_it_asks_for(self, api: Api) -> None:
        first = api.create("e-9")
        asked = {"operating_points": [{"criterion": "bric", "threshold": 0.3}], "extra_criteria": ["damage"]}
        again = api.post("/v1/impacts", json=impact_body("e-9", **asked))
        assert again.status_code == 200
        score = again.json()["score"]
        assert [point["requested"] for point in score["operating_points"]] == [{"threshold": 0.3}]
        assert list(score["extra_criteria"]) == ["damage"]
        assert score["criteria"] == first["score"]["criteria"]

    def test_a_local_time_is_placed_by_its_zone(self, api: Api) -> None:
        impact = api.create(occurred_at="2026-07-01T12:00:00", time_zone="Europe/Dublin")
        assert impact["occurred_at"] == "2026-07-01T11:00:00Z"


class TestRead:
    @pytest.mark.parametrize("impact_id", [UNKNOWN, "imp_", "ath_00000000000000000000000000", "%00", "a'b"])
    def test_an_id_that_is_none_of_ours_is_404(self, api: Api, impact_id: str) -> None:
        for path in (f"/v1/impacts/{impact_id}", f"/v1/impacts/{impact_id}/traces", f"/v1/impacts/{impact_id}/scores"):
            assert api.get(path).status_code == 404

    def test_another_organisation_s_impact_is_404(self, api: Api, make_key: Callable[..., str]) -> None:
        impact = api.create()
        other = make_key(organisation="other")
        for path in ("", "/traces", "/scores"):
            assert api.get(f"/v1/impacts/{impact['id']}{path}", key=other).status_code == 404
        body = impact_body(scale=2.0)
        changes = {"If-Match": '"1"'}
        assert api.put(f"/v1/impacts/{impact['id']}", key=other, json=body, headers=changes).status_code == 404
        assert api.delete(f"/v1/impacts/{impact['id']}", key=other).status_code == 404
        assert api.get("/v1/impacts", key=other).json()["data"] == []

    def test_a_test_key_sees_a_sandbox_of_its_own(self, api: Api, make_key: Callable[..., str]) -> None:
        impact = api.create("e-1")
        sandbox = make_key(mode="test")
        assert api.get(f"/v1/impacts/{impact['id']}", key=sandbox).status_code == 404
        assert api.post("/v1/impacts", key=sandbox, json=impact_body("e-1")).status_code == 201


class TestCorrect:
    def test_a_correction_makes_a_revision_and_keeps_the_one_before(self, api: Api) -> None:
        impact = api.create("e-1")
        address = f"/v1/impacts/{impact['id']}"
        better = impact_body("e-1", scale=1.2, athlete={"external_id": "p-18"})
        answer = api.put(address, json=better, headers={"If-Match": '"1"'})
        assert answer.status_code == 200
        assert answer.headers["etag"] == '"2"'
        assert answer.json()["athlete"]["external_id"] == "p-18"
        assert answer.json()["score"]["criteria"] != impact["score"]["criteria"]
        assert [score["revision"] for score in api.get(f"{address}/scores").json()["data"]] == [1, 2]

    def test_a_correction_that_is_sent_again_is_answered_as_it_asks(self, api: Api) -> None:
        address = f"/v1/impacts/{api.create('e-1')['id']}"
        better = impact_body("e-1", scale=1.2, include=["traces"])
        first, again = (api.put(address, json=better, headers={"If-Match": "*"}) for _ in range(2))
        assert (first.headers["etag"], again.headers["etag"]) == ('"2"', '"2"')
        assert again.json() == first.json()
        assert again.json()["score"]["traces"]["brain_angle"]

    def test_a_redelivery_of_any_kept_revision_is_200(self, api: Api) -> None:
        impact = api.create("e-1")
        better = impact_body("e-1", scale=1.2)
        api.put(f"/v1/impacts/{impact['id']}", json=better, headers={"If-Match": '"1"'})
        for body in (impact_body("e-1"), better):
            answer = api.post("/v1/impacts", json=body)
            assert (answer.status_code, answer.json()["revision"]) == (200, 2)

    def test_a_name_that_another_athlete_has_now_is_a_correction(self, api: Api) -> None:
        impact = api.create("e-1")
        address, athlete = f"/v1/impacts/{impact['id']}", f"/v1/athletes/{impact['athlete']['id']}"
        api.patch(athlete, json={"external_id": "p-18"}, headers={"If-Match": "*"})
        other = api.post("/v1/athletes", json={"external_id": "p-17"}).json()
        assert api.post("/v1/impacts", json=impact_body("e-1")).json()["athlete"]["id"] == impact["athlete"]["id"]
        for _ in range(2):
            moved = api.put(address, json=impact_body("e-1"), headers={"If-Match": '"1"'})
            assert (moved.status_code, moved.headers["etag"]) == (200, '"2"')
            assert moved.json()["athlete"] == {"id": other["id"], "external_id": "p-17"}

    def test_names_that_were_entered_the_wrong_way_round_are_put_right(self, api: Api) -> None:
        first = api.create("e-1")
        second = api.create("e-2", athlete={"external_id": "p-18"})
        ways = {"p-x": first, "p-17": second, "p-18": first}
        for name, of in ways.items():
            path = f"/v1/athletes/{of['athlete']['id']}"
            assert api.patch(path, json={"external_id": name}, headers={"If-Match": "*"}).status_code == 200
        put = api.put(f"/v1/impacts/{first['id']}", json=impact_body("e-1"), headers={"If-Match": '"1"'})
        assert (put.json()["revision"], put.json()["athlete"]["id"]) == (2, second["athlete"]["id"])

    def test_the_same_body_after_the_device_s_mounting_was_corrected_is_a_correction(self, api: Api) -> None:
        mountings = [{"accelerometer": {"rotation": TURNED, "offset_mm": [x, 0.0, -60.0]}} for x in (70.0, 20.0)]
        sensor, device = kinematics(location="sensor"), {"serial": "mg-1"}
        body = impact_body("e-1", kinematics=sensor, device=device)
        api.put("/v1/devices/mg-1", json={"mounting": mountings[0]})
        first = api.post("/v1/impacts", json=body).json()
        address = f"/v1/impacts/{first['id']}"
        api.put("/v1/devices/mg-1", json={"mounting": mountings[1]}, headers={"If-Match": "*"})
        again = api.post("/v1/impacts", json=body)
        assert (again.status_code, again.json()) == (200, first)
        inline = [
            api.post("/v1/score", json=score_body(kinematics=sensor | {"mounting": mounting})).json()["criteria"]
            for mounting in mountings
        ]
        for _ in range(2):
            put = api.put(address, json=body, headers={"If-Match": '"1"'})
            assert (put.status_code, put.json()["revision"]) == (200, 2)
            assert put.json()["score"]["criteria"] == inline[1] != inline[0]
        kept = body | {"kinematics": sensor | {"mounting": mountings[0]}, "context": {"position": "QB"}}
        assert api.put(address, json=kept, headers={"If-Match": '"2"'}).json()["score"]["criteria"] == inline[0]

    def test_the_same_body_after_the_device_s_range_was_corrected_is_a_correction(self, api: Api) -> None:
        clipped = [min(value, 40.0) for value in half_sine(50)]
        body = changed(impact_body(device={"serial": "mg-1"}), "/kinematics/linear_acceleration/x", clipped)
        impact = api.post("/v1/impacts", json=body).json()
        api.put("/v1/devices/mg-1", json={"linear_acceleration_range_g": 40}, headers={"If-Match": "*"})
        for _ in range(2):
            put = api.put(f"/v1/impacts/{impact['id']}", json=body, headers={"If-Match": '"1"'}).json()
            saturated = [note for note in put["score"]["quality"] if note["code"] == "saturated"]
            assert (put["revision"], [note["channel"] for note in saturated]) == (2, ["x"])

    def test_without_if_match_it_is_428(self, api: Api) -> None:
        impact = api.create()
        answer = api.put(f"/v1/impacts/{impact['id']}", json=impact_body())
        assert (answer.status_code, answer.json()["type"]) == (428, "/problems/precondition-required")

    @pytest.mark.parametrize("tag", ['"7"', '"abc"', 'W/"1"'])
    def test_a_stale_if_match_is_412_and_changes_nothing(self, api: Api, tag: str) -> None:
        impact = api.create()
        address = f"/v1/impacts/{impact['id']}"
        answer = api.put(address, json=impact_body(scale=1.2), headers={"If-Match": tag})
        assert (answer.status_code, answer.json()["type"]) == (412, "/problems/precondition-failed")
        assert api.get(address).json() == impact

    @pytest.mark.parametrize("tag", ["", "1", "nonsense", '"1", "2"'])
    def test_an_if_match_that_is_no_tag_of_ours_is_422(self, api: Api, tag: str) -> None:
        address = f"/v1/impacts/{api.create()['id']}"
        answer = api.put(address, json=impact_body(scale=1.2), headers={"If-Match": tag})
        assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, "If-Match")


class TestDelete:
    def test_a_deleted_impact_is_gone_and_its_name_stays_taken(self, api: Api) -> None:
        impact = api.create("e-1")
        address = f"/v1/impacts/{impact['id']}"
        assert api.delete(address).status_code == 204
        assert api.get(address).status_code == 404
        assert api.delete(address).status_code == 404
        again = api.post("/v1/impacts", json=impact_body("e-1"))
        assert (again.status_code, again.json()["type"]) == (409, "/problems/impact-deleted")

    def test_a_stale_if_match_deletes_nothing(self, api: Api) -> None:
        impact = api.create()
        assert api.delete(f"/v1/impacts/{impact['id']}", headers={"If-Match": '"2"'}).status_code == 412
        assert api.get(f"/v1/impacts/{impact['id']}").status_code == 200


class TestTraces:
    def test_raw_traces_come_back_as_they_were_sent(self, api: Api) -> None:
        times = [0.5 * i for i in range(40)]
        sent = signal("m/s^2", (300.1, 20.7, 9.3), samples=40) | {"time_ms": times}
        del sent["sample_rate_hz"]
        body = impact_body(kinematics={"linear_acceleration": sent})
        impact = api.post("/v1/impacts", json=body).json()
        traces = api.get(f"/v1/impacts/{impact['id']}/traces").json()
        assert traces["frame"] == "raw"
        found = traces["linear_acceleration"]
        assert [found[axis] for axis in "xyz"] == [sent[axis] for axis in "xyz"]
        assert found["unit"] == "m/s^2"
        assert traces["angular_velocity"] is None

    def test_head_and_brain_traces_are_those_of_the_score(self, api: Api) -> None:
        impact = api.create()
        address = f"/v1/impacts/{impact['id']}/traces"
        head, brain = api.get(f"{address}?frame=head").json(), api.get(f"{address}?frame=brain").json()
        assert head["start_time_ms"] == brain["start_time_ms"] == -ONSET
        peak = max(abs(value) for value in head["linear_acceleration"]["x"])
        assert peak == impact["score"]["criteria"]["peak_linear_acceleration"]["value"]["x"]
        angle = max(abs(value) for value in brain["brain_angle"]["y"])
        assert angle == impact["score"]["brain_angle"]["y"]

    def test_without_rotation_there_is_no_brain_trace(self, api: Api) -> None:
        impact = api.create(kinematics=kinematics(angular_velocity=None))
        assert api.get(f"/v1/impacts/{impact['id']}/traces?frame=brain").json()["brain_angle"] is None

    def test_an_unknown_frame_is_422(self, api: Api) -> None:
        impact = api.create()
        answer = api.get(f"/v1/impacts/{impact['id']}/traces?frame=foot")
        assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, "frame")


class TestScores:
    def test_scoring_again_under_the_same_terms_finds_the_same_score(self, api: Api) -> None:
        impact = api.create()
        address = f"/v1/impacts/{impact['id']}/scores"
        again = api.post(address, json={"model": "laksari-2020"})
        assert again.status_code == 200
        assert again.json()["criteria"] == impact["score"]["criteria"]
        assert len(api.get(address).json()["data"]) == 1

    def test_another_incidence_makes_another_score_from_the_same_trace(self, api: Api) -> None:
        impact = api.create()
        address = f"/v1/impacts/{impact['id']}/scores"
        assert api.patch("/v1/settings", json={"incidence": 0.02}).status_code == 200
        made = api.post(address, json={"model": "laksari-2020", "make_current": True})
        assert made.status_code == 201
        assert made.json()["current"] is True
        before, after = impact["score"]["criteria"]["bam"], made.json()["criteria"]["bam"]
        assert after["value"] == before["value"]
        assert after["probability"] > before["probability"]
        listed = api.get(address).json()["data"]
        assert [score["current"] for score in listed] == [False, True]
        assert api.get(f"/v1/impacts/{impact['id']}").json()["score"]["provenance"]["incidence"] == 0.02

    def test_an_unknown_model_is_422(self, api: Api) -> None:
        impact = api.create()
        for version, code in {"nix": "unknown-model", "v" * 100: "unknown-model", "v" * 101: "too-long"}.items():
            answer = api.post(f"/v1/impacts/{impact['id']}/scores", json={"model": version})
            assert (answer.status_code, answer.json()["errors"][0]["pointer"]) == (422, "/model")
            assert answer.json()["errors"][0]["code"] == code


def test_a_component_that_is_changed_by_one_unit_in_the_last_place_is_other_content(api: Api) -> None:
    api.create("e-1")
    value = half_sine(50)[ONSET + 3] + 2**-40
    body = changed(impact_body("e-1"), f"/kinematics/linear_acceleration/x/{ONSET + 3}", value)
    assert api.post("/v1/impacts", json=body).status_code == 409
