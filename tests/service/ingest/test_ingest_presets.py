"""A file of our own making for every preset, through POST /v1/imports to the right peaks, units and axes."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from ingest_files import RECORDINGS, needs_recordings, zipped
from making import MAKERS, PEAKS, Made
from sending import Api

from headimpact_service.ingest.presets import presets

CASES = [(name, maker) for name, makers in MAKERS.items() for maker in makers]
UNITS = {"linear_acceleration": "g", "angular_velocity": "rad/s", "angular_acceleration": "rad/s^2"}
SENT = {"athlete": "p-1", "occurred_at": "2026-11-20T19:04:05Z", "filter": "none"}


def imported(api: Api, made: Made, **fields: str) -> list[dict[str, Any]]:
    files = {"file": (made.filename, made.data, made.content_type)}
    answer = api.post("/v1/imports", files=files, data=SENT | made.fields | fields)
    assert answer.status_code == 207, answer.text
    assert answer.json()["summary"]["failed"] == 0, answer.text
    return list(answer.json()["data"])


def test_every_preset_has_a_file_here() -> None:
    elsewhere = {"stanford_mat"}
    assert set(presets()) - elsewhere == set(MAKERS)


@pytest.mark.parametrize(("name", "maker"), CASES, ids=[maker.__name__ for _, maker in CASES])
def test_a_device_s_file_is_read_to_the_right_peaks_in_the_right_units_and_axes(
    api: Api, name: str, maker: Callable[[], Made]
) -> None:
    made = maker()
    row = imported(api, made)[0]
    impact = api.get(f"/v1/impacts/{row['id']}").json()
    head = api.get(f"/v1/impacts/{row['id']}/traces?frame=head").json()
    assert (impact["source"]["preset"], impact["score"]["state"]) == (name, "scored")
    for signal, peaks in PEAKS.items():
        assert head[signal]["unit"] == UNITS[signal]
        for axis, peak, turned in zip("xyz", peaks, (1.0, -1.0, -1.0), strict=True):
            found = max(head[signal][axis], key=abs)
            assert found == pytest.approx(peak * (turned if made.j211 else 1.0), rel=0.015), (signal, axis)
    doubts = {note["code"] for note in impact["score"]["quality"]}
    assert doubts <= {"record_truncated", "edge_glitch", "resampled"}, doubts


@pytest.mark.parametrize(("name", "maker"), CASES, ids=[maker.__name__ for _, maker in CASES])
def test_a_dry_run_shows_what_is_read_and_stores_nothing(api: Api, name: str, maker: Callable[[], Made]) -> None:
    preview = imported(api, maker(), dry_run="true")[0]["preview"]
    kinematics = preview["kinematics"]
    assert kinematics["axes"] == ("sae_j211" if maker().j211 else "anatomical")
    for signal in PEAKS:
        as_sent = preview["as_sent"][signal]
        assert as_sent["unit"] == kinematics[signal]["unit"]
        assert all(as_sent["peak"][axis] is not None for axis in "xyz")
        assert as_sent["duration_ms"] > 1.0
    assert preview["peaks"]["linear_acceleration_g"] == pytest.approx(33.1, rel=0.02)
    assert api.get("/v1/impacts").json()["data"] == []


def test_the_same_file_again_is_unchanged(api: Api) -> None:
    made = MAKERS["swa"][0]()
    assert [row["status"] for row in imported(api, made)] == ["created", "created"]
    assert [row["status"] for row in imported(api, made)] == ["unchanged", "unchanged"]


def test_the_name_of_a_prevent_file_says_device_and_time_unless_a_field_does(api: Api) -> None:
    made = MAKERS["prevent"][0]()
    bare = {"file": (made.filename, made.data, "text/csv")}
    row = api.post("/v1/imports", files=bare, data={"athlete": "p-1"}).json()["data"][0]
    impact = api.get(f"/v1/impacts/{row['id']}").json()
    assert impact["device"] == {"serial": "0042"}
    assert impact["external_id"] == row["external_id"] == "MG0042-17-2026-11-20T19_04_05.123Z"
    assert impact["occurred_at"] == "2026-11-20T19:04:05.123000Z"
    other = {"athlete": "p-2", "device": "other", "occurred_at": "2026-01-01T00:00:00Z", "dry_run": "true"}
    preview = api.post("/v1/imports", files=bare, data=other).json()["data"][0]["preview"]
    assert (preview["device"], preview["occurred_at"]) == ("other", "2026-01-01T00:00:00Z")


def test_a_broken_date_must_be_given_beside_the_file(api: Api) -> None:
    made = MAKERS["swa"][0]()
    answer = api.post(
        "/v1/imports", content=made.data, params={"sample_rate_hz": "1000"}, headers={"Content-Type": "text/csv"}
    )
    problems = [row["problem"] for row in answer.json()["data"]]
    assert all("give occurred_at beside the file" in problem["detail"] for problem in problems)


def test_a_file_without_times_needs_its_rate(api: Api) -> None:
    for name in ("swa", "athlete_intelligence"):
        made = MAKERS[name][0]()
        answer = api.post("/v1/imports", content=made.data, params=SENT, headers={"Content-Type": "text/csv"})
        assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, "sample_rate_hz")


class TestList:
    def test_every_preset_is_listed_with_columns_units_axes_rates_ranges_and_traps(self, api: Api) -> None:
        listed = {preset["name"]: preset for preset in api.get("/v1/presets").json()["data"]}
        assert set(MAKERS) <= set(listed)
        for name, preset in listed.items():
            assert preset["columns"], name
            assert preset["axes"] in {"anatomical", "sae_j211"}
            assert preset["notes"], name
            assert preset["source"]
        assert listed["prevent"]["usual_rate_hz"]["linear_acceleration"] == 3200.0
        assert listed["linx_ias"]["ranges"] == {"angular_velocity": {"range": 34.8, "unit": "rad/s"}}
        assert {time["signal"] for time in listed["linx_ias"]["time"]} == {"linear_acceleration", "angular_velocity"}
        assert listed["swa"]["requires"] == ["sample_rate_hz", "occurred_at"]

    def test_it_is_json(self, api: Api) -> None:
        assert json.loads(api.get("/v1/presets").text)["next_cursor"] is None


@needs_recordings
class TestRecordings:
    """The public recordings, as a user would send them."""

    def sent(self, api: Api, name: str, data: bytes, content_type: str, **fields: str) -> dict[str, Any]:
        answer = api.post("/v1/imports", files={"file": (name, data, content_type)}, data={"athlete": "p-1", **fields})
        row = answer.json()["data"][0]
        assert row["status"] == "created", answer.text
        return dict(api.get(f"/v1/impacts/{row['id']}").json())

    def folder(self, name: str) -> bytes:
        root = RECORDINGS / name
        return zipped({f"{name}/{p.relative_to(root)}": p.read_bytes() for p in root.rglob("*") if p.is_file()})

    def test_the_crash_test_has_its_laboratory_s_hic15(self, api: Api) -> None:
        impact = self.sent(api, "v10146.zip", self.folder("nhtsa_v10146_driver"), "application/zip")
        hic15 = impact["score"]["criteria"]["hic15"]
        assert hic15["value"] == pytest.approx(140.0, abs=1.0)
        assert hic15["window_ms"] == pytest.approx([77.7, 92.7])
        assert impact["kinematics"]["filter"] == "none"

    def test_the_finite_element_example_has_its_published_brain_angles(self, api: Api) -> None:
        data = (RECORDINGS / "camlab_example_impact0.csv").read_bytes()
        bam = self.sent(api, "camlab.csv", data, "text/csv")["score"]["criteria"]["bam"]
        assert [bam["value"][axis] for axis in "xyz"] == pytest.approx([0.065, 0.277, 0.068], abs=0.003)
        assert bam["probability"] == pytest.approx(0.07, abs=0.01)

    def test_the_mouthguard_s_raw_event_is_read_by_its_preset(self, api: Api) -> None:
        data = (RECORDINGS / "headsport_rugby_img_raw.csv").read_bytes()
        impact = self.sent(api, "raw.csv", data, "text/csv")
        assert impact["source"]["preset"] == "headsport"
        assert impact["kinematics"]["linear_acceleration"]["sample_rate_hz"] == 3200.0

    def test_jittered_microseconds_are_resampled(self, api: Api) -> None:
        data = (RECORDINGS / "kinmet_example1.csv").read_bytes()
        impact = self.sent(api, "kinmet.csv", data, "text/csv")
        assert "resampled" in {note["code"] for note in impact["score"]["quality"]}
        assert impact["kinematics"]["angular_velocity"]["unit"] == "deg/s"

    def test_the_iso_mme_set_is_stored_its_absent_channel_named_and_why_it_has_no_score(self, api: Api) -> None:
        data = self.folder("iso_mme_fixture")
        impact = self.sent(api, "set.zip", data, "application/zip")
        assert impact["score"]["state"] == "unscorable"
        assert "has x but not y, z" in impact["score"]["reasons"][0]
        (note,) = impact["score"]["quality"]
        assert note["code"] == "channel_missing"
        assert "11CHST0000H3DSXP" in note["detail"]
        files = {"file": ("set.zip", data, "application/zip")}
        preview = api.post("/v1/imports", files=files, data={"dry_run": "true"}).json()["data"][0]["preview"]
        assert preview["as_sent"]["linear_acceleration"]["peak"] == {"x": 42.0, "y": None, "z": None}
        assert preview["state"] == "unscorable"
