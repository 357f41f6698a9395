"""Jobs over HTTP, where no engine runs them: what is ordered, listed, cancelled, and by whom."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from anyio.from_thread import BlockingPortal
from sending import Api, impact_body, zipped
from starlette.requests import Request

from headimpact_service import deps
from headimpact_service.app import create_app
from headimpact_service.settings import Settings
from headimpact_service.store import ids, job_runs, jobs
from headimpact_service.store.database import Database
from headimpact_service.store.jobs import Job, NewJob
from headimpact_service.store.unavailable import unavailable

ASYNC = {"Prefer": "respond-async"}
NDJSON = {"Content-Type": "application/x-ndjson"}
LINE = json.dumps(impact_body("e-1")).encode() + b"\n"


def order(api: Api, data: bytes = LINE, *, headers: dict[str, str] | None = None, **request: Any) -> httpx.Response:
    return api.post("/v1/imports", content=data, headers=NDJSON | ASYNC | (headers or {}), **request)


def uploads(tmp_path: Path) -> list[str]:
    folder = tmp_path / "uploads"
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


class TestOrder:
    def test_a_job_is_answered_with_its_address_and_its_file_is_kept(self, api: Api, tmp_path: Path) -> None:
        answer = order(api)
        assert answer.status_code == 202
        job = answer.json()
        assert answer.headers["location"] == f"/v1/jobs/{job['id']}"
        assert (job["kind"], job["state"], job["progress"]) == ("import", "queued", {"done": 0, "total": None})
        assert api.get(answer.headers["location"]).json() == job
        assert uploads(tmp_path) == [job["id"]]
        assert (tmp_path / "uploads" / job["id"]).read_bytes() == LINE

    def test_more_than_a_thousand_impacts_are_a_job(self, api: Api) -> None:
        line = b"{}\n"
        assert api.post("/v1/imports", content=line * 1000, headers=NDJSON).status_code == 207
        assert api.post("/v1/imports", content=line * 1001, headers=NDJSON).status_code == 202

    def test_more_than_16_mib_are_a_job_raw_zipped_or_as_a_form(self, api: Api, tmp_path: Path) -> None:
        large = b"x" * (16 * 1024 * 1024 + 1)
        raw = order(api, large, headers={"Prefer": "return=minimal"})
        sent = zipped(large)
        small = order(api, sent, headers={"Prefer": "wait=1", "Content-Encoding": "gzip"})
        form = api.post("/v1/imports", files={"file": ("a.csv", large, "text/csv")}, data={"athlete": "p-1"})
        for answer in (raw, small, form):
            assert answer.status_code == 202, answer.text
            file = tmp_path / "uploads" / answer.json()["id"]
            assert file.read_bytes() == large

    def test_an_upload_beyond_the_bound_is_413_sent_or_inflated_and_leaves_nothing(
        self, portal: BlockingPortal, database: Database, make_key: Callable[..., str], tmp_path: Path
    ) -> None:
        bounded = Api(portal, create_app(Settings(max_upload=20 * 1024 * 1024), database), make_key())
        large = b"x" * (20 * 1024 * 1024 + 1)
        for data, encoding in ((large, "identity"), (zipped(large), "gzip")):
            answer = order(bounded, data, headers={"Content-Encoding": encoding})
            assert answer.status_code == 413
            assert "20971520" in answer.json()["detail"]
        assert uploads(tmp_path) == []

    def test_a_field_that_breaks_a_rule_is_422_before_anything_is_ordered(self, api: Api, tmp_path: Path) -> None:
        assert order(api, params={"axes": "sideways"}).status_code == 422
        assert (uploads(tmp_path), api.get("/v1/jobs").json()["data"]) == ([], [])

    def test_a_dry_run_is_answered_at_once_though_a_job_is_preferred(self, api: Api) -> None:
        assert order(api, params={"dry_run": "true"}).status_code == 207

    @pytest.mark.parametrize("ordered", [True, False], ids=["after the commit", "before it"])
    def test_when_the_database_fails_the_file_of_a_job_that_is_there_is_kept(
        self, api: Api, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, ordered: bool
    ) -> None:
        async def fails(request: Request, data_set_id: bytes, new: NewJob) -> Job:
            if ordered:
                await deps.write(request, lambda conn: jobs.submit(conn, data_set_id, new))
            raise unavailable("The database did not answer.")

        monkeypatch.setattr(deps, "submit", fails)
        assert order(api).status_code == 503
        made = [job["id"] for job in api.get("/v1/jobs").json()["data"]]
        assert (len(made), uploads(tmp_path)) == (int(ordered), made)


class TestIdempotency:
    def test_one_key_makes_one_job_of_one_request(self, api: Api, tmp_path: Path) -> None:
        first, again = (order(api, headers={"Idempotency-Key": "k-1"}).json() for _ in range(2))
        assert first == again
        assert uploads(tmp_path) == [first["id"]]

    @pytest.mark.parametrize("params", [{}, {"athlete": "p-2"}], ids=["another file", "another field"])
    def test_one_key_for_another_request_is_409(self, api: Api, params: dict[str, str], tmp_path: Path) -> None:
        made = order(api, headers={"Idempotency-Key": "k-1"}).json()
        data = LINE if params else LINE * 2
        answer = order(api, data, params=params, headers={"Idempotency-Key": "k-1"})
        assert (answer.status_code, answer.json()["type"]) == (409, "/problems/idempotency-conflict")
        assert uploads(tmp_path) == [made["id"]]

    def test_keys_of_other_organisations_do_not_meet(self, api: Api, make_key: Callable[..., str]) -> None:
        mine = order(api, headers={"Idempotency-Key": "k-1"}).json()
        other = order(api, LINE * 2, headers={"Idempotency-Key": "k-1"}, key=make_key(organisation="Other"))
        assert other.status_code == 202
        assert other.json()["id"] != mine["id"]

    @pytest.mark.parametrize("key", ["", "a" * 201, "two words"])
    def test_a_key_that_cannot_be_one_is_422(self, api: Api, key: str) -> None:
        answer = order(api, headers={"Idempotency-Key": key})
        assert (answer.status_code, answer.json()["errors"][0]["parameter"]) == (422, "Idempotency-Key")


class TestSight:
    def test_jobs_are_listed_newest_first_by_state_and_kind_in_pages(self, api: Api) -> None:
        made = [order(api, LINE * n).json()["id"] for n in (1, 2, 3)]
        api.delete(f"/v1/jobs/{made[1]}")
        first = api.get("/v1/jobs?limit=2").json()
        second = api.get("/v1/jobs", params={"limit": 2, "cursor": first["next_cursor"]}).json()
        assert [job["id"] for job in first["data"] + second["data"]] == made[::-1]
        assert [job["id"] for job in api.get("/v1/jobs?state=cancelled&kind=import").json()["data"]] == [made[1]]
        assert api.get("/v1/jobs?state=sleeping").status_code == 422
        table = api.get("/v1/jobs", headers={"Accept": "text/csv"}).text.splitlines()
        assert table[0].startswith("id,kind,state,done,total,")
        assert len(table) == 4

    def test_another_organisation_s_job_is_404_and_so_is_the_other_mode_s(
        self, api: Api, make_key: Callable[..., str]
    ) -> None:
        address = order(api).headers["location"]
        for stranger in (make_key(organisation="Other"), make_key(mode="test")):
            for method in ("GET", "DELETE"):
                assert api.send(method, address, key=stranger).status_code == 404
            assert api.get("/v1/jobs", key=stranger).json()["data"] == []
        assert api.get(address).json()["state"] == "queued"

    @pytest.mark.parametrize("name", ["job_x", "imp_" + "0" * 26, "job_01m83javvted48sxhg2mzndhsa"])
    def test_an_id_of_nobody_is_404(self, api: Api, name: str) -> None:
        assert api.get(f"/v1/jobs/{name}").status_code == 404

    def test_to_see_an_import_a_key_needs_a_scope_for_impacts_and_to_cancel_it_the_one_that_made_it(
        self, api: Api, make_key: Callable[..., str]
    ) -> None:
        address = order(api).headers["location"]
        reader, scorer = make_key("impacts:read"), make_key("score")
        assert api.get(address, key=reader).status_code == 200
        assert api.delete(address, key=reader).status_code == 403
        assert api.get(address, key=scorer).status_code == 403
        assert api.get("/v1/jobs", key=scorer).json()["data"] == []


class TestCancel:
    def test_a_job_that_never_began_is_over_at_once_and_its_file_is_gone(self, api: Api, tmp_path: Path) -> None:
        address = order(api).headers["location"]
        answer = api.delete(address)
        assert (answer.status_code, answer.json()["state"]) == (200, "cancelled")
        assert answer.json()["problem"]["type"] == "/problems/job-cancelled"
        assert api.delete(address).json() == answer.json()
        assert uploads(tmp_path) == []

    def test_a_job_under_way_stops_before_its_next_part(self, api: Api, database: Database, tmp_path: Path) -> None:
        job = order(api).json()
        job_id = ids.decode("job", job["id"])
        assert job_id is not None
        database.write(lambda conn: job_runs.begin(conn, job_id, 1))
        answer = api.delete(f"/v1/jobs/{job['id']}")
        assert (answer.status_code, answer.json()["state"]) == (202, "cancelling")
        assert uploads(tmp_path) == [job["id"]]

    def test_a_job_that_has_ended_is_409(self, api: Api, database: Database) -> None:
        job = order(api).json()
        job_id = ids.decode("job", job["id"])
        assert job_id is not None
        short = {"summary": {"created": 1, "unchanged": 0, "failed": 0}, "failed_not_shown": 0}
        database.write(lambda conn: job_runs.begin(conn, job_id, 1))
        database.write(lambda conn: job_runs.finish(conn, job_id, 1, "succeeded", result=short, details={"failed": []}))
        assert api.delete(f"/v1/jobs/{job['id']}").status_code == 409
        assert api.get(f"/v1/jobs/{job['id']}").json()["result"] == short | {"failed": []}
        assert api.get("/v1/jobs").json()["data"][0]["result"] == short


def test_an_erased_athlete_s_external_ids_go_from_what_jobs_say_of_their_impacts(api: Api, database: Database) -> None:
    """An import that refused to store them again, with other content."""
    mine, others = {"external_id": "p-17"}, {"external_id": "p-18"}
    athlete = api.create("e-1", athlete=mine)["athlete"]["id"]
    deleted = api.create("e-2", athlete=mine)
    assert api.delete(f"/v1/impacts/{deleted['id']}").status_code == 204
    api.create("e-3", athlete=others)
    again = [impact_body(name, 1.5, athlete=of) for name, of in (("e-1", mine), ("e-2", mine), ("e-3", others))]
    job = order(api, "\n".join(map(json.dumps, again)).encode()).json()
    job_id = ids.decode("job", job["id"])
    assert job_id is not None
    rows = api.post("/v1/imports", content="\n".join(map(json.dumps, again)).encode(), headers=NDJSON).json()["data"]
    result: dict[str, Any] = {"summary": {"created": 0, "unchanged": 0, "failed": 3}, "failed_not_shown": 0}

    def end(conn: Any) -> None:
        job_runs.begin(conn, job_id, 1)
        job_runs.finish(conn, job_id, 1, "failed", result=result, details={"failed": rows})

    database.write(end)
    address = f"/v1/jobs/{job['id']}"
    assert [row["external_id"] for row in api.get(address).json()["result"]["failed"]] == ["e-1", "e-2", "e-3"]
    assert api.delete(f"/v1/athletes/{athlete}").status_code == 204
    left = api.get(address).json()["result"]
    assert [row["external_id"] for row in left["failed"]] == [None, None, "e-3"]
    assert [row["problem"]["type"] for row in left["failed"]] == [row["problem"]["type"] for row in rows]
    assert left["summary"] == result["summary"]
