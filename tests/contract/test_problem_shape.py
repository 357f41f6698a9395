"""One shape for every error: the table walks every way to fail, and every problem type is in it."""

from __future__ import annotations

import asyncio
import json
import logging
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from anyio.from_thread import BlockingPortal
from postgres import Server
from sending import Api, changed, impact_body, kinematics, signal, zipped

from headimpact_service.app import create_app
from headimpact_service.errors import MAX_ERRORS, PROBLEMS
from headimpact_service.settings import Settings
from headimpact_service.store.database import Database

SECRET = "Zyxw-very-private"
MIRROR = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]
JSON = {"Content-Type": "application/json"}
MOUNTING = {"accelerometer": {"rotation": MIRROR, "offset_mm": [0.0, 0.0, 0.0]}}

Way = Callable[[Api], httpx.Response]


def deleted(api: Api) -> httpx.Response:
    api.delete(f"/v1/impacts/{api.create('e-1')['id']}")
    return api.post("/v1/impacts", json=impact_body("e-1"))


def renamed(api: Api) -> httpx.Response:
    address = f"/v1/impacts/{api.create('e-1')['id']}"
    return api.put(address, json=impact_body("e-2", scale=2.0), headers={"If-Match": '"1"'})


def diagnosed_without_impacts(api: Api) -> httpx.Response:
    athlete = api.post("/v1/athletes", json={}).json()["id"]
    return api.post(f"/v1/athletes/{athlete}/diagnoses", json={"session_id": SECRET})


def taken(api: Api) -> httpx.Response:
    api.create("e-1")
    return api.post("/v1/impacts", json=impact_body("e-1", scale=2.0))


def corrected(api: Api, headers: dict[str, str]) -> httpx.Response:
    return api.put(f"/v1/impacts/{api.create()['id']}", json=impact_body(scale=2.0), headers=headers)


# (problem, what is done, how it fails)
WAYS: list[tuple[str, str, Way]] = [
    ("malformed-request", "not JSON", lambda api: api.post("/v1/score", content=SECRET.encode(), headers=JSON)),
    (
        "malformed-request",
        "no gzip",
        lambda api: api.post("/v1/score", content=SECRET, headers=JSON | {"Content-Encoding": "gzip"}),
    ),
    (
        "malformed-request",
        "no multipart",
        lambda api: api.post(
            "/v1/imports", content=SECRET, headers={"Content-Type": "multipart/form-data; boundary=b"}
        ),
    ),
    ("bad-cursor", "a cursor of nobody", lambda api: api.get(f"/v1/impacts?cursor={SECRET}")),
    ("unauthenticated", "no key", lambda api: api.get("/v1/me", key=None)),
    ("unauthenticated", "an unknown key", lambda api: api.get("/v1/me", key=SECRET)),
    (
        "insufficient-scope",
        "a key for scores only",
        lambda api: api.get("/v1/keys", key=api.post("/v1/keys", json={"scopes": ["score"]}).json()["key"]),
    ),
    ("not-found", "an unknown path", lambda api: api.get(f"/{SECRET}")),
    ("not-found", "an unknown path below /v1", lambda api: api.get(f"/v1/{SECRET}")),
    ("not-found", "a trailing slash", lambda api: api.get("/v1/impacts/")),
    ("not-found", "an id of nobody", lambda api: api.get(f"/v1/athletes/{SECRET}")),
    ("not-found", "a device of nobody", lambda api: api.get(f"/v1/devices/{SECRET}")),
    ("not-found", "a problem of nobody", lambda api: api.get(f"/problems/{SECRET}")),
    ("method-not-allowed", "a method that is not taken", lambda api: api.send("PATCH", "/v1/impacts")),
    ("method-not-allowed", "HEAD", lambda api: api.send("PUT", "/livez")),
    ("not-acceptable", "a picture", lambda api: api.get("/v1/impacts", headers={"Accept": "image/png"})),
    ("conflict", "another external_id", renamed),
    ("label-conflict", "a diagnosis without an impact", diagnosed_without_impacts),
    ("external-id-conflict", "other content", taken),
    ("impact-deleted", "after its deletion", deleted),
    ("precondition-failed", "a stale ETag", lambda api: corrected(api, {"If-Match": '"7"'})),
    ("precondition-required", "no ETag", lambda api: corrected(api, {})),
    (
        "body-too-large",
        "over 8 MiB",
        lambda api: api.post("/v1/score", content=b" " * (8 * 1024 * 1024 + 1), headers=JSON),
    ),
    (
        "body-too-large",
        "over 8 MiB inflated",
        lambda api: api.post(
            "/v1/score", content=zipped(b" " * (8 * 1024 * 1024 + 1)), headers=JSON | {"Content-Encoding": "gzip"}
        ),
    ),
    (
        "import-too-large",
        "a dry run of 1001 impacts",
        lambda api: api.post(
            "/v1/imports?dry_run=true", content=b"{}\n" * 1001, headers={"Content-Type": "application/x-ndjson"}
        ),
    ),
    (
        "unsupported-media-type",
        "text",
        lambda api: api.post("/v1/score", content=SECRET, headers={"Content-Type": "text/plain"}),
    ),
    (
        "unsupported-media-type",
        "HDF5",
        lambda api: api.post(
            "/v1/imports",
            content=b"\x89HDF\r\n\x1a\n" + bytes(64),
            headers={"Content-Type": "application/octet-stream"},
        ),
    ),
    ("invalid-payload", "a list", lambda api: api.post("/v1/score", json=[SECRET])),
    (
        "invalid-payload",
        "an unknown unit",
        lambda api: api.post(
            "/v1/impacts", json=changed(impact_body(), "/kinematics/linear_acceleration/unit", SECRET)
        ),
    ),
    (
        "not-found",
        "an unknown athlete",
        lambda api: api.post("/v1/impacts", json=impact_body(athlete={"id": SECRET})),
    ),
    (
        "invalid-payload",
        "an unknown model",
        lambda api: api.post(f"/v1/impacts/{api.create()['id']}/scores", json={"model": SECRET}),
    ),
    ("invalid-parameter", "a bad limit", lambda api: api.get(f"/v1/impacts?limit={SECRET}")),
    ("invalid-parameter", "a bad If-Match", lambda api: corrected(api, {"If-Match": SECRET})),
    (
        "invalid-parameter",
        "a bad field",
        lambda api: api.post(f"/v1/imports?axes={SECRET}", content=b"a,b", headers={"Content-Type": "text/csv"}),
    ),
    ("invalid-trace", "nothing moves", lambda api: api.post("/v1/impacts", json=impact_body(scale=0.0))),
    (
        "improper-rotation",
        "a mirror",
        lambda api: api.post(
            "/v1/impacts", json=impact_body(kinematics=kinematics(location="sensor", mounting=MOUNTING))
        ),
    ),
    (
        "mounting-missing",
        "an unknown device",
        lambda api: api.post("/v1/impacts", json=impact_body(kinematics=kinematics(location="sensor"))),
    ),
    (
        "operating-point-unreachable",
        "99 %",
        lambda api: api.patch("/v1/settings", json={"operating_points": [{"criterion": "bam", "sensitivity": 0.99}]}),
    ),
    (
        "unreadable-file",
        "columns of nobody",
        lambda api: api.post("/v1/imports", content=f"{SECRET},b\n1,2\n", headers={"Content-Type": "text/csv"}),
    ),
]

