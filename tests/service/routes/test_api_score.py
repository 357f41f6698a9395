"""POST /v1/score."""

from __future__ import annotations

import pytest
from sending import Api, changed, score_body, signal

from headimpact.criteria import CRITERION_KEYS


class TestScore:
    def test_a_score_has_the_thirteen_criteria_in_the_paper_s_order(self, api: Api) -> None:
        answer = api.post("/v1/score", json=score_body())
        assert answer.status_code == 200
        assert tuple(answer.json()["criteria"]) == CRITERION_KEYS

    def test_vector_criteria_are_objects_by_axis_and_others_are_numbers(self, api: Api) -> None:
        criteria = api.post("/v1/score", json=score_body()).json()["criteria"]
        assert set(criteria["bam"]["value"]) == {"x", "y", "z"}
        assert isinstance(criteria["hic15"]["value"], float)
        start, stop = criteria["hic15"]["window_ms"]
        assert stop - start <= 15

    def test_without_rotation_its_criteria_are_null_with_the_reason(self, api: Api) -> None:
        body = changed(score_body(), "/kinematics/angular_velocity", None)
        answer = api.post("/v1/score", json=body).json()
        bam = answer["criteria"]["bam"]
        assert bam["value"] is None
        assert bam["probability"] is None
        assert bam["unit"] == "rad"
        assert bam["reason"]
        assert answer["brain_angle"] is None
        assert answer["criteria"]["hic15"]["value"] > 0

    def test_degrees_sent_as_radians_are_a_quality_note_and_not_a_guess(self, api: Api) -> None:
        slow = changed(score_body(), "/kinematics/angular_velocity", signal("rad/s", (40.0, 160.0, 60.0)))
        answer = api.post("/v1/score", json=slow)
        assert answer.status_code == 200
        assert "implausible_units" in {note["code"] for note in answer.json()["quality"]}

    @pytest.mark.parametrize(
        ("shorter", "other"),
        [("linear_acceleration", "angular_velocity"), ("angular_velocity", "linear_acceleration")],
    )
    def test_signals_of_other_lengths_are_scored_where_they_overlap(self, api: Api, shorter: str, other: str) -> None:
        sent = score_body(include=["traces"])
        cut = sent["kinematics"][shorter]
        cut.update({axis: cut[axis][:80] for axis in "xyz"})
        answer = api.post("/v1/score", json=sent)
        assert answer.status_code == 200
        assert len(answer.json()["traces"][other]["x"]) == 80

    def test_operating_points_are_answered_in_the_order_asked(self, api: Api) -> None:
        asked = [
            {"criterion": "bam", "sensitivity": 0.9},
            {"criterion": "hic15", "threshold": 0.2},
            {"criterion": "bam", "sensitivity": 0.7},
        ]
        points = api.post("/v1/score", json=score_body(operating_points=asked)).json()["operating_points"]
        assert [point["basis"] for point in points] == ["published", "requested", "interpolated"]
        assert points[0]["requested"] == {"sensitivity": 0.9}
        assert points[1]["threshold"] == 0.2
        low, high = points[0]["threshold_interval"]
        assert low < points[0]["threshold"] < high

    def test_include_traces_adds_the_motion_and_the_brain_angle(self, api: Api) -> None:
        traces = api.post("/v1/score", json=score_body(include=["traces"])).json()["traces"]
        assert len(traces["brain_angle"]["x"]) == len(traces["linear_acceleration"]["z"]) == 100
        assert traces["start_time_ms"] == -10

    def test_extra_criteria_are_answered_by_name(self, api: Api) -> None:
        answer = api.post("/v1/score", json=score_body(extra_criteria=["damage"])).json()
        assert answer["extra_criteria"]["damage"]["value"] > 0

    def test_provenance_says_what_the_score_was_made_with(self, api: Api) -> None:
        provenance = api.post("/v1/score", json=score_body()).json()["provenance"]
        assert provenance["model"] == "laksari-2020"
        assert provenance["incidence"] == 0.0055
        assert provenance["input_digest"].startswith("sha256:")
        assert provenance["conventions"]["hic_window"] == "inclusive"
        assert [applied["signal"] for applied in provenance["filters"]] == ["linear_acceleration", "angular_velocity"]

    def test_a_long_record_is_scored_too(self, api: Api) -> None:
        long = signal("g", (50.0, 10.0, 10.0), rate=20_000, samples=20_000)
        body = {"kinematics": {"linear_acceleration": long}}
        assert api.post("/v1/score", json=body).status_code == 200

    def test_an_athlete_is_refused_because_nothing_is_stored(self, api: Api) -> None:
        answer = api.post("/v1/score", json=score_body(athlete={"external_id": "p-17"}))
        assert answer.status_code == 422
        assert answer.json()["errors"][0]["pointer"] == "/athlete"

    def test_nothing_is_stored(self, api: Api) -> None:
        api.post("/v1/score", json=score_body(device={"serial": "mg-9"}))
        assert api.get("/v1/impacts").json()["data"] == []
        assert api.get("/v1/devices").json()["data"] == []

    @pytest.mark.parametrize("frame", ["anatomical", "sae_j211"])
    def test_sign_flips_of_the_axes_change_no_criterion(self, api: Api, frame: str) -> None:
        plain = api.post("/v1/score", json=score_body()).json()["criteria"]
        turned = api.post("/v1/score", json=changed(score_body(), "/kinematics/axes", frame)).json()["criteria"]
        assert turned["hic15"] == plain["hic15"]
        assert turned["bam"]["probability"] == pytest.approx(plain["bam"]["probability"], rel=1e-12)
