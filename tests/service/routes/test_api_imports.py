"""POST /v1/imports and GET /v1/presets."""

from __future__ import annotations

import json
from typing import Any

import pytest
from sending import Api, half_sine, impact_body, zipped

FIELDS = {"athlete": "p-1", "occurred_at": "2026-11-20T19:04:05Z"}
MAPPING = {
    "time": {"column": "t", "unit": "ms"},
    "linear_acceleration": {"unit": "g", "x": "ax", "y": "ay", "z": "az"},
    "angular_velocity": {"unit": "rad/s", "x": "wx", "y": "wy", "z": "wz"},
}


def table(scale: float = 1.0) -> bytes:
    """A CSV with a mapping's columns."""
    columns = [half_sine(peak * scale) for peak in (50, -20, 10, 5, 20, 8)]
    rows = [",".join(map(str, (i, *values))) for i, values in enumerate(zip(*columns, strict=True))]
    return "\n".join(["t,ax,ay,az,wx,wy,wz", *rows]).encode()


def upload(api: Api, data: bytes, content_type: str = "text/csv", **fields: Any) -> Any:
    return api.post("/v1/imports", content=data, params=fields, headers={"Content-Type": content_type})


class TestImport:
    def test_a_csv_with_a_mapping_has_the_score_of_the_same_impact_as_json(self, api: Api) -> None:
        answer = upload(api, table(), mapping=json.dumps(MAPPING), **FIELDS)
        assert answer.status_code == 207
        assert answer.json()["summary"] == {"created": 1, "unchanged": 0, "failed": 0}
        row = answer.json()["data"][0]
        stored = api.get(f"/v1/impacts/{row['id']}").json()
        by_json = api.post("/v1/score", json=impact_body() and {"kinematics": impact_body()["kinematics"]}).json()
        assert stored["score"]["criteria"]["bam"]["value"] == by_json["criteria"]["bam"]["value"]
        assert stored["athlete"]["external_id"] == "p-1"

    def test_the_same_file_again_is_unchanged_whatever_its_name(self, api: Api) -> None:
        for name, status in (("a.csv", "created"), ("b.csv", "unchanged")):
            fields = FIELDS | {"mapping": json.dumps(MAPPING)}
            answer = api.post("/v1/imports", files={"file": (name, table(), "text/csv")}, data=fields)
            assert answer.json()["data"][0]["status"] == status
        assert len(api.get("/v1/impacts").json()["data"]) == 1

    @pytest.mark.parametrize(
        ("before", "now"),
        [
            ({}, {"unscorable": ["The accelerometer was loose."]}),
            ({"unscorable": ["The accelerometer was loose."]}, {}),
            ({}, {"context": {"worn": False}}),
        ],
    )
    def test_a_changed_mark_of_validity_is_not_taken_for_unchanged(
        self, api: Api, before: dict[str, Any], now: dict[str, Any]
    ) -> None:
        sent = {name: value for name, value in impact_body().items() if name != "external_id"}
        first, later = (json.dumps(sent | changes).encode() for changes in (before, now))
        created = upload(api, first, "application/json").json()["data"][0]["id"]
        row = upload(api, later, "application/json").json()["data"][0]
        assert (row["status"], row["problem"]["type"]) == ("failed", "/problems/conflict")
        assert created in row["problem"]["detail"]
        assert upload(api, first, "application/json").json()["summary"]["unchanged"] == 1

    def test_a_column_athlete_id_holds_our_ids_as_our_own_lists_do(self, api: Api) -> None:
        known = api.post("/v1/athletes", json={"external_id": "p-1"}).json()["id"]
        heading, *rows = table().decode().splitlines()
        for column, external_id in (("athlete_id", "p-1"), ("player", known)):
            text = "\n".join([f"{column},{heading}", *(f"{known},{row}" for row in rows)])
            mapping = json.dumps(MAPPING | {"athlete": column})
            day = "2026-11-20" if column == "player" else "2026-11-21"
            row = upload(api, text.encode(), mapping=mapping, occurred_at=f"{day}T19:04:05Z").json()["data"][0]
            assert api.get(f"/v1/impacts/{row['id']}").json()["athlete"]["external_id"] == external_id
        text = "\n".join([f"athlete_id,{heading}", *(f"{known[:-4]}0000,{row}" for row in rows)])
        row = upload(api, text.encode(), mapping=json.dumps(MAPPING)).json()["data"][0]
        assert (row["status"], row["problem"]["status"]) == ("failed", 404)

    def test_what_was_deleted_does_not_come_back_with_its_file(self, api: Api) -> None:
        fields = FIELDS | {"mapping": json.dumps(MAPPING)}
        created = upload(api, table(), **fields).json()["data"][0]["id"]
        assert api.delete(f"/v1/impacts/{created}").status_code == 204
        row = upload(api, table(), **fields).json()["data"][0]
        assert (row["status"], row["problem"]["type"]) == ("failed", "/problems/impact-deleted")
        assert api.get("/v1/impacts").json()["data"] == []
        other = upload(api, table(), **fields | {"occurred_at": "2026-11-21T19:04:05Z"}).json()
        assert other["summary"] == {"created": 1, "unchanged": 0, "failed": 0}

    def test_a_deleted_impact_is_stored_again_where_it_is_sent_by_itself(self, api: Api) -> None:
        sent = {name: value for name, value in impact_body().items() if name != "external_id"}
        api.delete(f"/v1/impacts/{api.post('/v1/impacts', json=sent).json()['id']}")
        assert upload(api, json.dumps(sent).encode(), "application/json").json()["summary"]["failed"] == 1
        assert api.post("/v1/impacts", json=sent).status_code == 201
        # now it is there, so the file is what was delivered before
        assert upload(api, json.dumps(sent).encode(), "application/json").json()["summary"]["unchanged"] == 1

    def test_json_and_ndjson_files_hold_many_impacts(self, api: Api) -> None:
        bodies = [impact_body(f"e-{i}", scale=1 + i / 10) for i in range(3)]
        listed = upload(api, json.dumps(bodies).encode(), "application/json").json()
        assert listed["summary"] == {"created": 3, "unchanged": 0, "failed": 0}
        lines = "\n".join(json.dumps(body) for body in bodies).encode()
        again = upload(api, lines, "application/x-ndjson").json()
        assert again["summary"] == {"created": 0, "unchanged": 3, "failed": 0}
        assert [row["id"] for row in again["data"]] == [row["id"] for row in listed["data"]]

    def test_one_bad_impact_does_not_stop_the_others(self, api: Api) -> None:
        bad = impact_body("bad")
        bad["kinematics"]["linear_acceleration"]["unit"] = "furlong"
        bodies = [impact_body("e-0"), bad, impact_body("e-2", scale=1.2)]
        answer = upload(api, json.dumps(bodies).encode(), "application/json")
        assert answer.status_code == 207
        assert [row["status"] for row in answer.json()["data"]] == ["created", "failed", "created"]
        assert [row["index"] for row in answer.json()["data"]] == [0, 1, 2]
        problem = answer.json()["data"][1]["problem"]
        assert (problem["status"], problem["type"]) == (422, "/problems/invalid-payload")
        assert "furlong" not in answer.text

    def test_a_conflict_is_that_impact_s_problem(self, api: Api) -> None:
        api.create("e-1")
        bodies = [impact_body("e-1", scale=2.0), impact_body("e-2", scale=1.5)]
        answer = upload(api, json.dumps(bodies).encode(), "application/json").json()
        assert answer["data"][0]["problem"]["type"] == "/problems/external-id-conflict"
        assert answer["data"][1]["status"] == "created"

    def test_a_dry_run_shows_what_is_understood_and_stores_nothing(self, api: Api) -> None:
        answer = upload(api, table(), mapping=json.dumps(MAPPING), dry_run="true", **FIELDS).json()
        row = answer["data"][0]
        assert (row["status"], row["id"]) == ("readable", None)
        preview = row["preview"]
        assert preview["kinematics"]["linear_acceleration"] == {"unit": "g", "sample_rate_hz": 1000.0, "samples": 100}
        assert preview["peaks"]["linear_acceleration_g"] > 40
        assert preview["quality"] == []
        assert api.get("/v1/impacts").json()["data"] == []
        assert "reasons" not in preview
        assert api.get("/v1/athletes").json()["data"] == []

    def test_a_dry_run_says_why_an_impact_would_not_be_scored(self, api: Api) -> None:
        body = json.dumps(impact_body("e-1", unscorable=["The laboratory withdrew it."])).encode()
        preview = upload(api, body, "application/json", dry_run="true").json()["data"][0]["preview"]
        assert (preview["state"], preview["reasons"]) == ("unscorable", ["The laboratory withdrew it."])

    def test_a_gzip_upload_is_inflated(self, api: Api) -> None:
        headers = {"Content-Type": "text/csv", "Content-Encoding": "gzip"}
        params = FIELDS | {"mapping": json.dumps(MAPPING)}
        answer = api.post("/v1/imports", content=zipped(table()), params=params, headers=headers)
        assert answer.json()["summary"]["created"] == 1

    def test_a_dry_run_beyond_a_thousand_impacts_is_413_and_names_the_bound(self, api: Api) -> None:
        line = json.dumps(impact_body()).encode() + b"\n"
        answer = upload(api, line * 1001, "application/x-ndjson", dry_run="true")
        assert (answer.status_code, answer.json()["type"]) == (413, "/problems/import-too-large")
        assert "1000" in answer.json()["detail"]
        assert api.get("/v1/jobs").json()["data"] == []

    @pytest.mark.parametrize(
        ("field", "value"),
        [
            ("sample_rate_hz", "fast"),
            ("sample_rate_hz", "100"),
            ("axes", "upside_down"),
            ("filter", "CFC7"),
            ("mapping", "{"),
            ("mapping", '{"colour": 1}'),
            ("preset", "nix"),
            ("occurred_at", "2026-11-20T19:04:05"),
            ("time_zone", "Mars/Base"),
            ("dry_run", "yes"),
            ("colour", "red"),
        ],
    )
    def test_a_field_that_breaks_a_rule_is_422_and_named(self, api: Api, field: str, value: str) -> None:
        for answer in (
            upload(api, table(), **{field: value}),
            api.post("/v1/imports", files={"file": ("a.csv", table())}, data={field: value}),
        ):
            assert (answer.status_code, answer.json()["type"]) == (422, "/problems/invalid-parameter")
            assert answer.json()["errors"][0]["parameter"] == field

    def test_a_form_without_its_file_is_422(self, api: Api) -> None:
        form = {"Content-Type": "multipart/form-data; boundary=b"}
        body = b'--b\r\nContent-Disposition: form-data; name="athlete"\r\n\r\np-1\r\n--b--\r\n'
        answer = api.post("/v1/imports", content=body, headers=form)
        assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, "file")

    @pytest.mark.parametrize(
        ("content_type", "body"),
        [
            ("multipart/form-data", b"x"),
            ("multipart/form-data; boundary=b", b"nonsense"),
            ("multipart/form-data; boundary=b", b'--b\r\nContent-Disposition: form-data; name="a"\r\n\r\nx'),
            ("multipart/form-data; boundary=b", b"--b\r\n\r\n\r\n--b--\r\n"),
        ],
    )
    def test_a_broken_multipart_is_400_or_422(self, api: Api, content_type: str, body: bytes) -> None:
        answer = api.post("/v1/imports", content=body, headers={"Content-Type": content_type})
        assert answer.status_code in {400, 422}

    @pytest.mark.parametrize("data", [b"", b"\x89HDF\r\n\x1a\n" + bytes(100), b"a,b\n1,2\n", b"{", b"PK\x03\x04junk"])
    def test_a_file_that_cannot_be_read_is_refused_whole(self, api: Api, data: bytes) -> None:
        answer = upload(api, data, "application/octet-stream")
        assert answer.status_code in {415, 422}
        assert answer.json()["type"].startswith("/problems/un")


def test_presets_are_listed_with_their_columns_units_and_axes(api: Api) -> None:
    presets = api.get("/v1/presets").json()["data"]
    assert {"prevent", "swa", "nhtsa"} <= {preset["name"] for preset in presets}
    assert all({"columns", "axes", "requires"} <= set(preset) for preset in presets)
