"""Lists that are read whole: paged and answered as tables like the long ones."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sending import Api, impact_body

SHORT = ("keys", "models", "presets", "schedules", "scores", "diagnoses")


@pytest.fixture(name="path_of")
def _path_of(api: Api, make_key: Callable[..., str]) -> Callable[[str], str]:
    """The address of each short list, with something in it."""
    make_key("impacts:read")
    impact = api.create("e-1", context={"session_id": "s-1"})
    athlete = impact["athlete"]["id"]
    for operating_points in ([{"criterion": "bam", "threshold": 0.2}], [{"criterion": "bam", "threshold": 0.3}]):
        body = {"model": "laksari-2020", "operating_points": operating_points}
        assert api.post(f"/v1/impacts/{impact['id']}/scores", json=body).status_code == 201
    for name in ("a", "b"):
        assert api.put(f"/v1/schedules/{name}", json={"cron": "0 3 * * 1"}).is_success
        body = impact_body(f"e-{name}", athlete={"external_id": "p-17"}, context={"session_id": f"s-{name}"})
        assert api.post("/v1/impacts", json=body).is_success
        diagnosis = {"session_id": f"s-{name}", "basis": "physician_diagnosis"}
        assert api.post(f"/v1/athletes/{athlete}/diagnoses", json=diagnosis).status_code == 201
    places = {"scores": f"impacts/{impact['id']}/scores", "diagnoses": f"athletes/{athlete}/diagnoses"}
    return lambda name: f"/v1/{places.get(name, name)}"


def _pages(api: Api, path: str, limit: int) -> list[list[dict[str, Any]]]:
    found, parameters = [], {"limit": limit}
    while True:
        answer = api.get(path, params=parameters)
        assert answer.status_code == 200, answer.text
        found.append(answer.json()["data"])
        if answer.json()["next_cursor"] is None:
            return found
        parameters = {"limit": limit, "cursor": answer.json()["next_cursor"]}


@pytest.mark.parametrize("name", SHORT)
def test_pages_hold_the_same_rows_in_the_same_order_as_the_whole(
    api: Api, path_of: Callable[[str], str], name: str
) -> None:
    whole = api.get(path_of(name)).json()
    pages = _pages(api, path_of(name), 1)
    assert whole["next_cursor"] is None
    assert [row for page in pages for row in page] == whole["data"]
    assert len(pages) == len(whole["data"])
    assert len(pages) > (name != "models")


@pytest.mark.parametrize("name", SHORT)
def test_each_is_a_table_too(api: Api, path_of: Callable[[str], str], name: str) -> None:
    rows = api.get(path_of(name)).json()["data"]
    as_csv = list(csv.DictReader(io.StringIO(api.get(path_of(name), headers={"accept": "text/csv"}).text)))
    as_ndjson = api.get(path_of(name), headers={"accept": "application/x-ndjson"}).text.splitlines()
    parquet = api.get(path_of(name), headers={"accept": "application/vnd.apache.parquet"})
    as_parquet = pq.read_table(pa.BufferReader(parquet.content)).to_pylist()
    assert len(as_csv) == len(as_ndjson) == len(as_parquet) == len(rows)
    key = {"presets": "name", "schedules": "name", "models": "version", "scores": "number"}.get(name, "id")
    for row, cells, line, typed in zip(rows, as_csv, as_ndjson, as_parquet, strict=True):
        assert str(row[key]) == cells[key] == str(json.loads(line)[key]) == str(typed[key])
        assert cells.keys() == json.loads(line).keys() == typed.keys()


def test_scores_as_a_table_have_the_columns_of_the_flat_export(api: Api, path_of: Callable[[str], str]) -> None:
    (first, *_) = api.get(path_of("scores")).json()["data"]
    answer = api.get(path_of("scores"), headers={"accept": "text/csv"})
    row = next(csv.DictReader(io.StringIO(answer.text)))
    assert float(row["hic15"]) == first["criteria"]["hic15"]["value"]
    assert float(row["bam_y"]) == first["criteria"]["bam"]["value"]["y"]
    assert float(row["bam_probability"]) == first["criteria"]["bam"]["probability"]
    assert row["current"] == "true"


def test_what_is_no_single_value_is_json_in_a_table(api: Api, path_of: Callable[[str], str]) -> None:
    answer = api.get(path_of("keys"), headers={"accept": "text/csv"})
    scopes = [json.loads(row["scopes"]) for row in csv.DictReader(io.StringIO(answer.text))]
    assert ["impacts:read"] in scopes


def test_a_cursor_of_another_list_is_400(api: Api, path_of: Callable[[str], str]) -> None:
    cursor = api.get(path_of("schedules"), params={"limit": 1}).json()["next_cursor"]
    other = api.get(path_of("keys"), params={"cursor": cursor})
    assert (other.status_code, other.json()["type"]) == (400, "/problems/bad-cursor")


@pytest.mark.parametrize("gone", ["a", "b", None])
def test_a_list_goes_on_where_a_row_is_gone(api: Api, path_of: Callable[[str], str], gone: str | None) -> None:
    for name in ("c", "d"):
        assert api.put(f"/v1/schedules/{name}", json={"cron": "0 3 * * 1"}).is_success
    cursor = api.get(path_of("schedules"), params={"limit": 2}).json()["next_cursor"]
    if gone is not None:
        assert api.delete(f"/v1/schedules/{gone}").status_code == 204
    rest = api.get(path_of("schedules"), params={"cursor": cursor}).json()
    assert [row["name"] for row in rest["data"]] == ["c", "d"]


@pytest.mark.parametrize("name", SHORT)
def test_a_bad_limit_is_422(api: Api, path_of: Callable[[str], str], name: str) -> None:
    answer = api.get(path_of(name), params={"limit": 0})
    assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, "limit")
