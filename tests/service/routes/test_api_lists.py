"""Lists: pages, cursors, tombstones, filters, tables."""

from __future__ import annotations

import csv
import io
import json
import sys
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sending import Api, impact_body

from headimpact_service.routes.impact_shapes import COLUMNS
from headimpact_service.store.tables import PROBABILITY_COLUMNS, VALUE_COLUMNS


def pages(api: Api, path: str) -> list[list[dict[str, Any]]]:
    found, cursor = [], None
    while True:
        separator = "&" if "?" in path else "?"
        answer = api.get(path if cursor is None else f"{path}{separator}cursor={cursor}").json()
        found.append(answer["data"])
        cursor = answer["next_cursor"]
        if cursor is None:
            return found


class TestPages:
    def test_pages_follow_each_other_newest_first_without_gap_or_overlap(self, api: Api) -> None:
        made = [api.create(f"e-{i}")["id"] for i in range(5)]
        found = pages(api, "/v1/impacts?limit=2")
        assert [len(page) for page in found] == [2, 2, 1]
        assert [row["id"] for page in found for row in page] == made[::-1]

    def test_the_last_page_has_a_null_cursor(self, api: Api) -> None:
        api.create()
        assert api.get("/v1/impacts?limit=1").json()["next_cursor"] is None

    def test_a_row_is_the_body_of_get(self, api: Api) -> None:
        impact = api.create("e-1")
        assert api.get("/v1/impacts").json()["data"] == [impact]

    @pytest.mark.parametrize("cursor", ["x", "AAAA", "%00", "e30", "-" * 40])
    def test_a_cursor_that_is_none_of_ours_is_400(self, api: Api, cursor: str) -> None:
        for path in ("/v1/impacts", "/v1/athletes", "/v1/devices"):
            answer = api.get(f"{path}?cursor={cursor}")
            assert (answer.status_code, answer.json()["type"]) == (400, "/problems/bad-cursor")

    def test_a_cursor_of_other_filters_is_400(self, api: Api) -> None:
        for i in range(2):
            api.create(f"e-{i}")
        cursor = api.get("/v1/impacts?limit=1").json()["next_cursor"]
        assert api.get(f"/v1/impacts?limit=1&cursor={cursor}").status_code == 200
        assert api.get(f"/v1/impacts?limit=1&session_id=s&cursor={cursor}").status_code == 400
        assert api.get(f"/v1/athletes?cursor={cursor}").status_code == 400

    @pytest.mark.parametrize("limit", ["0", "1001", "-1", "1.0", "ten", "", "1e2", "٣"])
    def test_a_bad_limit_is_422_and_named(self, api: Api, limit: str) -> None:
        answer = api.get("/v1/impacts", params={"limit": limit})
        assert answer.status_code == 422
        assert [error["parameter"] for error in answer.json()["errors"]] == ["limit"]

    def test_unknown_and_repeated_parameters_are_422(self, api: Api) -> None:
        assert api.get("/v1/impacts?colour=red").json()["errors"][0]["code"] == "unknown-parameter"
        assert api.get("/v1/impacts?limit=1&limit=2").json()["errors"][0]["code"] == "repeated"
        assert api.get("/v1/me?x=1").status_code == 422


class TestNul:
    """PostgreSQL keeps no text with NUL, so none can name anything."""

    @pytest.mark.parametrize(
        ("path", "parameter"),
        [
            ("/v1/impacts", "session_id"),
            ("/v1/impacts", "device_serial"),
            ("/v1/impacts", "external_id"),
            ("/v1/impacts", "athlete_id"),
            ("/v1/athletes", "external_id"),
        ],
    )
    def test_a_filter_with_nul_is_422_and_named(self, api: Api, path: str, parameter: str) -> None:
        for text in ("%00", "a%00b"):
            answer = api.get(f"{path}?{parameter}={text}")
            assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, parameter)

    @pytest.mark.parametrize("name", ["%00", "a%00"])
    @pytest.mark.parametrize(
        "path",
        ["devices/{}", "models/{}", "models/{}/report", "models/{}/risk-map", "schedules/{}", "models/aliases/{}"],
    )
    def test_a_name_with_nul_is_nobody_s(self, api: Api, path: str, name: str) -> None:
        assert api.get(f"/v1/{path.format(name)}").status_code == 404

    def test_nothing_is_done_under_a_name_with_nul(self, api: Api) -> None:
        assert api.delete("/v1/schedules/a%00").status_code == 404
        assert api.post("/v1/models/a%00/scores", json={}).status_code == 404


