"""Labels: one at a time, by diagnosis, many from a table; their history; and what moves them along."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from typing import Any

import pyarrow.parquet as pq
import pytest
from sending import Api, impact_body

LABEL = {"outcome": "concussion", "basis": "physician_diagnosis", "event": "verified", "labelled_by": "clinician-3"}
NONE = {"outcome": "no_concussion", "basis": "follow_up"}
TABLES: dict[str, Callable[[bytes], list[dict[str, Any]]]] = {
    "text/csv": lambda data: list(csv.DictReader(io.StringIO(data.decode()))),
    "application/x-ndjson": lambda data: [json.loads(line) for line in data.splitlines()],
    "application/vnd.apache.parquet": lambda data: pq.read_table(io.BytesIO(data)).to_pylist(),
}
"""The tables that a list is answered as, and how each is read."""


def put(api: Api, impact: str, body: dict[str, Any], **request: Any) -> Any:
    return api.put(f"/v1/impacts/{impact}/label", json=body, **request)


def in_session(api: Api, external_id: str, scale: float, athlete: str = "p-17", session: str = "s-1") -> str:
    """An impact of a session, the larger its scale the higher its peak angular acceleration."""
    body = impact_body(external_id, scale, athlete={"external_id": athlete}, context={"session_id": session})
    found = api.post("/v1/impacts", json=body)
    assert found.status_code == 201
    return str(found.json()["id"])


def athlete_of(api: Api, impact: str) -> str:
    return str(api.get(f"/v1/impacts/{impact}").json()["athlete"]["id"])


class TestOneLabel:
    def test_a_label_is_read_back_with_who_said_it_and_when(self, api: Api) -> None:
        impact = api.create("e-1")["id"]
        said = put(api, impact, LABEL)
        assert said.status_code == 200
        found = api.get(f"/v1/impacts/{impact}/label")
        assert found.json() == said.json()
        assert found.headers["etag"] == '"1"'
        label = found.json()
        assert (label["impact"], label["outcome"], label["attribution"]) == (impact, "concussion", "observed")
        assert label["labelled_by"] == "clinician-3"
        assert label["key"].startswith("key_")
        assert len(label["history"]) == 1

    def test_a_key_that_may_not_read_labels_sees_no_outcome_anywhere(
        self, api: Api, make_key: Callable[..., str]
    ) -> None:
        impact = api.create("e-1")
        address = f"/v1/impacts/{impact['id']}"
        put(api, impact["id"], LABEL)
        device, reader = make_key("impacts:write"), make_key("impacts:read")
        body, changes = impact_body("e-1"), {"If-Match": '"1"'}
        answers = [
            api.get(address, key=reader).json(),
            *api.get("/v1/impacts", key=reader).json()["data"],
            *api.get("/v1/impacts", key=reader, params={"updated_since": impact["updated_at"]}).json()["data"],
            api.post("/v1/impacts", key=device, json=body).json(),
            api.put(address, key=device, json=body, headers=changes).json(),
            api.put(address, key=device, json=impact_body("e-1", 1.1), headers=changes).json(),
        ]
        assert [answer["outcome"] for answer in answers] == [None] * 6
        for media_type, read in TABLES.items():
            (row,) = read(api.get("/v1/impacts", key=reader, headers={"Accept": media_type}).content)
            assert (row["outcome"] or None, row["event"] or None) == (None, None), media_type
            both = make_key("impacts:read", "labels:read")
            (row,) = read(api.get("/v1/impacts", key=both, headers={"Accept": media_type}).content)
            assert (row["outcome"], row["event"]) == ("concussion", "verified"), media_type

    def test_the_impact_and_its_row_in_a_table_show_the_outcome(self, api: Api) -> None:
        impact = api.create("e-1")["id"]
        assert api.get(f"/v1/impacts/{impact}").json()["outcome"] is None
        put(api, impact, LABEL)
        assert api.get(f"/v1/impacts/{impact}").json()["outcome"] == "concussion"
        table = api.get("/v1/impacts", headers={"accept": "text/csv"}).text
        (row,) = csv.DictReader(io.StringIO(table))
        assert (row["outcome"], row["event"]) == ("concussion", "verified")

    def test_another_label_supersedes_and_the_same_changes_nothing(self, api: Api) -> None:
        impact = api.create("e-1")["id"]
        put(api, impact, LABEL)
        assert put(api, impact, LABEL).headers["etag"] == '"1"'
        second = put(api, impact, NONE, headers={"if-match": '"1"'})
        assert second.headers["etag"] == '"2"'
        history = second.json()["history"]
        assert [one["outcome"] for one in history] == ["concussion", "no_concussion"]
        assert history[0]["superseded_at"] == history[1]["created_at"]
        assert put(api, impact, LABEL, headers={"if-match": '"1"'}).status_code == 412

    def test_a_label_that_is_taken_back_leaves_its_history(self, api: Api) -> None:
        impact = api.create("e-1")["id"]
        put(api, impact, LABEL)
        assert api.delete(f"/v1/impacts/{impact}/label").status_code == 204
        found = api.get(f"/v1/impacts/{impact}/label").json()
        assert found["outcome"] is None
        assert [one["outcome"] for one in found["history"]] == ["concussion", None]
        assert api.get(f"/v1/impacts/{impact}").json()["outcome"] is None
        assert api.delete(f"/v1/impacts/{impact}/label").status_code == 404

    def test_whoever_follows_the_list_by_change_learns_of_a_label(self, api: Api) -> None:
        impact = api.create("e-1")
        put(api, impact["id"], LABEL)
        since = api.get("/v1/impacts", params={"updated_since": impact["updated_at"]}).json()["data"]
        assert since[-1]["updated_at"] > impact["updated_at"]
        assert since[-1]["revision"] == 1

    @pytest.mark.parametrize(
        ("body", "pointer"),
        [
            ({}, "/outcome"),
            ({"outcome": "maybe", "basis": "other"}, "/outcome"),
            ({"outcome": "concussion", "basis": "guess"}, "/basis"),
            ({**NONE, "attribution": "observed"}, ""),
            ({**LABEL, "event": "false_positive"}, ""),
            ({**LABEL, "labelled_by": ""}, "/labelled_by"),
            ({**LABEL, "note": "x"}, "/note"),
        ],
    )
    def test_a_label_that_says_nothing_sensible_is_refused(self, api: Api, body: dict[str, Any], pointer: str) -> None:
        impact = api.create("e-1")["id"]
        found = put(api, impact, body)
        assert found.status_code == 422
        assert found.json()["errors"][0].get("pointer", "") == pointer
        assert api.get(f"/v1/impacts/{impact}/label").status_code == 404

    def test_labels_have_scopes_of_their_own(self, api: Api, make_key: Callable[..., str]) -> None:
        impact = api.create("e-1")["id"]
        reader, writer = make_key("labels:read"), make_key("labels:write")
        assert put(api, impact, LABEL, key=reader).status_code == 403
        assert put(api, impact, LABEL, key=make_key("impacts:write", "impacts:read")).status_code == 403
        assert put(api, impact, LABEL, key=writer).status_code == 200
        assert api.get(f"/v1/impacts/{impact}/label", key=writer).status_code == 403
        assert api.get(f"/v1/impacts/{impact}/label", key=reader).status_code == 200

    @pytest.mark.parametrize("method", ["get", "put", "delete"])
    def test_another_organisations_impact_is_not_found(
        self, api: Api, make_key: Callable[..., str], method: str
    ) -> None:
        impact = api.create("e-1")["id"]
        put(api, impact, LABEL)
        other = make_key("labels:read", "labels:write", organisation="other")
        request = {"json": NONE} if method == "put" else {}
        assert getattr(api, method)(f"/v1/impacts/{impact}/label", key=other, **request).status_code == 404
        assert api.get(f"/v1/impacts/{impact}/label").json()["number"] == 1


class TestDiagnoses:
    def test_the_impact_of_highest_angular_acceleration_is_labelled(self, api: Api) -> None:
        weak, strong = in_session(api, "e-1", 1.0), in_session(api, "e-2", 2.0)
        in_session(api, "e-3", 3.0, session="s-2")
        athlete = athlete_of(api, weak)
        found = api.post(
            f"/v1/athletes/{athlete}/diagnoses",
            json={"session_id": "s-1", "diagnosed_at": "2026-09-13T12:00:00+02:00", "diagnosed_by": "clinician-3"},
        )
        assert found.status_code == 201
        assert found.json()["impact"] == strong
        assert found.json()["diagnosed_at"] == "2026-09-13T10:00:00Z"
        label = api.get(f"/v1/impacts/{strong}/label").json()
        assert (label["outcome"], label["attribution"]) == ("concussion", "assumed_highest_alpha")
        assert label["diagnosis"] == found.json()["id"]
        assert api.get(f"/v1/impacts/{weak}/label").status_code == 404
        assert api.get(f"/v1/athletes/{athlete}/diagnoses").json()["data"] == [found.json()]

    def test_the_same_diagnosis_again_is_there_already(self, api: Api) -> None:
        athlete = athlete_of(api, in_session(api, "e-1", 1.0))
        first = api.post(f"/v1/athletes/{athlete}/diagnoses", json={"session_id": "s-1"})
        again = api.post(f"/v1/athletes/{athlete}/diagnoses", json={"session_id": "s-1"})
        assert (first.status_code, again.status_code) == (201, 200)
        assert first.json() == again.json()

    @pytest.mark.parametrize(
        ("labels", "told"),
        [
            ({}, "no impact with rotation in this session"),
            ({"e-1": LABEL}, "is labelled a concussion already"),
            ({"e-2": NONE}, "is labelled no_concussion"),
        ],
    )
    def test_a_session_that_says_otherwise_is_a_conflict(self, api: Api, labels: dict[str, Any], told: str) -> None:
        impacts = {"e-1": in_session(api, "e-1", 1.0), "e-2": in_session(api, "e-2", 2.0)}
        for name, body in labels.items():
            put(api, impacts[name], body)
        athlete = athlete_of(api, impacts["e-1"])
        session = "s-1" if labels else "s-9"
        found = api.post(f"/v1/athletes/{athlete}/diagnoses", json={"session_id": session})
        assert (found.status_code, found.json()["type"]) == (409, "/problems/label-conflict")
        assert told in found.json()["detail"]
        assert api.get(f"/v1/athletes/{athlete}/diagnoses").json()["data"] == []

    def test_a_false_positive_is_not_taken_for_the_impact(self, api: Api) -> None:
        weak, strong = in_session(api, "e-1", 1.0), in_session(api, "e-2", 2.0)
        put(api, strong, {"outcome": "unknown", "basis": "video_review", "event": "false_positive"})
        found = api.post(f"/v1/athletes/{athlete_of(api, weak)}/diagnoses", json={"session_id": "s-1"})
        assert found.json()["impact"] == weak

    def test_an_impact_that_no_head_had_or_that_is_not_scored_is_not_taken_for_it(self, api: Api) -> None:
        weak = in_session(api, "e-1", 1.0)
        unworn = api.create("e-2", 3.0, context={"session_id": "s-1", "worn": False})["id"]
        api.create("e-3", 4.0, context={"session_id": "s-1"}, unscorable=["The laboratory marked it invalid."])
        found = api.post(f"/v1/athletes/{athlete_of(api, weak)}/diagnoses", json={"session_id": "s-1"})
        assert (found.status_code, found.json()["impact"]) == (201, weak)
        assert api.get(f"/v1/impacts/{unworn}/label").status_code == 404

    def test_a_session_of_impacts_that_no_head_had_is_a_conflict(self, api: Api) -> None:
        unworn = api.create("e-1", context={"session_id": "s-1", "worn": False})["id"]
        found = api.post(f"/v1/athletes/{athlete_of(api, unworn)}/diagnoses", json={"session_id": "s-1"})
        assert (found.status_code, found.json()["type"]) == (409, "/problems/label-conflict")
        assert "no impact with rotation in this session" in found.json()["detail"]

    def test_an_unverified_event_may_be_the_impact(self, api: Api) -> None:
        weak, strong = in_session(api, "e-1", 1.0), in_session(api, "e-2", 2.0)
        put(api, strong, {"outcome": "unknown", "basis": "video_review", "event": "unverified"})
        found = api.post(f"/v1/athletes/{athlete_of(api, weak)}/diagnoses", json={"session_id": "s-1"})
        assert found.json()["impact"] == strong

    def test_another_organisations_athlete_is_not_found(self, api: Api, make_key: Callable[..., str]) -> None:
        athlete = athlete_of(api, in_session(api, "e-1", 1.0))
        other = make_key("labels:read", "labels:write", organisation="other")
        address = f"/v1/athletes/{athlete}/diagnoses"
        assert api.post(address, json={"session_id": "s-1"}, key=other).status_code == 404
        assert api.get(address, key=other).status_code == 404


class TestTables:
    @pytest.mark.parametrize("delimiter", [";", "\t"])
    def test_a_spreadsheet_may_separate_by_something_else(self, api: Api, delimiter: str) -> None:
        api.create("e-1")
        lines = [("external_id", "outcome", "basis"), ("e-1", "no_concussion", "follow_up")]
        text = "\ufeff" + "\r\n".join(delimiter.join(line) for line in lines)
        assert self.send(api, text).json()["summary"]["labelled"] == 1

    def send(self, api: Api, text: str, **request: Any) -> Any:
        headers = {"content-type": "text/csv"}
        return api.post("/v1/labels", content=text.encode(), headers=headers, **request)

    def test_each_line_is_answered_and_good_ones_are_taken(self, api: Api) -> None:
        one, two = api.create("e-1")["id"], api.create("e-2", 2.0)["id"]
        found = self.send(
            api,
            "impact_id,external_id,outcome,basis,event\n"
            f"{one},,concussion,physician_diagnosis,verified\n"
            ",e-2,no_concussion,follow_up,\n"
            ",e-3,no_concussion,follow_up,\n"
            f"{two},,maybe,follow_up,\n"
            ",,no_concussion,follow_up,\n",
        )
        assert found.status_code == 207
        assert found.json()["summary"] == {"labelled": 2, "unchanged": 0, "failed": 3}
        rows = found.json()["data"]
        assert [row["status"] for row in rows] == ["labelled", "labelled", "failed", "failed", "failed"]
        assert rows[2]["problem"]["type"] == "/problems/not-found"
        assert rows[3]["problem"]["errors"][0]["pointer"] == "/outcome"
        assert "names no impact" in rows[4]["problem"]["detail"]
        assert api.get(f"/v1/impacts/{two}/label").json()["outcome"] == "no_concussion"

    def test_the_same_table_again_changes_nothing(self, api: Api) -> None:
        api.create("e-1")
        table = "external_id,outcome,basis\ne-1,no_concussion,follow_up\n"
        self.send(api, table)
        assert self.send(api, table).json()["summary"] == {"labelled": 0, "unchanged": 1, "failed": 0}

    def test_a_name_that_a_data_frame_made_a_float_finds_its_impact(self, api: Api) -> None:
        api.create("3")
        found = self.send(api, "external_id,outcome,basis\n3.0,no_concussion,follow_up\n")
        assert found.json()["summary"] == {"labelled": 1, "unchanged": 0, "failed": 0}

    def test_lines_that_contradict_each_other_are_both_refused(self, api: Api) -> None:
        impact = api.create("e-1")["id"]
        found = self.send(
            api, "external_id,outcome,basis\ne-1,no_concussion,follow_up\ne-1,concussion,physician_diagnosis\n"
        )
        assert found.json()["summary"]["failed"] == 2
        assert found.json()["data"][0]["problem"]["type"] == "/problems/label-conflict"
        assert api.get(f"/v1/impacts/{impact}/label").status_code == 404

    @pytest.mark.parametrize(
        ("text", "told"),
        [
            ("", "needs a column impact_id or external_id"),
            ("outcome,basis\n", "needs a column impact_id or external_id"),
            ("external_id,basis\n", "no column outcome"),
            ("external_id,outcome,basis,mood\n", "Columns of a table of labels are"),
            ("external_id,outcome,basis,basis\n", "a column twice"),
            ('external_id,outcome,basis\n"e-1', "no CSV"),
        ],
    )
    def test_what_is_no_table_of_labels_is_refused(self, api: Api, text: str, told: str) -> None:
        found = self.send(api, text)
        assert (found.status_code, found.json()["type"]) == (422, "/problems/unreadable-file")
        assert told in found.json()["detail"]

    def test_a_line_whose_two_names_are_not_of_one_impact_labels_neither(self, api: Api) -> None:
        first, second = (api.create(name)["id"] for name in ("e-1", "e-2"))
        said = "concussion,physician_diagnosis"
        table = f"external_id,impact_id,outcome,basis\ne-1,{second},{said}\ne-1,{first},{said}\nnone,{second},{said}\n"
        found = self.send(api, table).json()
        assert [row["status"] for row in found["data"]] == ["failed", "labelled", "failed"]
        assert "not of one impact" in found["data"][0]["problem"]["detail"]
        assert api.get(f"/v1/impacts/{second}/label").status_code == 404

    def test_a_line_with_other_cells_is_told(self, api: Api) -> None:
        found = self.send(api, "external_id,outcome,basis\ne-1,no_concussion\n")
        assert "2 cells where the table has 3" in found.json()["data"][0]["problem"]["detail"]

    def test_text_that_is_not_utf8_or_no_csv_by_its_type(self, api: Api) -> None:
        bad = api.post("/v1/labels", content=b"\xff\xfe", headers={"content-type": "text/csv"})
        assert bad.status_code == 422
        assert api.post("/v1/labels", json={}).status_code == 415


class TestMoves:
    def test_a_label_stays_with_an_impact_that_is_moved_to_another_athlete(self, api: Api) -> None:
        impact = in_session(api, "e-1", 1.0)
        put(api, impact, LABEL)
        body = impact_body("e-1", 1.0, athlete={"external_id": "p-18"}, context={"session_id": "s-1"})
        moved = api.put(f"/v1/impacts/{impact}", json=body, headers={"if-match": '"1"'})
        assert moved.json()["athlete"]["external_id"] == "p-18"
        assert moved.json()["outcome"] == "concussion"
        assert api.get(f"/v1/impacts/{impact}/label").json()["number"] == 1

    def test_merged_athletes_share_impacts_labels_and_diagnoses(self, api: Api) -> None:
        one, two = in_session(api, "e-1", 1.0, "p-17"), in_session(api, "e-2", 2.0, "p-17b")
        put(api, one, NONE)
        source, target = athlete_of(api, two), athlete_of(api, one)
        api.post(f"/v1/athletes/{source}/diagnoses", json={"session_id": "s-1"})
        api.patch(f"/v1/athletes/{source}", json={"consent": "withdrawn", "tags": ["b"]})
        api.patch(f"/v1/athletes/{target}", json={"consent": "granted", "tags": ["a"], "sport": "rugby"})
        merged = api.post(f"/v1/athletes/{source}/merge", json={"into": target})
        assert merged.status_code == 200
        assert merged.json()["consent"] == "withdrawn"
        assert merged.json()["tags"] == ["a", "b"]
        assert api.get(f"/v1/athletes/{source}").status_code == 404
        listed = api.get("/v1/impacts", params={"athlete_id": target}).json()["data"]
        assert {found["id"] for found in listed} == {one, two}
        assert api.get(f"/v1/impacts/{two}/label").json()["outcome"] == "concussion"
        assert len(api.get(f"/v1/athletes/{target}/diagnoses").json()["data"]) == 1

    def test_an_impact_of_a_merged_athletes_id_may_be_sent_again(self, api: Api) -> None:
        one, two = in_session(api, "e-1", 1.0, "p-17"), in_session(api, "e-2", 2.0, "p-17b")
        source, target = athlete_of(api, two), athlete_of(api, one)
        body = impact_body("e-3", 3.0, athlete={"id": source})
        first = api.post("/v1/impacts", json=body)
        assert first.status_code == 201
        api.post(f"/v1/athletes/{source}/merge", json={"into": target})
        again = api.post("/v1/impacts", json=body)
        assert (again.status_code, again.json()["id"]) == (200, first.json()["id"])
        later = api.post("/v1/impacts", json=impact_body("e-4", 1.5, athlete={"id": source}))
        assert (later.status_code, later.json()["athlete"]["id"]) == (201, target)
        assert api.get(f"/v1/athletes/{source}").json()["detail"] == f"This athlete was merged into {target}."

    def test_a_key_that_may_only_write_labels_does_not_read_what_others_said(
        self, api: Api, make_key: Callable[..., str]
    ) -> None:
        impact = api.create("e-1")["id"]
        put(api, impact, NONE)
        writer = make_key("labels:write")
        said = api.put(f"/v1/impacts/{impact}/label", json=NONE | {"labelled_by": "clinician-9"}, key=writer).json()
        assert [one["labelled_by"] for one in said["history"]] == ["clinician-9"]
        assert len(api.get(f"/v1/impacts/{impact}/label").json()["history"]) == 2

    def test_an_athlete_who_is_not_there_is_404_also_merged_into_itself(
        self, api: Api, make_key: Callable[..., str]
    ) -> None:
        mine = athlete_of(api, api.create("e-1")["id"])
        other = make_key(organisation="other")
        for athlete, key in (("ath_00000000000000000000000000", api.key), ("ath_zzz", api.key), (mine, other)):
            answer = api.post(f"/v1/athletes/{athlete}/merge", key=key, json={"into": athlete})
            assert (answer.status_code, answer.json()["type"]) == (404, "/problems/not-found")
        itself = api.post(f"/v1/athletes/{mine}/merge", json={"into": mine})
        assert (itself.status_code, itself.json()["type"]) == (409, "/problems/conflict")

    def test_impacts_sent_later_under_the_merged_name_find_their_way(self, api: Api) -> None:
        one, two = in_session(api, "e-1", 1.0, "p-17"), in_session(api, "e-2", 2.0, "p-17b")
        source, target = athlete_of(api, two), athlete_of(api, one)
        api.post(f"/v1/athletes/{source}/merge", json={"into": target})
        later = api.create("e-3", 3.0, athlete={"external_id": "p-17b"})
        assert later["athlete"] == {"id": target, "external_id": "p-17"}
        assert later == api.get(f"/v1/impacts/{later['id']}").json()
        again = api.post(
            "/v1/impacts",
            json=impact_body("e-2", 2.0, athlete={"external_id": "p-17b"}, context={"session_id": "s-1"}),
        )
        assert again.status_code == 200
        assert api.post("/v1/athletes", json={"external_id": "p-17b"}).status_code == 409

    def test_a_merged_name_is_found_as_the_athlete_who_stayed(self, api: Api) -> None:
        one, two = in_session(api, "e-1", 1.0, "p-17"), in_session(api, "e-2", 2.0, "p-17b")
        source, target = athlete_of(api, two), athlete_of(api, one)
        api.post(f"/v1/athletes/{source}/merge", json={"into": target})
        found = {
            name: [row["id"] for row in api.get("/v1/athletes", params={"external_id": name}).json()["data"]]
            for name in ("p-17", "p-17b", "p-17c")
        }
        assert found == {"p-17": [target], "p-17b": [target], "p-17c": []}

    def test_whoever_follows_the_athletes_sees_where_one_went(self, api: Api) -> None:
        one, two = in_session(api, "e-1", 1.0, "p-17"), in_session(api, "e-2", 2.0, "p-17b")
        source, target = athlete_of(api, two), athlete_of(api, one)
        start = api.get(f"/v1/athletes/{target}").json()["created_at"]
        api.post(f"/v1/athletes/{source}/merge", json={"into": target})
        changed = {row["id"]: row for row in api.get("/v1/athletes", params={"updated_since": start}).json()["data"]}
        assert changed[source]["merged_into"] == target

    @pytest.mark.parametrize(("into", "status"), [("self", 409), ("nobody", 404), ("other", 404)])
    def test_a_merge_into_nobody_is_refused(
        self, api: Api, make_key: Callable[..., str], into: str, status: int
    ) -> None:
        source = athlete_of(api, in_session(api, "e-1", 1.0))
        other = api.post("/v1/athletes", json={}, key=make_key("athletes:write", organisation="other")).json()["id"]
        target = {"self": source, "nobody": "ath_01kab3fz8c9vqt5n2m7d4xw6ye", "other": other}[into]
        assert api.post(f"/v1/athletes/{source}/merge", json={"into": target}).status_code == status
        assert api.get(f"/v1/athletes/{source}").status_code == 200

    def test_erasing_an_athlete_erases_labels_diagnoses_and_merged_names(self, api: Api) -> None:
        one, two = in_session(api, "e-1", 1.0, "p-17"), in_session(api, "e-2", 2.0, "p-17b")
        source, target = athlete_of(api, two), athlete_of(api, one)
        api.post(f"/v1/athletes/{source}/diagnoses", json={"session_id": "s-1"})
        api.post(f"/v1/athletes/{source}/merge", json={"into": target})
        assert api.delete(f"/v1/athletes/{target}").status_code == 204
        assert api.get(f"/v1/impacts/{two}/label").status_code == 404
        assert api.post("/v1/athletes", json={"external_id": "p-17b"}).status_code == 201
