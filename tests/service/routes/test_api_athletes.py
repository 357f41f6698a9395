"""/v1/athletes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from sending import Api, impact_body

WHOLE = {
    "external_id": "p-1",
    "tags": ["varsity", "2026"],
    "sport": "rugby_union",
    "level": "collegiate",
    "position": "flanker",
    "sex": "male",
    "birth_year": 2004,
    "time_zone": "Europe/Dublin",
    "consent": "granted",
}


class TestCreate:
    def test_an_athlete_comes_back_as_sent_with_its_address(self, api: Api) -> None:
        made = api.post("/v1/athletes", json=WHOLE)
        assert made.status_code == 201
        assert made.headers["location"] == f"/v1/athletes/{made.json()['id']}"
        assert {name: made.json()[name] for name in WHOLE} == WHOLE
        assert api.get(made.headers["location"]).json() == made.json()

    def test_an_external_id_is_taken_once(self, api: Api, make_key: Callable[..., str]) -> None:
        assert api.post("/v1/athletes", json=WHOLE).status_code == 201
        again = api.post("/v1/athletes", json=WHOLE)
        assert (again.status_code, again.json()["type"]) == (409, "/problems/external-id-conflict")
        assert api.post("/v1/athletes", json=WHOLE, key=make_key(organisation="other")).status_code == 201

    def test_an_impact_makes_its_athlete_on_first_sight(self, api: Api) -> None:
        impact = api.create(athlete={"external_id": "p-9"})
        assert api.get("/v1/athletes?external_id=p-9").json()["data"][0]["id"] == impact["athlete"]["id"]

    @pytest.mark.parametrize(
        ("field", "value"),
        [
            ("birth_year", 1800),
            ("birth_year", True),
            ("sex", "m"),
            ("time_zone", "Mars/Base"),
            ("tags", "x"),
            ("name", "J"),
            ("external_id", "a\nb"),
        ],
    )
    def test_a_field_that_breaks_a_rule_is_422(self, api: Api, field: str, value: object) -> None:
        answer = api.post("/v1/athletes", json={field: value})
        assert (answer.status_code, answer.json()["errors"][0]["pointer"]) == (422, f"/{field}")

    def test_an_unknown_zone_is_refused_in_words(self, api: Api) -> None:
        answer = api.post("/v1/athletes", json={"time_zone": "Mars/Base"})
        assert "IANA" in answer.json()["errors"][0]["detail"]
        assert "Mars" not in answer.text


class TestChange:
    def test_fields_that_are_left_out_stay_and_null_clears(self, api: Api) -> None:
        made = api.post("/v1/athletes", json=WHOLE)
        changed = api.patch(made.headers["location"], json={"sport": None, "level": "professional"})
        assert changed.status_code == 200
        assert changed.headers["etag"] == '"2"'
        assert (changed.json()["sport"], changed.json()["level"]) == (None, "professional")
        assert changed.json()["position"] == "flanker"

    def test_if_match_is_optional_and_held(self, api: Api) -> None:
        made = api.post("/v1/athletes", json=WHOLE)
        stale = api.patch(made.headers["location"], json={"sport": "x"}, headers={"If-Match": '"9"'})
        assert stale.status_code == 412
        assert api.get(made.headers["location"]).json() == made.json()


class TestErase:
    def test_erasing_leaves_tombstones_only(self, api: Api) -> None:
        impact = api.create("e-1", athlete={"external_id": "p-1"})
        athlete = f"/v1/athletes/{impact['athlete']['id']}"
        assert api.delete(athlete).status_code == 204
        assert api.get(athlete).status_code == 404
        assert api.get(f"/v1/impacts/{impact['id']}").status_code == 404
        since = {"updated_since": "2026-01-01T00:00:00Z"}
        athletes = api.get("/v1/athletes", params=since).json()["data"]
        assert set(athletes[0]) == {"id", "revision", "updated_at", "deleted_at", "merged_into"}
        assert api.get("/v1/impacts", params=since).json()["data"][0]["external_id"] is None
        assert api.post("/v1/impacts", json=impact_body("e-1")).status_code == 409

    def test_another_organisation_s_athlete_is_404(self, api: Api, make_key: Callable[..., str]) -> None:
        address = api.post("/v1/athletes", json=WHOLE).headers["location"]
        other = make_key(organisation="other")
        assert api.get(address, key=other).status_code == 404
        assert api.patch(address, key=other, json={}).status_code == 404
        assert api.delete(address, key=other).status_code == 404
        assert api.get(address).status_code == 200


class TestMerge:
    def merge(self, api: Api, source: str, target: str, **headers: str) -> Any:
        return api.post(f"/v1/athletes/{source}/merge", json={"into": target}, headers=headers)

    def test_a_merge_that_is_sent_again_is_done(self, api: Api) -> None:
        one, two, three = (api.post("/v1/athletes", json={"external_id": f"p-{n}"}).json()["id"] for n in range(3))
        first = self.merge(api, one, two, **{"If-Match": '"1"'})
        again = self.merge(api, one, two, **{"If-Match": '"1"'})
        assert (first.status_code, again.status_code, again.json()) == (200, 200, first.json())
        elsewhere = self.merge(api, one, three)
        assert (elsewhere.status_code, two in elsewhere.json()["detail"]) == (404, True)
        into = self.merge(api, three, one)
        assert (into.status_code, two in into.json()["detail"]) == (404, True)

    def test_a_name_that_was_merged_in_cannot_be_taken_as_the_own(self, api: Api) -> None:
        one, two = (api.post("/v1/athletes", json={"external_id": f"p-{n}"}).json()["id"] for n in range(2))
        self.merge(api, one, two)
        refused = api.patch(f"/v1/athletes/{two}", json={"external_id": "p-0"})
        assert (refused.status_code, "with a merge" in refused.json()["detail"]) == (409, True)