class TestSync:
    def test_updated_since_lists_changes_in_their_order_with_tombstones(self, api: Api) -> None:
        first, second, third = (api.create(f"e-{i}") for i in range(3))
        since = second["updated_at"]
        api.delete(f"/v1/impacts/{first['id']}")
        rows = api.get("/v1/impacts", params={"updated_since": since}).json()["data"]
        assert [row["id"] for row in rows] == [second["id"], third["id"], first["id"]]
        assert rows[2]["deleted_at"] == rows[2]["updated_at"]
        assert "score" not in rows[2]

    @pytest.mark.parametrize(
        ("change", "listed"), [({"external_id": "p-99"}, True), ({"consent": "granted"}, True), ({"sport": "x"}, False)]
    )
    def test_an_athlete_s_change_that_impacts_show_lists_them_again(
        self, api: Api, change: dict[str, str], listed: bool
    ) -> None:
        made = [api.create(f"e-{i}", athlete={"external_id": "p-17"}) for i in range(2)]
        since = {"updated_since": api.get(f"/v1/impacts/{made[1]['id']}").json()["updated_at"]}
        assert api.patch(f"/v1/athletes/{made[0]['athlete']['id']}", json=change).status_code == 200
        rows = api.get("/v1/impacts", params=since).json()["data"]
        assert [row["id"] for row in rows] == [row["id"] for row in (made if listed else made[1:])]
        assert {row["athlete"]["external_id"] for row in rows} == {change.get("external_id", "p-17")}
        assert {row["revision"] for row in rows} == {1}

    def test_who_follows_the_pages_of_changes_sees_what_changes_meanwhile(self, api: Api) -> None:
        made = [api.create(f"e-{i}", 1.0 + i) for i in range(3)]
        start = {"updated_since": made[0]["updated_at"], "limit": 2}
        page = api.get("/v1/impacts", params=start).json()
        api.delete(f"/v1/impacts/{made[0]['id']}")
        rest = api.get("/v1/impacts", params=start | {"cursor": page["next_cursor"]}).json()["data"]
        assert [row["id"] for row in rest] == [made[2]["id"], made[0]["id"]]

    @pytest.mark.parametrize("moment", ["0.5", "2026-11-20", "2026-11-20T19:04:05", "yesterday", "1763665445"])
    def test_updated_since_needs_a_whole_time_with_its_offset(self, api: Api, moment: str) -> None:
        answer = api.get("/v1/impacts", params={"updated_since": moment})
        assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, "updated_since")

    def test_updated_since_may_have_nanoseconds(self, api: Api) -> None:
        made = api.create("e-1")
        rows = api.get("/v1/impacts", params={"updated_since": "2026-11-20T19:04:05.123456789Z"}).json()["data"]
        assert [row["id"] for row in rows] == [made["id"]]


class TestFilters:
    def test_each_filter_selects(self, api: Api) -> None:
        wanted = api.create(
            "e-1", device={"serial": "mg-1"}, context={"session_id": "s-1"}, athlete={"external_id": "p-1"}
        )
        api.create("e-2", scale=0.5, occurred_at="2026-11-22T00:00:00Z")
        for name, value in {
            "external_id": "e-1",
            "athlete_id": wanted["athlete"]["id"],
            "device_serial": "mg-1",
            "session_id": "s-1",
            "occurred_to": "2026-11-21T00:00:00Z",
        }.items():
            found = api.get("/v1/impacts", params={name: value}).json()["data"]
            assert [row["id"] for row in found] == [wanted["id"]], name

    def test_a_criterion_s_probability_selects(self, api: Api) -> None:
        strong, weak = api.create("e-1", scale=1.5), api.create("e-2", scale=0.2)
        level = (
            strong["score"]["criteria"]["vtcp"]["probability"] + weak["score"]["criteria"]["vtcp"]["probability"]
        ) / 2
        found = api.get("/v1/impacts", params={"criterion": "vtcp", "min_probability": level}).json()["data"]
        assert [row["id"] for row in found] == [strong["id"]]
        assert api.get("/v1/impacts?criterion=vtcp").status_code == 422

    @pytest.mark.parametrize("value", [0.0002639375425042943, 2.6393754250429e-4, 0.012345678901234567, 5e-324])
    def test_a_probability_may_be_written_with_all_its_digits(self, api: Api, value: float) -> None:
        for text in (repr(value), f"{value:.30f}"):
            found = api.get("/v1/impacts", params={"criterion": "bam", "min_probability": text})
            assert found.status_code == 200, text

    def test_an_athlete_that_is_none_of_ours_has_no_impacts(self, api: Api) -> None:
        api.create()
        assert api.get("/v1/impacts?athlete_id=nobody").json()["data"] == []


