"""What is exported with its samples and imported by another organisation has the same scores, to the last bit."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sending import Api, half_sine, impact_body, signal

from headimpact_service.intake.exporting import SAMPLE_COLUMNS

FORMS = {
    "csv": "text/csv",
    "ndjson": "application/x-ndjson",
    "parquet": "application/vnd.apache.parquet",
}
TURNED = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
STILL = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def stamped(unit: str, peaks: tuple[float, float, float], times: list[float]) -> dict[str, Any]:
    found = signal(unit, peaks)
    del found["sample_rate_hz"]
    return found | {"time_ms": times}


def variants() -> dict[str, dict[str, Any]]:
    """An impact for every way in which a record can differ."""
    generator = np.random.default_rng(7)
    jitter = (1763665445123.0 + np.arange(100) + generator.uniform(-0.04, 0.04, 100)).tolist()
    gappy = signal("g", (50, -20, 10))
    gappy["x"] = [None if i in {60, 61} else value for i, value in enumerate(gappy["x"])]
    accelerometer = {"rotation": TURNED, "offset_mm": [71.3, -2.7, -58.1]}
    mounting = {"accelerometer": accelerometer, "gyroscope": {"rotation": STILL, "delay_ms": 1.7}}
    unlike = {
        "linear_acceleration": signal("g", (50, -20, 10), rate=1562.5, samples=120),
        "angular_velocity": signal("deg/s", (500, 900, -300), rate=2000, samples=150),
    }
    apart = {
        "linear_acceleration": stamped("g", (50, -20, 10), [0.1 + i * 0.7 for i in range(100)]),
        "angular_velocity": stamped("rad/s", (5, 20, 8), [3.3 + i * 0.9 for i in range(100)]),
    }
    fields: dict[str, dict[str, Any]] = {
        "plain": {},
        "metres and degrees": {
            "linear_acceleration": signal("m/s^2", (490.3, -196.1, 98.07)),
            "angular_velocity": signal("deg/s", (286.5, 1145.9, 458.4)),
        },
        "sae_j211, unfiltered": {"axes": "sae_j211", "filter": "none"},
        "channel frequency classes": {"filter": {"linear_acceleration": 312.5, "angular_velocity": "CFC60"}},
        "mounted": {"location": "sensor", "mounting": mounting},
        "planar": {"constrained_plane": "sagittal"},
        "trigger unknown": {"pre_trigger_ms": None},
        "jittered stamps": {
            "linear_acceleration": stamped("g", (50, -20, 10), jitter),
            "angular_velocity": stamped("rad/s", (5, 20, 8), jitter),
        },
        "rates and lengths unlike": unlike,
        "starting apart": apart,
        "one stamped, one not": {"angular_velocity": apart["angular_velocity"]},
        "stamps around zero": {
            "pre_trigger_ms": None,
            "linear_acceleration": stamped("g", (50, -20, 10), [i - 30.0 for i in range(100)]),
        },
        "jittered stamps around zero": {
            "pre_trigger_ms": None,
            "linear_acceleration": stamped("g", (50, -20, 10), [stamp - jitter[30] for stamp in jitter]),
        },
        "a trigger by the stamps": {
            "linear_acceleration": stamped("g", (50, -20, 10), [i - 30.0 for i in range(100)]),
            "angular_velocity": stamped("rad/s", (5, 20, 8), [i - 31.0 for i in range(100)]),
        },
        "angular acceleration supplied": {"angular_acceleration": signal("rad/s^2", (900, 3000, 700))},
        "acceleration in deg/s^2 only": {
            "angular_velocity": None,
            "angular_acceleration": signal("deg/s^2", (9000, 300000, 70000)),
        },
        "linear only": {"angular_velocity": None},
        "rotation only": {"linear_acceleration": None},
        "gaps to be filled": {"fill_gaps": True, "linear_acceleration": gappy},
        "a declared range": {"angular_velocity": signal("deg/s", (286.5, 1145.9, 458.4)) | {"range": 2000.0}},
    }
    bodies = {}
    for number, (name, changes) in enumerate(fields.items()):
        body = impact_body(name, scale=1 + number / 50, athlete={"external_id": f"p-{number % 3}"})
        if name == "a trigger by the stamps":
            del body["kinematics"]["pre_trigger_ms"]
        body["kinematics"] |= changes
        bodies[name] = body
    bodies["plain"]["context"] = {
        "session_id": "s-1",
        "activity": "game",
        "position": "LB",
        "worn": True,
        "video_verified": False,
        "firmware": "2.1",
        "trigger_threshold_g": 8.5,
        "level": "collegiate",
    }
    bodies["linear only"] |= {"external_id": "=1+1", "athlete": {"external_id": "-7"}}
    bodies["named like nothing"] = impact_body(
        "NA", scale=1.31, athlete={"external_id": "null"}, device={"serial": "-"}, context={"sport": "missing"}
    )
    bodies["quoted like nothing"] = impact_body("'nan", scale=1.32, athlete={"external_id": "."})
    bodies["named like a float"] = impact_body(
        "8.0", scale=1.33, athlete={"external_id": "7.0"}, device={"serial": "12.0"}, context={"session_id": "3.0"}
    )
    bodies["rotation only"] |= {"external_id": "'=1+1", "athlete": {"external_id": "'quoted"}}
    bodies["linear only"]["context"] = {"session_id": "+s", "sport": "'@"}
    bodies["plain"]["device"] = {"serial": "mg-1"}
    disowned = impact_body("disowned", scale=2.0, unscorable=["The laboratory disowns it.", "Twice."])
    disowned["kinematics"]["linear_acceleration"]["y"][7] = None
    return bodies | {"disowned": disowned}


def exported(api: Api, form: str, **query: Any) -> bytes:
    answer = api.get("/v1/impacts", params={"include": "traces", **query}, headers={"Accept": FORMS[form]})
    assert answer.status_code == 200, answer.text
    return answer.content


def imported(api: Api, data: bytes, form: str, key: str) -> dict[str, Any]:
    content_type = {"parquet": "application/octet-stream"}.get(form, FORMS[form])
    answer = api.post("/v1/imports", content=data, headers={"Content-Type": content_type}, key=key)
    assert answer.status_code == 207, answer.text
    failed = [row["problem"] for row in answer.json()["data"] if row["status"] == "failed"]
    assert failed == []
    return dict(answer.json()["summary"])


def scores(api: Api, key: str | None = None) -> dict[str, dict[str, Any]]:
    """Every impact by its name: what was computed of it."""
    rows = api.get("/v1/impacts?limit=1000", key=key or api.key).json()["data"]
    return {row["external_id"]: row for row in rows}


def comparable(impact: dict[str, Any]) -> dict[str, Any]:
    score = impact["score"]
    shown = {name: score[name] for name in ("state", "brain_angle", "peaks", "criteria", "operating_points")}
    notes = sorted(note["code"] for note in score["quality"])
    filters = score["provenance"]["filters"]
    return shown | {"quality": notes, "filters": filters, "pre_trigger_ms": impact["kinematics"]["pre_trigger_ms"]}


@pytest.mark.parametrize("form", FORMS)
def test_every_kind_of_record_comes_back_with_the_same_score(api: Api, make_key: Callable[..., str], form: str) -> None:
    for name, body in variants().items():
        answer = api.post("/v1/impacts", json=body)
        assert answer.status_code == 201, (name, answer.text)
    elsewhere = make_key(organisation="elsewhere")
    assert imported(api, exported(api, form), form, elsewhere)["created"] == len(variants())
    here, there = scores(api), scores(api, elsewhere)
    assert set(here) == set(there)
    for name, impact in here.items():
        assert comparable(there[name]) == comparable(impact), name
        assert there[name]["athlete"]["external_id"] == impact["athlete"]["external_id"]
        assert there[name]["occurred_at"] == impact["occurred_at"]
        assert there[name]["context"].items() >= impact["context"].items()
        assert there[name]["device"] == impact["device"]
    assert imported(api, exported(api, form), form, elsewhere)["unchanged"] == len(variants())


def many(api: Api, count: int) -> None:
    bodies = [
        impact_body(f"e-{i}", 0.2 + i / count, occurred_at=f"2026-11-20T19:{i // 60 % 60:02d}:{i % 60:02d}Z")
        for i in range(count)
    ]
    for first in range(0, count, 200):
        data = json.dumps(bodies[first : first + 200]).encode()
        api.post("/v1/imports", content=data, headers={"Content-Type": "application/json"})


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("count", [45, pytest.param(1000, marks=pytest.mark.campaign)])
def test_many_impacts_come_back_over_pages_with_the_same_scores(
    api: Api, make_key: Callable[..., str], form: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    if count < 100:
        monkeypatch.setattr("headimpact_service.routes.lists.PAGE_OF_TABLE", 30)
        monkeypatch.setattr("headimpact_service.routes.tables.ROW_GROUP", 1500)
    many(api, count)
    elsewhere = make_key(organisation="elsewhere")
    assert imported(api, exported(api, form), form, elsewhere)["created"] == count
    here, there = scores(api), scores(api, elsewhere)
    assert {name: comparable(impact) for name, impact in here.items()} == {
        name: comparable(impact) for name, impact in there.items()
    }


class TestForms:
    def test_a_line_of_ndjson_is_a_body_that_is_taken(self, api: Api) -> None:
        body = api.create("e-1", device={"serial": "mg-1"})
        line = json.loads(exported(api, "ndjson"))
        assert line["athlete"] == {"external_id": "p-17"}
        assert line["kinematics"]["linear_acceleration"]["x"] == half_sine(50)
        assert api.post("/v1/impacts", json=line).status_code == 200
        assert line["external_id"] == body["external_id"]

    def test_a_row_of_csv_is_a_sample(self, api: Api) -> None:
        api.create("e-1")
        rows = list(csv.DictReader(io.StringIO(exported(api, "csv").decode())))
        assert tuple(rows[0]) == SAMPLE_COLUMNS
        assert len(rows) == 100
        assert [float(row["ax_g"]) for row in rows] == half_sine(50)
        assert rows[1]["t_ms"] == "1.0"
        assert (rows[0]["filter"], rows[0]["axes"], rows[0]["alx_rad_s2"]) == ("paper", "anatomical", "")

    def test_a_data_frame_of_parquet_has_typed_columns(self, api: Api) -> None:
        api.create("e-1")
        table = pq.read_table(io.BytesIO(exported(api, "parquet")))
        assert tuple(table.column_names) == SAMPLE_COLUMNS
        assert table.num_rows == 100
        assert table.schema.field("ax_g").type == pa.float64()
        assert table.schema.field("occurred_at").type == pa.timestamp("us", "UTC")
        assert table.column("alx_rad_s2").null_count == 100

    def test_an_impact_without_a_name_leaves_under_its_id(self, api: Api) -> None:
        impact = api.create()
        assert json.loads(exported(api, "ndjson"))["external_id"] == impact["id"]

    @pytest.mark.parametrize("form", ["csv", "parquet"])
    def test_a_word_for_nothing_loses_no_more_than_the_blanks_behind_it(
        self, api: Api, make_key: Callable[..., str], form: str
    ) -> None:
        for number, name in enumerate(["e-1", "null ", " NA", "e-2"]):
            api.create(name, scale=1 + number / 10)
        other = make_key(organisation="elsewhere")
        assert imported(api, exported(api, form), form, other) == {"created": 4, "unchanged": 0, "failed": 0}
        assert set(scores(api, other)) == {"e-1", "null", " NA", "e-2"}

    def test_filters_and_pages_apply_and_tombstones_have_no_samples(self, api: Api) -> None:
        made = [api.create(f"e-{i}", scale=1 + i / 10) for i in range(3)]
        api.delete(f"/v1/impacts/{made[0]['id']}")
        headers = {"Accept": FORMS["ndjson"]}
        query = {"include": "traces", "updated_since": made[0]["updated_at"]}
        lines = api.get("/v1/impacts", params=query, headers=headers).text.splitlines()
        assert [json.loads(line)["external_id"] for line in lines] == ["e-1", "e-2"]
        page = api.get("/v1/impacts", params={"include": "traces", "limit": 1}, headers=headers)
        assert len(page.text.splitlines()) == 1
        assert page.headers["x-next-cursor"]
        assert exported(api, "csv", external_id="none").decode().strip().split(",") == list(SAMPLE_COLUMNS)
        assert pq.read_table(io.BytesIO(exported(api, "parquet", external_id="none"))).num_rows == 0

    def test_json_pages_hold_no_traces(self, api: Api) -> None:
        answer = api.get("/v1/impacts?include=traces")
        assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, "include")
        assert api.get("/v1/impacts?include=everything").status_code == 422