ELSEWHERE = {"request-timeout", "too-many-requests", "internal-error", "unavailable"}
"""Below: these need an application or a client of their own."""
OF_JOBS = {"cohort-changed", "cohort-unfit", "idempotency-conflict", "job-cancelled", "job-crashed"}
"""What becomes of a job: held by the tests of jobs."""


@pytest.mark.parametrize(("slug", "way"), [(slug, way) for slug, _, way in WAYS], ids=[f"{s}: {w}" for s, w, _ in WAYS])
def test_each_way_to_fail_answers_its_problem(api: Api, slug: str, way: Way) -> None:
    answer = way(api)
    assert_problem(answer, slug)
    assert SECRET not in answer.text


def test_every_problem_type_is_walked() -> None:
    assert {slug for slug, _, _ in WAYS} | ELSEWHERE | OF_JOBS == set(PROBLEMS)


def assert_problem(answer: httpx.Response, slug: str) -> dict[str, Any]:
    problem: dict[str, Any] = answer.json()
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.headers["x-request-id"]
    assert problem["type"] == f"/problems/{slug}", answer.text
    assert problem["title"] == PROBLEMS[slug].title
    assert problem["status"] == answer.status_code == PROBLEMS[slug].status
    assert problem["detail"]
    assert len(problem.get("errors", ())) <= MAX_ERRORS
    for error in problem.get("errors", ()):
        assert {"detail", "code"} <= set(error) <= {"detail", "code", "pointer", "parameter"}
        assert {"pointer", "parameter"} & set(error)
    if answer.status_code == 422:
        assert problem["errors"]
    return problem


class TestMethods:
    @pytest.mark.parametrize(
        ("path", "allowed"),
        [
            ("/v1/score", {"POST"}),
            ("/v1/impacts", {"GET", "HEAD", "POST"}),
            ("/v1/impacts/imp_x", {"GET", "HEAD", "PUT", "DELETE"}),
            ("/v1/athletes/ath_x", {"GET", "HEAD", "PATCH", "DELETE"}),
            ("/v1/devices/mg-1", {"GET", "HEAD", "PUT"}),
            ("/livez", {"GET", "HEAD"}),
        ],
    )
    def test_a_405_names_every_method_that_the_path_takes(self, api: Api, path: str, allowed: set[str]) -> None:
        for method in {"HEAD", "OPTIONS", "TRACE", "GET", "POST", "PUT", "PATCH", "DELETE", "BREW"} - allowed:
            answer = api.send(method, path, key=None)
            assert answer.status_code == 405, method
            assert set(answer.headers["allow"].split(", ")) == allowed