class TestTables:
    def test_csv_has_a_column_for_every_criterion_and_probability(self, api: Api) -> None:
        impact = api.create("e-1", scale=1.0)
        answer = api.get("/v1/impacts", headers={"Accept": "text/csv"})
        assert answer.headers["content-type"] == "text/csv; charset=utf-8"
        rows = list(csv.DictReader(io.StringIO(answer.text)))
        assert tuple(rows[0]) == COLUMNS
        assert {*VALUE_COLUMNS, *PROBABILITY_COLUMNS} <= set(rows[0])
        assert rows[0]["id"] == impact["id"]
        assert rows[0]["outcome"] == ""
        assert float(rows[0]["bam_y"]) == impact["score"]["criteria"]["bam"]["value"]["y"]
        assert float(rows[0]["hic15_probability"]) == impact["score"]["criteria"]["hic15"]["probability"]

    def test_ndjson_rows_are_the_same_table(self, api: Api) -> None:
        api.create("e-1")
        api.create("e-2")
        answer = api.get("/v1/impacts", headers={"Accept": "application/x-ndjson"})
        rows = [json.loads(line) for line in answer.text.splitlines()]
        assert [row["external_id"] for row in rows] == ["e-2", "e-1"]
        assert tuple(rows[0]) == COLUMNS

    def test_a_table_runs_to_its_end_unless_a_limit_is_given(self, api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("headimpact_service.routes.lists.PAGE_OF_TABLE", 2)
        for i in range(5):
            api.create(f"e-{i}")
        whole = api.get("/v1/impacts", headers={"Accept": "text/csv"})
        assert len(whole.text.splitlines()) == 6
        page = api.get("/v1/impacts?limit=3", headers={"Accept": "text/csv"})
        assert len(page.text.splitlines()) == 4
        rest = api.get(f"/v1/impacts?limit=3&cursor={page.headers['x-next-cursor']}", headers={"Accept": "text/csv"})
        assert len(rest.text.splitlines()) == 3
        assert "x-next-cursor" not in rest.headers

    @pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@x", "\u00ad=1"])
    def test_a_cell_that_a_spreadsheet_would_run_is_defused(self, api: Api, text: str) -> None:
        api.create(text)
        answer = api.get("/v1/impacts", headers={"Accept": "text/csv"})
        cell = next(csv.DictReader(io.StringIO(answer.text)))["external_id"]
        assert cell[0] not in "=+-@"
        assert cell.endswith(text)

    def test_an_empty_table_still_has_its_headings(self, api: Api) -> None:
        answer = api.get("/v1/impacts", headers={"Accept": "text/csv"})
        assert answer.text.strip().split(",") == list(COLUMNS)

    def test_athletes_and_devices_are_tables_too(self, api: Api) -> None:
        api.create(device={"serial": "mg-1"})
        for path, column in (("/v1/athletes", "external_id"), ("/v1/devices", "serial")):
            rows = list(csv.DictReader(io.StringIO(api.get(path, headers={"Accept": "text/csv"}).text)))
            assert rows[0][column] in {"p-17", "mg-1"}

    def test_parquet_is_the_same_table_with_typed_columns(self, api: Api) -> None:
        impact = api.create("e-1", device={"serial": "mg-1"}, context={"firmware": "2.1", "worn": True})
        headers = {"Accept": "application/vnd.apache.parquet"}
        answer = api.get("/v1/impacts", headers=headers)
        assert answer.headers["content-type"] == "application/vnd.apache.parquet"
        table = pq.read_table(io.BytesIO(answer.content))
        assert tuple(table.column_names) == COLUMNS
        row = table.to_pylist()[0]
        assert row["bam_y"] == impact["score"]["criteria"]["bam"]["value"]["y"]
        assert row["occurred_at"].isoformat() == "2026-11-20T19:04:05.123000+00:00"
        assert (row["revision"], row["firmware"], row["worn"]) == (1, "2.1", True)
        for name in (*VALUE_COLUMNS, *PROBABILITY_COLUMNS, "incidence"):
            assert table.schema.field(name).type == pa.float64(), name
        for path in ("/v1/athletes", "/v1/devices", "/v1/jobs"):
            assert api.get(path, headers=headers).status_code == 200, path

    def test_parquet_is_written_row_group_by_row_group(self, api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("headimpact_service.routes.lists.PAGE_OF_TABLE", 2)
        monkeypatch.setattr("headimpact_service.routes.tables.ROW_GROUP", 2)
        for i in range(5):
            api.create(f"e-{i}")
        answer = api.get("/v1/impacts", headers={"Accept": "application/vnd.apache.parquet"})
        file = pq.ParquetFile(io.BytesIO(answer.content))
        assert (file.num_row_groups, file.metadata.num_rows) == (3, 5)

    def test_without_the_library_parquet_is_406_and_names_the_extra(
        self, api: Api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, "pyarrow", None)
        answer = api.get("/v1/impacts", headers={"Accept": "application/vnd.apache.parquet"})
        assert (answer.status_code, "headimpact[files]" in answer.json()["detail"]) == (406, True)

    @pytest.mark.parametrize(
        ("accept", "content_type"),
        [
            ("text/csv;q=0.5, application/json", "application/json"),
            ("text/*", "text/csv; charset=utf-8"),
            ("application/x-ndjson, */*;q=0.1", "application/x-ndjson"),
            ("text/html, */*", "application/json"),
            ("application/json;q=0, */*", "text/csv; charset=utf-8"),
        ],
    )
    def test_accept_chooses(self, api: Api, accept: str, content_type: str) -> None:
        assert api.get("/v1/impacts", headers={"Accept": accept}).headers["content-type"] == content_type

    def test_a_table_that_nobody_makes_is_406(self, api: Api) -> None:
        answer = api.get("/v1/impacts", headers={"Accept": "application/pdf"})
        assert (answer.status_code, answer.json()["type"]) == (406, "/problems/not-acceptable")
        assert api.post("/v1/impacts", json=impact_body(), headers={"Accept": "text/csv"}).status_code == 406
        assert api.get("/v1/impacts").json()["data"] == []
