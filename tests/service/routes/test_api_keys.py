"""Keys, scopes, /v1/me and /v1/settings."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from sending import Api, score_body

from headimpact_service.app import OPERATIONS
from headimpact_service.deps import ANY, SCOPES
from headimpact_service.operation import PUBLIC


class TestAuthentication:
    @pytest.mark.parametrize(
        "header", [None, "", "Bearer", "Bearer ", "Basic Zm9v", "Bearer him_live_nobody", "bearer\tx", "Bearer \xff"]
    )
    def test_without_a_known_key_it_is_401_and_says_which_scheme(self, api: Api, header: str | None) -> None:
        headers = {} if header is None else {"Authorization": header.encode("latin-1")}
        answer = api.get("/v1/me", key=None, headers=headers)
        assert (answer.status_code, answer.json()["type"]) == (401, "/problems/unauthenticated")
        assert answer.headers["www-authenticate"].startswith("Bearer")

    def test_the_caller_is_asked_for_a_key_before_the_body_is_looked_at(self, api: Api) -> None:
        assert api.post("/v1/score", key=None, content=b"nonsense").status_code == 401

    def test_the_scheme_s_name_is_read_in_any_case(self, api: Api) -> None:
        assert api.get("/v1/me", key=None, headers={"Authorization": f"bearer {api.key}"}).status_code == 200

    def test_every_operation_with_a_scope_refuses_a_key_without_it(
        self, api: Api, make_key: Callable[..., str]
    ) -> None:
        scoped = [op for op in OPERATIONS if op.access not in {PUBLIC, ANY}]
        assert len(scoped) > 20
        for operation in scoped:
            key = make_key(*(scope for scope in SCOPES if scope != operation.access))
            path = operation.path.replace("{serial:path}", "x").replace("{", "").replace("}", "")
            answer = api.send(operation.method, path, key=key)
            assert (answer.status_code, answer.json()["type"]) == (403, "/problems/insufficient-scope"), operation.path
            assert operation.access in answer.json()["detail"]


class TestKeys:
    def test_a_key_is_shown_once_and_listed_without_its_secret(self, api: Api) -> None:
        made = api.post("/v1/keys", json={"name": "gate 7", "scopes": ["score"]})
        assert made.status_code == 201
        key = made.json()["key"]
        assert api.post("/v1/score", key=key, json=score_body()).status_code == 200
        assert api.get("/v1/impacts", key=key).status_code == 403
        listed = api.get("/v1/keys")
        assert key not in listed.text
        assert [row["name"] for row in listed.json()["data"]] == ["gate 7", "key"]

    def test_a_test_key_reaches_neither_live_keys_nor_the_settings(
        self, api: Api, make_key: Callable[..., str]
    ) -> None:
        live = api.post("/v1/keys", json={"scopes": ["score"]}).json()
        test = make_key(*SCOPES, mode="test")
        made = api.post("/v1/keys", key=test, json={"scopes": ["score"]})
        assert (made.status_code, made.json()["mode"]) == (201, "test")
        assert api.post("/v1/keys", key=test, json={"scopes": ["score"], "mode": "live"}).status_code == 403
        assert api.delete(f"/v1/keys/{live['id']}", key=test).status_code == 404
        assert {row["mode"] for row in api.get("/v1/keys", key=test).json()["data"]} == {"test"}
        assert api.send("PATCH", "/v1/settings", key=test, json={"incidence": 0.3}).status_code == 403
        assert api.get("/v1/me", key=live["key"]).status_code == 200

    def test_a_revoked_key_is_refused_at_once(self, api: Api) -> None:
        made = api.post("/v1/keys", json={"scopes": ["score"]}).json()
        assert api.get("/v1/me", key=made["key"]).status_code == 200
        assert api.delete(f"/v1/keys/{made['id']}").status_code == 204
        assert api.get("/v1/me", key=made["key"]).status_code == 401

    def test_another_organisation_s_key_is_404(self, api: Api, make_key: Callable[..., str]) -> None:
        made = api.post("/v1/keys", json={"scopes": ["score"]}).json()
        other = make_key(organisation="other")
        assert api.delete(f"/v1/keys/{made['id']}", key=other).status_code == 404
        assert api.get("/v1/me", key=made["key"]).status_code == 200

    @pytest.mark.parametrize("body", [{}, {"scopes": []}, {"scopes": ["root"]}, {"scopes": ["score"], "mode": "x"}])
    def test_a_key_needs_known_scopes(self, api: Api, body: dict[str, object]) -> None:
        assert api.post("/v1/keys", json=body).status_code == 422

    def test_me_says_whom_the_key_speaks_for(self, api: Api, make_key: Callable[..., str]) -> None:
        answer = api.get("/v1/me", key=make_key("score", organisation="Leinster", mode="test")).json()
        assert (answer["organisation"], answer["mode"], answer["key"]["scopes"]) == ("Leinster", "test", ["score"])


class TestSettings:
    def test_the_default_is_the_published_model_s(self, api: Api) -> None:
        answer = api.get("/v1/settings").json()
        assert answer["incidence"] == 0.0055
        assert answer["operating_points"][0] == {"criterion": "bam", "sensitivity": 0.5}

    def test_an_incidence_shifts_probabilities_and_thresholds_and_not_who_exceeds(self, api: Api) -> None:
        before = api.post("/v1/score", json=score_body(scale=3.0)).json()
        changed = api.patch("/v1/settings", json={"incidence": 0.05})
        assert (changed.status_code, changed.json()["incidence"], changed.headers["etag"]) == (200, 0.05, '"2"')
        after = api.post("/v1/score", json=score_body(scale=3.0)).json()
        assert after["provenance"]["incidence"] == 0.05
        for key, criterion in after["criteria"].items():
            assert criterion["probability"] > before["criteria"][key]["probability"]
        exceeded = [point["exceeded"] for point in before["operating_points"]]
        assert [point["exceeded"] for point in after["operating_points"]] == exceeded

    @pytest.mark.parametrize("incidence", [0.0, 1e-320, 9e-10, 1.0 - 9e-10, 1.0, -0.1])
    def test_an_incidence_at_which_probabilities_would_be_0_or_1_is_422(self, api: Api, incidence: float) -> None:
        answer = api.patch("/v1/settings", json={"incidence": incidence})
        assert (answer.status_code, answer.json()["errors"][0]["pointer"]) == (422, "/incidence")
        assert api.get("/v1/settings").json()["incidence"] == 0.0055

    @pytest.mark.parametrize("incidence", [1e-9, 1.0 - 1e-9])
    @pytest.mark.parametrize("scale", [0.1, 1.0, 3.0, 10.0])
    def test_at_the_last_incidences_the_same_thresholds_are_exceeded(
        self, api: Api, incidence: float, scale: float
    ) -> None:
        before = api.post("/v1/score", json=score_body(scale)).json()["operating_points"]
        assert api.patch("/v1/settings", json={"incidence": incidence}).status_code == 200
        after = api.post("/v1/score", json=score_body(scale)).json()["operating_points"]
        assert [point["exceeded"] for point in after] == [point["exceeded"] for point in before]
        assert all(0.0 < point["threshold"] < 1.0 for point in after)

    def test_operating_points_of_the_organisation_are_answered_by_default(self, api: Api) -> None:
        points = [{"criterion": "hic15", "threshold": 0.01}]
        assert api.patch("/v1/settings", json={"operating_points": points}).json()["operating_points"] == points
        answered = api.post("/v1/score", json=score_body()).json()["operating_points"]
        assert [point["criterion"] for point in answered] == ["hic15"]
        assert api.patch("/v1/settings", json={"incidence": 0.1}).json()["operating_points"] == points
        assert len(api.patch("/v1/settings", json={"operating_points": None}).json()["operating_points"]) == 2

    @pytest.mark.parametrize(
        ("body", "slug", "pointer"),
        [
            ({"incidence": 0}, "invalid-payload", "/incidence"),
            ({"incidence": 1}, "invalid-payload", "/incidence"),
            ({"operating_points": [{"criterion": "bam"}]}, "invalid-payload", "/operating_points/0"),
            (
                {"operating_points": [{"criterion": "hic15", "sensitivity": 0.9}]},
                "operating-point-unreachable",
                "/operating_points/0",
            ),
        ],
    )
    def test_what_the_model_cannot_give_is_refused(
        self, api: Api, body: dict[str, object], slug: str, pointer: str
    ) -> None:
        answer = api.patch("/v1/settings", json=body)
        assert (answer.status_code, answer.json()["type"]) == (422, f"/problems/{slug}")
        assert answer.json()["errors"][0]["pointer"] == pointer

    def test_a_stale_if_match_is_412(self, api: Api) -> None:
        assert api.patch("/v1/settings", json={"incidence": 0.1}, headers={"If-Match": '"5"'}).status_code == 412
