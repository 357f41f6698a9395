"""Quality notes through the API: kept with the score, found by the filter, and what devices may say of themselves."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import Any

import pytest
from sending import Api, changed, impact_body, signal

LINEAR = "/kinematics/linear_acceleration"
STILL = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def notes(impact: dict[str, Any], code: str) -> list[dict[str, Any]]:
    return [note for note in impact["score"]["quality"] if note["code"] == code]


def sent(api: Api, body: dict[str, Any]) -> dict[str, Any]:
    answer = api.post("/v1/impacts", json=body)
    assert answer.status_code == 201, answer.text
    return dict(answer.json())


def found(api: Api, **query: Any) -> list[str]:
    return [row["id"] for row in api.get("/v1/impacts", params=query).json()["data"]]


class TestFilter:
    def test_a_note_is_found_by_its_code(self, api: Api) -> None:
        api.create("e-1")
        slow = impact_body("e-2")
        for name, unit in (("linear_acceleration", "g"), ("angular_velocity", "rad/s")):
            slow["kinematics"][name] = signal(unit, (20.0, 5.0, 3.0), rate=800)
        noted = sent(api, slow)
        assert notes(noted, "low_sample_rate")
        assert found(api, quality="low_sample_rate") == [noted["id"]]
        refused = api.get("/v1/impacts", params={"quality": "low_sample"})
        assert refused.status_code == 422
        assert "low_sample_rate" in refused.json()["errors"][0]["detail"]

    def test_a_duplicate_is_found_and_names_the_other(self, api: Api) -> None:
        first, second = api.create("e-1"), api.create("e-2")
        (note,) = notes(second, "duplicate_content")
        assert first["id"] in note["detail"]
        assert found(api, quality="duplicate_content") == [second["id"]]

    def test_in_one_import_the_same_content_under_another_name_is_not_stored_again(self, api: Api) -> None:
        bodies = [impact_body("e-1"), impact_body("e-2"), impact_body("e-3", athlete={"external_id": "p-2"})]
        file = {"file": ("i.json", json.dumps(bodies), "application/json")}
        rows = api.post("/v1/imports", files=file).json()["data"]
        assert [row["status"] for row in rows] == ["created", "unchanged", "created"]
        assert rows[0]["id"] == rows[1]["id"]
        assert found(api, quality="duplicate_content") == [rows[2]["id"]]

    def test_a_code_that_no_note_can_have_is_422(self, api: Api) -> None:
        answer = api.get("/v1/impacts?quality=A%20B")
        assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, "quality")


class TestGaps:
    def gappy(self, *missing: int, fill_gaps: bool = True) -> dict[str, Any]:
        body = changed(impact_body("e-1"), "/kinematics/fill_gaps", fill_gaps)
        for index in missing:
            body = changed(body, f"{LINEAR}/x/{index}", None)
        return body

    def test_null_samples_are_filled_where_that_is_asked_for_and_come_back_as_they_were_sent(self, api: Api) -> None:
        impact = sent(api, self.gappy(40, 41))
        (note,) = notes(impact, "gaps_filled")
        assert "2 missing samples" in note["detail"]
        assert impact["kinematics"]["fill_gaps"] is True
        raw = api.get(f"/v1/impacts/{impact['id']}/traces").json()
        assert raw["linear_acceleration"]["x"][39:43] == [0.0, None, None, 0.0]
        again = api.post(f"/v1/impacts/{impact['id']}/scores", json={"model": "laksari-2020"})
        assert again.status_code == 200

    def test_a_gap_of_three_is_422_and_says_where(self, api: Api) -> None:
        answer = api.post("/v1/impacts", json=self.gappy(40, 41, 42))
        assert answer.status_code == 422
        assert answer.json()["errors"][0] == {
            "pointer": f"{LINEAR}/x/40",
            "code": "missing-sample",
            "detail": "The linear acceleration holds a value that is no number.",
        }

    def test_without_the_wish_every_null_is_named(self, api: Api) -> None:
        answer = api.post("/v1/impacts", json=self.gappy(40, 41, fill_gaps=False))
        assert answer.status_code == 422
        assert [error["pointer"] for error in answer.json()["errors"]] == [f"{LINEAR}/x/40", f"{LINEAR}/x/41"]

    def test_samples_that_the_stamps_miss_are_filled(self, api: Api) -> None:
        body = impact_body("e-1")
        body["kinematics"]["fill_gaps"] = True
        for name in ("linear_acceleration", "angular_velocity"):
            one = body["kinematics"][name]
            del one["sample_rate_hz"]
            one["time_ms"] = [float(i) for i in range(100) if i != 60]
            for axis in "xyz":
                del one[axis][60]
        impact = sent(api, body)
        assert len(notes(impact, "gaps_filled")) == 2
        whole = api.create("e-2")
        assert impact["score"]["criteria"]["bam"]["value"] == pytest.approx(
            whole["score"]["criteria"]["bam"]["value"], rel=1e-9
        )

    def test_an_import_says_so_in_a_field_beside_the_file(self, api: Api) -> None:
        body = self.gappy(40, fill_gaps=False)
        form = {"file": ("i.json", json.dumps([body]), "application/json")}
        assert api.post("/v1/imports", files=form).json()["summary"]["failed"] == 1
        body["kinematics"]["fill_gaps"] = True
        form = {"file": ("i.json", json.dumps([body]), "application/json")}
        assert api.post("/v1/imports", files=form).json()["summary"]["created"] == 1
        rows = "t_s,ax_g,ay_g,az_g\n" + "\n".join(f"{i / 1000},{'' if i == 40 else i % 7},1,2" for i in range(90))
        table = {"file": ("t.csv", rows, "text/csv")}
        assert api.post("/v1/imports", files=table).json()["summary"]["failed"] == 1
        answer = api.post("/v1/imports", files=table, data={"fill_gaps": "true"}).json()
        stored = api.get(f"/v1/impacts/{answer['data'][0]['id']}").json()
        assert notes(stored, "gaps_filled")
        wrong = api.post("/v1/imports", files=table, data={"fill_gaps": "perhaps"})
        assert (wrong.status_code, wrong.json()["errors"][0]["parameter"]) == (422, "fill_gaps")


class TestDevices:
    def test_a_peak_that_the_device_reports_is_checked(self, api: Api) -> None:
        peak = (50.0**2 + 20.0**2 + 10.0**2) ** 0.5
        right = sent(api, changed(impact_body("e-1"), f"{LINEAR}/peak_resultant", peak))
        assert notes(right, "vendor_peak_mismatch") == []
        wrong = sent(api, changed(impact_body("e-2", scale=1.1), f"{LINEAR}/peak_resultant", 62.0))
        (note,) = notes(wrong, "vendor_peak_mismatch")
        assert "62 g" in note["detail"]
        assert "60.24" in note["detail"]

    def test_a_gyroscope_s_delay_is_taken_off_inline_as_from_the_device(self, api: Api) -> None:
        mounting = {
            "accelerometer": {"rotation": STILL, "offset_mm": [70.0, 0.0, 0.0]},
            "gyroscope": {"rotation": STILL, "delay_ms": 3.0},
        }
        body = changed(impact_body("e-1"), "/kinematics/location", "sensor")
        inline = sent(api, changed(body, "/kinematics/mounting", mounting))
        assert inline["kinematics"]["mounting"] == mounting
        api.put("/v1/devices/mg-1", json={"mounting": mounting})
        assert api.get("/v1/devices/mg-1").json()["mounting"] == mounting
        device = sent(api, body | {"external_id": "e-2", "device": {"serial": "mg-1"}})
        assert device["score"]["criteria"] == inline["score"]["criteria"]
        head = api.get(f"/v1/impacts/{inline['id']}/traces?frame=head").json()
        assert len(head["angular_velocity"]["x"]) == 97

    @pytest.mark.parametrize("said_by", ["signal", "context"])
    def test_a_range_of_the_record_itself_tells_clipping(self, api: Api, said_by: str) -> None:
        body = impact_body("e-1")
        body["kinematics"]["angular_velocity"]["y"][30:34] = [33.5, 33.5, 33.5, 34.6]
        assert notes(sent(api, body), "saturated") == []
        if said_by == "signal":
            body["kinematics"]["angular_velocity"]["range"] = 34.9
        else:
            body["context"] = {"angular_velocity_range_rad_s": 34.9}
        clipped = sent(api, body | {"external_id": "e-2"})
        (note,) = notes(clipped, "saturated")
        assert (note["signal"], note["channel"]) == ("angular_velocity", "y")
        assert "3 samples" in note["detail"]


class TestPopulation:
    @pytest.mark.parametrize(
        ("athlete", "context", "reason"),
        [
            ({"sex": "female"}, {}, "sex"),
            ({"birth_year": 2010}, {}, "under 18 years"),
            ({"level": "high_school"}, {}, "a youth level of play"),
            ({}, {"sex": "female"}, "sex"),
            ({}, {"age_years": 15}, "under 18 years"),
            ({}, {"level": "U14"}, "a youth level of play"),
            ({"sex": "male", "birth_year": 1996, "level": "professional"}, {"age_years": 15}, None),
            ({}, {}, None),
        ],
    )
    def test_who_is_outside_the_model_s_population_is_noted_with_the_reason(
        self, api: Api, athlete: dict[str, Any], context: dict[str, Any], reason: str | None
    ) -> None:
        api.post("/v1/athletes", json={"external_id": "p-17", **athlete})
        found = notes(sent(api, impact_body("e-1", context=context)), "outside_model_population")
        assert [reason in note["detail"] for note in found] == ([] if reason is None else [True])

    @pytest.mark.parametrize(
        ("age_now", "context", "noted"),
        [(14, {}, True), (14, {"age_years": 25}, True), (30, {}, False), (30, {"age_years": 15}, True)],
    )
    def test_of_an_impact_of_no_known_time_the_age_at_its_receipt_counts(
        self, api: Api, age_now: int, context: dict[str, Any], noted: bool
    ) -> None:
        born = datetime.now(UTC).year - age_now
        api.post("/v1/athletes", json={"external_id": "p-17", "birth_year": born})
        body = impact_body("e-1", context=context, occurred_at=None)
        assert bool(notes(sent(api, body), "outside_model_population")) == noted

    def test_a_score_without_an_athlete_has_the_note_of_its_context(self, api: Api) -> None:
        body = {"kinematics": impact_body()["kinematics"], "context": {"sex": "female"}}
        score = api.post("/v1/score", json=body).json()
        assert [note["code"] for note in score["quality"]] == ["outside_model_population"]


class TestUnscorable:
    def test_a_record_that_its_sender_disowns_is_stored_without_a_score(self, api: Api) -> None:
        reasons = ["The laboratory marked angular velocity x as not valid."]
        body = changed(impact_body("e-1", unscorable=reasons), f"{LINEAR}/x/5", None)
        impact = sent(api, body)
        assert (impact["score"]["state"], impact["score"]["reasons"]) == ("unscorable", reasons)
        assert impact["score"]["criteria"]["bam"]["value"] is None
        raw = api.get(f"/v1/impacts/{impact['id']}/traces").json()
        assert raw["linear_acceleration"]["x"][5] is None
        assert api.post("/v1/impacts", json=body).status_code == 200


def test_the_old_name_of_a_merged_athlete_tells_of_the_one_who_stayed(api: Api) -> None:
    stays = api.post("/v1/athletes", json={"external_id": "p-stays", "sex": "female"}).json()["id"]
    goes = api.post("/v1/athletes", json={"external_id": "p-goes"}).json()["id"]
    assert api.post(f"/v1/athletes/{goes}/merge", json={"into": stays}).status_code == 200
    one = sent(api, impact_body("e-1", athlete={"external_id": "p-goes"}))
    assert (one["athlete"]["id"], len(notes(one, "outside_model_population"))) == (stays, 1)
    line = json.dumps(impact_body("e-2", scale=1.5, athlete={"external_id": "p-goes"})).encode()
    answer = api.post("/v1/imports", content=line, headers={"Content-Type": "application/x-ndjson"})
    [row] = answer.json()["data"]
    two = api.get(f"/v1/impacts/{row['id']}").json()
    assert (two["athlete"]["id"], len(notes(two, "outside_model_population"))) == (stays, 1)
