"""A diagnosis that is reported again, and the label of one whose impact turns out to be another's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from sending import Api, impact_body

OBSERVED = {"outcome": "concussion", "basis": "physician_diagnosis", "event": "verified", "labelled_by": "clinician-3"}


def in_session(api: Api, external_id: str, scale: float, **context: Any) -> str:
    """An impact of the session s-1, the larger its scale the higher its peak angular acceleration."""
    return str(api.create(external_id, scale, context={"session_id": "s-1"} | context)["id"])


def athlete_of(api: Api, impact: str) -> str:
    return str(api.get(f"/v1/impacts/{impact}").json()["athlete"]["id"])


def diagnose(api: Api, athlete: str, **fields: Any) -> Any:
    body = {"session_id": "s-1", "diagnosed_by": "clinician-3"} | fields
    return api.post(f"/v1/athletes/{athlete}/diagnoses", json=body)


def outcome(api: Api, impact: str) -> str | None:
    found: str | None = api.get(f"/v1/impacts/{impact}").json()["outcome"]
    return found


def correct(api: Api, impact: str, external_id: str, scale: float, *, athlete: str = "p-17", **context: Any) -> Any:
    body = impact_body(external_id, scale, athlete={"external_id": athlete}, context={"session_id": "s-1"} | context)
    revision = api.get(f"/v1/impacts/{impact}").headers["etag"]
    answer = api.put(f"/v1/impacts/{impact}", json=body, headers={"if-match": revision})
    assert answer.status_code == 200
    return answer.json()


class TestAgain:
    def test_after_its_impact_was_deleted_the_next_is_labelled_by_the_same_diagnosis(self, api: Api) -> None:
        weak, strong = in_session(api, "e-1", 0.5), in_session(api, "e-2", 2.0)
        athlete = athlete_of(api, weak)
        first = diagnose(api, athlete)
        assert first.json()["impact"] == strong
        api.delete(f"/v1/impacts/{strong}")
        again = diagnose(api, athlete)
        assert (again.status_code, again.json()) == (201, first.json() | {"impact": weak})
        assert api.get(f"/v1/impacts/{weak}/label").json()["diagnosis"] == first.json()["id"]
        assert api.get(f"/v1/athletes/{athlete}/diagnoses").json()["data"] == [again.json()]
        assert diagnose(api, athlete).status_code == 200

    def test_two_registrations_of_one_athlete_have_one_concussion(self, api: Api) -> None:
        mine, others = in_session(api, "e-1", 1.5), []
        for number, scale in enumerate((1.0, 1.2)):
            body = impact_body(f"o-{number}", scale, athlete={"external_id": "p-18"}, context={"session_id": "s-1"})
            others.append(api.post("/v1/impacts", json=body).json()["id"])
        athlete, other = athlete_of(api, mine), athlete_of(api, others[0])
        diagnose(api, athlete)
        diagnose(api, other)
        assert (outcome(api, mine), outcome(api, others[1])) == ("concussion", "concussion")
        assert api.post(f"/v1/athletes/{other}/merge", json={"into": athlete}).status_code == 200
        assert (outcome(api, mine), outcome(api, others[1])) == ("concussion", None)
        assert diagnose(api, athlete).json()["impact"] == mine
        stronger = in_session(api, "e-9", 3.0)
        again = diagnose(api, athlete)
        assert (again.status_code, again.json()["impact"]) == (201, stronger)
        assert [outcome(api, impact) for impact in (mine, *others, stronger)] == [None, None, None, "concussion"]

    def test_two_registrations_diagnosed_by_two_have_one_concussion(self, api: Api) -> None:
        mine = in_session(api, "e-1", 1.0)
        body = impact_body("o-1", 2.0, athlete={"external_id": "p-18"}, context={"session_id": "s-1"})
        theirs = api.post("/v1/impacts", json=body).json()["id"]
        athlete, other = athlete_of(api, mine), athlete_of(api, theirs)
        diagnose(api, athlete, diagnosed_by="clinician-1")
        diagnose(api, other, diagnosed_by="clinician-2")
        assert api.post(f"/v1/athletes/{other}/merge", json={"into": athlete}).status_code == 200
        assert (outcome(api, mine), outcome(api, theirs)) == (None, "concussion")
        assert len(api.get(f"/v1/athletes/{athlete}/diagnoses").json()["data"]) == 2

    def test_without_another_impact_it_is_the_conflict_of_a_session_without_any(self, api: Api) -> None:
        impact = in_session(api, "e-1", 1.0)
        athlete = athlete_of(api, impact)
        diagnose(api, athlete)
        api.delete(f"/v1/impacts/{impact}")
        again = diagnose(api, athlete)
        assert (again.status_code, again.json()["type"]) == (409, "/problems/label-conflict")

    def test_after_its_label_was_taken_back_it_is_there_anew(self, api: Api) -> None:
        impact = in_session(api, "e-1", 1.0)
        athlete = athlete_of(api, impact)
        first = diagnose(api, athlete)
        api.delete(f"/v1/impacts/{impact}/label")
        again = diagnose(api, athlete)
        assert (again.status_code, again.json()) == (201, first.json())
        history = api.get(f"/v1/impacts/{impact}/label").json()["history"]
        assert [one["outcome"] for one in history] == ["concussion", None, "concussion"]

    def test_after_its_impact_was_judged_otherwise_it_is_a_conflict(self, api: Api) -> None:
        impact = in_session(api, "e-1", 1.0)
        athlete = athlete_of(api, impact)
        diagnose(api, athlete)
        api.put(f"/v1/impacts/{impact}/label", json={"outcome": "no_concussion", "basis": "video_review"})
        assert diagnose(api, athlete).status_code == 409
        api.put(f"/v1/impacts/{impact}/label", json=OBSERVED)
        assert "is labelled a concussion already" in diagnose(api, athlete).json()["detail"]

    def test_a_stronger_impact_that_came_since_takes_the_label_over(self, api: Api) -> None:
        first = in_session(api, "e-1", 1.0)
        athlete = athlete_of(api, first)
        made = diagnose(api, athlete)
        late = in_session(api, "e-2", 2.0)
        assert (outcome(api, first), outcome(api, late)) == ("concussion", None)
        again = diagnose(api, athlete)
        assert (again.status_code, again.json()) == (201, made.json() | {"impact": late})
        assert (outcome(api, first), outcome(api, late)) == (None, "concussion")

    @pytest.mark.parametrize(
        "said", [{"outcome": "no_concussion", "basis": "follow_up"}, OBSERVED], ids=["uninjured", "seen"]
    )
    def test_a_stronger_impact_that_somebody_judged_leaves_the_label_where_it_is(
        self, api: Api, said: dict[str, Any]
    ) -> None:
        first = in_session(api, "e-1", 1.0)
        athlete = athlete_of(api, first)
        diagnose(api, athlete)
        late = in_session(api, "e-2", 2.0)
        api.put(f"/v1/impacts/{late}/label", json=said)
        assert diagnose(api, athlete).status_code == 200
        assert (outcome(api, first), outcome(api, late)) == ("concussion", said["outcome"])

    def test_an_impact_that_turns_out_unworn_hands_the_label_on(self, api: Api) -> None:
        weak, strong = in_session(api, "e-1", 0.5), in_session(api, "e-2", 2.0)
        athlete = athlete_of(api, weak)
        diagnose(api, athlete)
        correct(api, strong, "e-2", 2.0, worn=False)
        assert diagnose(api, athlete).json()["impact"] == weak
        assert (outcome(api, weak), outcome(api, strong)) == ("concussion", None)


class TestMoved:
    def test_the_label_of_a_diagnosis_does_not_follow_an_impact_to_another_athlete(self, api: Api) -> None:
        weak, strong = in_session(api, "e-1", 0.5), in_session(api, "e-2", 2.0)
        athlete = athlete_of(api, weak)
        diagnose(api, athlete)
        assert correct(api, strong, "e-2", 2.0, athlete="p-18")["outcome"] is None
        history = api.get(f"/v1/impacts/{strong}/label").json()["history"]
        assert [one["outcome"] for one in history] == ["concussion", None]
        again = diagnose(api, athlete)
        assert (again.status_code, again.json()["impact"]) == (201, weak)

    def test_nor_to_another_session(self, api: Api) -> None:
        impact = in_session(api, "e-1", 1.0)
        diagnose(api, athlete_of(api, impact))
        assert correct(api, impact, "e-1", 1.0, session_id="s-2")["outcome"] is None

    def test_it_stays_through_any_other_correction(self, api: Api) -> None:
        impact = in_session(api, "e-1", 1.0)
        diagnose(api, athlete_of(api, impact))
        assert correct(api, impact, "e-1", 1.1, position="LB")["outcome"] == "concussion"

    def test_an_observed_label_follows_its_impact_and_stays_at_an_erasure(self, api: Api) -> None:
        impact = in_session(api, "e-1", 1.0)
        athlete = athlete_of(api, impact)
        diagnose(api, athlete)
        api.put(f"/v1/impacts/{impact}/label", json=OBSERVED)
        assert correct(api, impact, "e-1", 1.0, athlete="p-18")["outcome"] == "concussion"
        assert api.delete(f"/v1/athletes/{athlete}").status_code == 204
        assert outcome(api, impact) == "concussion"

    def test_erasing_the_athlete_erases_what_their_diagnosis_said_of_it(self, api: Api) -> None:
        impact = in_session(api, "e-1", 1.0)
        athlete = athlete_of(api, impact)
        diagnose(api, athlete)
        correct(api, impact, "e-1", 1.0, athlete="p-18")
        assert api.delete(f"/v1/athletes/{athlete}").status_code == 204
        found = api.get(f"/v1/impacts/{impact}/label").json()
        assert [(one["outcome"], one["labelled_by"], one["diagnosis"]) for one in found["history"]] == [
            (None, None, None)
        ]


def test_what_a_label_says_is_not_told_to_a_key_that_may_not_read_it(api: Api, make_key: Callable[..., str]) -> None:
    impact = in_session(api, "e-1", 1.0)
    api.put(f"/v1/impacts/{impact}/label", json=OBSERVED | {"outcome": "no_concussion"})
    address, body = f"/v1/athletes/{athlete_of(api, impact)}/diagnoses", {"session_id": "s-1", "basis": "other"}
    told = api.post(address, json=body, key=make_key("labels:write", "labels:read"))
    untold = api.post(address, json=body, key=make_key("labels:write"))
    assert (told.status_code, untold.status_code) == (409, 409)
    assert "no_concussion" in told.text
    assert "no_concussion" not in untold.text
    assert impact not in untold.text
