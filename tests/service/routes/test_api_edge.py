"""The edge: request ids, headers, health, pages."""

from __future__ import annotations

import asyncio
import json
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from sending import Api

from headimpact_service.errors import PROBLEMS
from headimpact_service.middleware import Edge
from headimpact_service.pages.docs import ASSETS
from headimpact_service.store.uploads import Uploads


class TestRequestId:
    def test_a_usable_one_is_echoed(self, api: Api) -> None:
        assert api.get("/livez", headers={"X-Request-Id": "a-1:b/c"}).headers["x-request-id"] == "a-1:b/c"

    @pytest.mark.parametrize("sent", ["", "with space", "x" * 129, "é", "a\tb"])
    def test_another_is_replaced(self, api: Api, sent: str) -> None:
        made = api.get("/livez", headers={"X-Request-Id": sent.encode("latin-1")}).headers["x-request-id"]
        assert re.fullmatch("[0-9a-f]{24}", made)

    def test_each_request_gets_its_own(self, api: Api) -> None:
        assert len({api.get("/livez").headers["x-request-id"] for _ in range(20)}) == 20


class TestHealth:
    def test_neither_needs_a_key(self, api: Api) -> None:
        assert api.get("/livez", key=None).json() == {"status": "ok"}
        assert api.get("/readyz", key=None).json()["status"] == "ok"

    @pytest.mark.backend("sqlite")
    def test_an_old_sqlite_is_a_warning_and_stays_200(self, api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("sqlite3.sqlite_version_info", (3, 40, 1))
        answer = api.get("/readyz")
        assert (answer.status_code, len(answer.json()["warnings"])) == (200, 1)
        monkeypatch.setattr("sqlite3.sqlite_version_info", (3, 51, 3))
        assert api.get("/readyz").json()["warnings"] == []

    @pytest.mark.backend("postgresql")
    def test_a_server_that_does_not_wait_for_its_disk_is_warned_of(self, api: Api) -> None:
        answer = api.get("/readyz")
        assert answer.status_code == 200
        assert any("fsync" in warning for warning in answer.json()["warnings"])

    def test_a_folder_of_uploads_that_is_none_is_a_warning_503_and_a_line_in_the_log(
        self, api: Api, tmp_path: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        (tmp_path / "file").touch()
        api.app.state.uploads = Uploads(tmp_path / "file" / "uploads")
        assert "The folder of uploads cannot be used: Not a directory." in api.get("/readyz").json()["warnings"]
        answer = api.post(
            "/v1/imports", content=b"t_s,ax_g\n", headers={"Content-Type": "text/csv", "Prefer": "respond-async"}
        )
        assert (answer.status_code, answer.json()["type"]) == (503, "/problems/unavailable")
        assert int(answer.headers["retry-after"]) > 0
        [line] = [record for record in caplog.records if record.message == "unavailable"]
        assert line.__dict__["cause"] == "NotADirectoryError: Not a directory"


class TestPages:
    def test_the_documentation_asks_no_other_host_for_anything(self, api: Api) -> None:
        page = api.get("/docs", key=None)
        assert page.status_code == 200
        assert "default-src 'none'" in page.headers["content-security-policy"]
        sources = re.findall(r'(?:src|href)="([^"]+)"', page.text)
        assert sources
        for source in sources:
            assert "//" not in source
            assert api.get(f"/{source}", key=None).status_code == 200
        assert not re.search(r"<script(?![^>]*src=)", page.text)
        assert "style=" not in page.text

    @pytest.mark.parametrize("name", ASSETS)
    def test_every_asset_is_in_the_package_with_its_type(self, api: Api, name: str) -> None:
        answer = api.get(f"/assets/{name}", key=None)
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith(ASSETS[name])
        assert answer.headers["x-content-type-options"] == "nosniff"

    def test_no_asset_is_there_that_is_not_served(self) -> None:
        folder = files("headimpact_service.pages").joinpath("assets")
        assert {entry.name for entry in folder.iterdir()} == set(ASSETS)

    @pytest.mark.parametrize("name", ["..%2fhtml.py", "%2e%2e%2fhtml.py", "docs.js%00", "html.py", ""])
    def test_nothing_else_of_the_package_can_be_read(self, api: Api, name: str) -> None:
        assert api.get(f"/assets/{name}", key=None).status_code == 404

    def test_the_root_leads_to_the_documentation(self, api: Api) -> None:
        assert api.get("/", key=None).headers["location"] == "docs"

    @pytest.mark.parametrize("slug", PROBLEMS)
    def test_every_problem_has_its_page_for_people_and_programs(self, api: Api, slug: str) -> None:
        page = api.get(f"/problems/{slug}", key=None, headers={"Accept": "text/html"})
        assert page.headers["content-type"] == "text/html; charset=utf-8"
        assert f"/problems/{slug}" in page.text
        assert api.get(f"/problems/{slug}", key=None).json()["status"] == PROBLEMS[slug].status

    def test_the_list_of_problems_links_to_each(self, api: Api) -> None:
        page = api.get("/problems", key=None, headers={"Accept": "text/html"}).text
        assert re.findall(r'href="problems/([a-z-]+)"', page) == list(PROBLEMS)


def test_answers_about_people_are_not_for_caches(api: Api) -> None:
    assert api.get("/v1/me").headers["cache-control"] == "no-store"
    assert api.get("/v1/nothing").headers["cache-control"] == "no-store"


def test_a_request_that_the_server_cuts_off_is_answered_as_one_that_may_be_sent_again() -> None:
    """As a server does that is told to stop, once it has waited for what is under way."""
    sent: list[Any] = []

    async def stalled(*_: Any) -> None:
        await asyncio.sleep(60)

    async def keep(message: Any) -> None:
        sent.append(message)

    async def cut_off() -> None:
        scope = {"type": "http", "method": "POST", "path": "/v1/score", "headers": [], "query_string": b""}
        request = asyncio.ensure_future(Edge(stalled)(scope, stalled, keep))
        await asyncio.sleep(0)
        request.cancel()
        await request

    asyncio.run(cut_off())
    start, body = sent
    headers = dict(start["headers"])
    assert start["status"] == 503
    assert headers[b"content-type"] == b"application/problem+json"
    assert {b"retry-after", b"x-request-id"} <= headers.keys()
    assert json.loads(body["body"])["detail"] == "The service is shutting down."