class TestFaultsOfOurOwn:
    def test_a_500_says_an_id_and_nothing_else(
        self, api: Api, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
    ) -> None:
        def fail(*_: object) -> None:
            raise RuntimeError(SECRET)

        monkeypatch.setattr("headimpact_service.routes.scorer.score_record", fail)
        with caplog.at_level(logging.ERROR):
            answer = api.post("/v1/score", json={"kinematics": kinematics()}, headers={"X-Request-Id": "req-7"})
        assert_problem(answer, "internal-error")
        assert "req-7" in answer.json()["detail"]
        assert SECRET not in answer.text
        assert [record.request_id for record in caplog.records] == ["req-7"]  # type: ignore[attr-defined]  # set by our log filter

    @pytest.mark.backend("sqlite")
    def test_without_its_database_the_service_is_503_and_says_when_to_come_back(
        self, api: Api, tmp_path: Path, database: Database
    ) -> None:
        database.close()
        shutil.rmtree(tmp_path)
        self.assert_unavailable(api)

    @pytest.mark.backend("postgresql")
    def test_without_its_server_the_service_is_503_and_says_when_to_come_back(
        self, api: Api, database_url: str, postgresql_server: Server
    ) -> None:
        postgresql_server.drop(database_url)
        self.assert_unavailable(api)
        assert_problem(api.post("/v1/impacts", json=impact_body("e-1")), "unavailable")

    def assert_unavailable(self, api: Api) -> None:
        for answer in (api.get("/readyz"), api.get("/v1/impacts")):
            assert_problem(answer, "unavailable")
            assert int(answer.headers["retry-after"]) > 0
        assert api.get("/livez").status_code == 200

    def test_no_write_is_taken_once_the_service_is_stopping(self, api: Api, database: Database) -> None:
        api.create()
        database.close()
        assert_problem(api.post("/v1/impacts", json=impact_body("e-2")), "unavailable")


class TestLimits:
    def test_a_configured_rate_is_429_with_the_seconds_to_wait(
        self, portal: BlockingPortal, database: Database, make_key: Callable[..., str]
    ) -> None:
        limited = Api(portal, create_app(Settings(rate_limit=3), database), make_key())
        statuses = [limited.get("/v1/me").status_code for _ in range(7)]
        # the minute may turn once on the way
        assert statuses.count(200) in {3, 6, 7}
        last = next(answer for answer in (limited.get("/v1/me") for _ in range(5)) if answer.status_code == 429)
        assert_problem(last, "too-many-requests")
        assert 0 < int(last.headers["retry-after"]) <= 60

    def test_without_one_there_is_no_limit(self, api: Api) -> None:
        assert {api.get("/v1/me").status_code for _ in range(50)} == {200}

    def test_a_client_that_stops_sending_is_408(
        self, portal: BlockingPortal, database: Database, make_key: Callable[..., str]
    ) -> None:
        app = create_app(Settings(body_timeout_s=0.05), database)
        key = make_key()

        async def stalled() -> list[dict[str, Any]]:
            async def receive() -> Any:
                if not begun:
                    begun.append(True)
                    return {"type": "http.request", "body": b'{"kinematics"', "more_body": True}
                return await asyncio.Event().wait()

            async def send(message: Any) -> None:
                sent.append(message)

            begun: list[bool] = []
            sent: list[dict[str, Any]] = []
            headers = [(b"authorization", f"Bearer {key}".encode()), (b"content-type", b"application/json")]
            scope = {"type": "http", "method": "POST", "path": "/v1/score", "query_string": b"", "headers": headers}
            await app(scope, receive, send)
            return sent

        start, body = portal.call(stalled)
        headers = {name.decode(): value.decode() for name, value in start["headers"]}
        assert_problem(httpx.Response(start["status"], headers=headers, content=body["body"]), "request-timeout")
        assert json.loads(body["body"])["status"] == 408
        assert headers["connection"] == "close"


def test_a_signal_that_breaks_several_rules_names_them_all(api: Api) -> None:
    broken = signal("g", (50, 10, 10)) | {"unit": "N", "sample_rate_hz": 1, "w": []}
    answer = api.post("/v1/score", json={"kinematics": {"linear_acceleration": broken}, "colour": 1})
    assert len(assert_problem(answer, "invalid-payload")["errors"]) == 4
