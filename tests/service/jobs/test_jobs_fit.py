"""Fits as jobs: a version from labels, the same as from the export; what allows none; gates, schedules, re-scores."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from cohorts import fill, spring_document
from sending import Api, impact_body

from headimpact.errors import CalibrationError
from headimpact.risk import LAKSARI_2020
from headimpact_service.app import create_app
from headimpact_service.cli import refit as refit_command
from headimpact_service.cli.cohort_table import read_cohort
from headimpact_service.deps import SCOPES
from headimpact_service.intake.cron import next_due
from headimpact_service.intake.scoring import Terms
from headimpact_service.jobs import fit_compute, runs
from headimpact_service.jobs.engine import KINDS
from headimpact_service.jobs.fit import Fit, _register
from headimpact_service.jobs.runs import House
from headimpact_service.routes.fit_shapes import FitBody, stored
from headimpact_service.settings import Settings
from headimpact_service.store import ids, job_runs, jobs, keys, labels, schedules
from headimpact_service.store.database import Database
from headimpact_service.store.labels import NewLabel

QUICK = {"criteria": ["bam", "bric"], "replicas": 20, "seed": 1, "version": "spring"}


@pytest.fixture
def mine(api: Api, database: Database) -> bytes:
    """The data set that the client's key sees."""
    with database.read() as conn:
        found = keys.find_key(conn, api.key or "")
    assert found is not None
    return found.data_set_id


@contextmanager
def inline(task: str, arguments: Any, **_: Any) -> Iterator[Iterator[Any]]:
    """What a child process does, in this one: a start costs seconds, and one test has a child of its own."""
    module, _, name = task.partition(":")
    yield getattr(import_module(module), name)(dict(arguments))


@pytest.fixture
def do(house: House, api: Api, monkeypatch: pytest.MonkeyPatch) -> Callable[..., dict[str, Any]]:
    """Does a job that was ordered, here, and reads it; `in_child` as the service does."""

    def do(job: dict[str, Any], *, in_child: bool = False) -> dict[str, Any]:
        if not in_child:
            monkeypatch.setattr(runs, "computing", inline)
        job_id = ids.decode("job", job["id"])
        assert job_id is not None
        runs.run(house, KINDS, job_id, 1)
        return dict(api.get(f"/v1/jobs/{job['id']}").json())

    return do


Do = Callable[..., dict[str, Any]]


@pytest.fixture(scope="module")
def spring() -> dict[str, Any]:
    """The document of a model that was fitted elsewhere."""
    return spring_document()


def register(api: Api, document: dict[str, Any]) -> None:
    assert api.post("/v1/models", json=document).status_code == 201


def order(api: Api, **fields: Any) -> dict[str, Any]:
    answer = api.post("/v1/models/fits", json=QUICK | fields)
    assert answer.status_code == 202, answer.text
    return dict(answer.json())


class TestFit:
    def test_a_fit_that_is_ordered_again_after_it_ended_is_the_same_job(
        self, api: Api, database: Database, mine: bytes, do: Do
    ) -> None:
        fill(database, mine)
        send = partial(api.post, "/v1/models/fits", json=QUICK)
        job = send(headers={"Idempotency-Key": "k-1"}).json()
        assert do(job)["state"] == "succeeded"
        again = send(headers={"Idempotency-Key": "k-1"})
        assert (again.status_code, again.json()["id"], again.json()["state"]) == (202, job["id"], "succeeded")
        for headers in ({}, {"Idempotency-Key": "k-2"}):
            assert send(headers=headers).status_code == 409

    def test_a_fit_becomes_a_version_with_report_page_and_alias(
        self, api: Api, database: Database, mine: bytes, do: Do
    ) -> None:
        fill(database, mine)
        done = do(order(api), in_child=True)
        assert done["state"] == "succeeded", done
        assert done["result"] == {
            "version": "spring",
            "skipped": None,
            "promoted": False,
            "not_promoted": None,
            "gates": None,
        }
        model = api.get("/v1/models/spring").json()
        assert model["basis"] == "cohort"
        assert model["aliases"] == ["candidate"]
        assert model["job"] == done["id"]
        assert model["cohort"]["n"] == 120
        assert model["metrics"]["bam"]["auc"] > 0.5
        assert len(model["curves"][1]["intervals"]) == 4
        report = api.get("/v1/models/spring/report").json()
        assert report["cohort"]["digest"] == model["cohort"]["digest"]
        page = api.get("/v1/models/spring/report", headers={"accept": "text/html"})
        assert page.headers["content-type"].startswith("text/html")
        assert "Model card" in page.text
        assert api.get("/v1/models/aliases/candidate").json()["version"] == "spring"
        assert api.get("/v1/models/aliases/active").json()["version"] == "laksari-2020"

    @pytest.mark.parametrize(
        ("sampling", "level", "told"),
        [
            ("full_follow_up", "model", "by its own probabilities, at its own incidence of 0.00550"),
            ("case_control", "cohort", "if its incidence is set to the sample's share of concussions"),
        ],
    )
    def test_the_page_says_at_which_level_concussions_are_expected(
        self, api: Api, database: Database, mine: bytes, do: Do, sampling: str, level: str, told: str
    ) -> None:
        fill(database, mine)
        do(order(api, sampling=sampling))
        drift = api.get("/v1/models/spring/report").json()["drift"]
        assert drift["expected_at"]["level"] == level
        page = api.get("/v1/models/spring/report", headers={"accept": "text/html"}).text
        assert told in page

    def test_the_export_fed_to_the_command_line_gives_the_same_model(
        self, api: Api, database: Database, mine: bytes, do: Do, tmp_path: Path
    ) -> None:
        fill(database, mine)
        api.create("unlabelled")
        do(order(api))
        for form, name in (("text/csv", "t.csv"), ("application/vnd.apache.parquet", "t.parquet")):
            (tmp_path / name).write_bytes(api.get("/v1/impacts", headers={"accept": form}).content)
            options = {"criteria": ("bam", "bric"), "replicas": 20, "seed": 1}
            request = refit_command.Request(options, frozenset(), None, None, "laksari-2020", "spring")
            refit_command.run(tmp_path / name, tmp_path / "out", request)
            ours = api.get("/v1/models/spring/report").json()
            theirs = json.loads((tmp_path / "out" / "report.json").read_text())
            for member in ("drift", "gates", "table"):
                ours.pop(member, None), theirs.pop(member, None)
            assert theirs == ours

    def test_unlabelled_withdrawn_and_unverified_impacts_stay_out(
        self, api: Api, database: Database, mine: bytes, do: Do
    ) -> None:
        made = fill(database, mine)
        first = ids.encode("imp", made[0])
        athlete = api.get(f"/v1/impacts/{first}").json()["athlete"]["id"]
        api.patch(f"/v1/athletes/{athlete}", json={"consent": "withdrawn"})
        unsure = {"outcome": "no_concussion", "basis": "video_review", "event": "unverified"}
        api.put(f"/v1/impacts/{ids.encode('imp', made[1])}/label", json=unsure)
        api.create("unlabelled")
        do(order(api))
        table = api.get("/v1/models/spring/report").json()["table"]
        assert table["excluded"] == {"consent_withdrawn": 5, "no_outcome": 1, "unverified": 1}
        do(order(api, version="all", cohort={"include": ["unverified"], "sport": "rugby"}))
        assert api.get("/v1/models/all").json()["cohort"]["n"] == 115

    def test_a_recording_that_came_twice_enters_once_here_and_through_the_export(
        self, api: Api, database: Database, mine: bytes, do: Do, tmp_path: Path
    ) -> None:
        fill(database, mine)
        twice = [self.labelled(api, name, "concussion") for name in ("v1-7", "v2-7")]
        self.labelled(api, "other", "no_concussion", athlete={"external_id": "p-99"})
        do(order(api))
        report = api.get("/v1/models/spring/report").json()
        assert report["cohort"]["n"] == 122
        assert report["table"] == {"rows": 123, "excluded": {"duplicate_content": 1}, "without_athlete": 0}
        (tmp_path / "t.csv").write_bytes(api.get("/v1/impacts", headers={"accept": "text/csv"}).content)
        options = {"criteria": ("bam", "bric"), "replicas": 20, "seed": 1}
        request = refit_command.Request(options, frozenset(), None, None, None, "spring")
        refit_command.run(tmp_path / "t.csv", tmp_path / "out", request)
        theirs = json.loads((tmp_path / "out" / "report.json").read_text())
        assert theirs["cohort"] == report["cohort"]
        assert theirs["table"]["excluded"] == {"duplicate_content": 1}
        api.delete(f"/v1/impacts/{twice[0]}/label")
        do(order(api, version="one"))
        assert api.get("/v1/models/one/report").json()["table"]["excluded"] == {"no_outcome": 1}
        assert api.get("/v1/models/one").json()["cohort"]["n"] == 122

    def labelled(self, api: Api, name: str, outcome: str, **fields: Any) -> str:
        impact = str(api.create(name, **fields)["id"])
        said = {"outcome": outcome, "basis": "follow_up"}
        assert api.put(f"/v1/impacts/{impact}/label", json=said).status_code == 200
        return impact

    def test_a_recording_with_both_outcomes_is_refused_and_named(
        self, api: Api, database: Database, mine: bytes, do: Do, tmp_path: Path
    ) -> None:
        fill(database, mine)
        twice = [self.labelled(api, name, word) for name, word in (("v1-7", "concussion"), ("v2-7", "no_concussion"))]
        done = do(order(api))
        assert (done["state"], done["problem"]["type"]) == ("failed", "/problems/cohort-unfit")
        told = f"{twice[0]} and {twice[1]} are the same recording of one athlete with both outcomes."
        assert told in done["problem"]["detail"]
        (tmp_path / "t.csv").write_bytes(api.get("/v1/impacts", headers={"accept": "text/csv"}).content)
        with pytest.raises(CalibrationError, match="with both outcomes"):
            read_cohort(tmp_path / "t.csv")

    @pytest.mark.parametrize(
        ("cohort", "told"), [({"sport": "chess"}, "has no impacts"), ({"occurred_from": "2030-01-01T00:00:00Z"}, "no")]
    )
    def test_a_cohort_that_allows_no_fit_fails_and_says_what_is_missing(
        self, api: Api, database: Database, mine: bytes, do: Do, cohort: dict[str, Any], told: str
    ) -> None:
        fill(database, mine, 20)
        done = do(order(api, cohort=cohort))
        assert done["state"] == "failed"
        assert done["problem"]["type"] == "/problems/cohort-unfit"
        assert told in done["problem"]["detail"]
        assert api.get("/v1/models/spring").status_code == 404

    def test_no_events_fail_and_say_so(self, api: Api, database: Database, mine: bytes, do: Do) -> None:
        impact = api.create("e-1")["id"]
        api.put(f"/v1/impacts/{impact}/label", json={"outcome": "no_concussion", "basis": "follow_up"})
        done = do(order(api))
        assert "none with a concussion" in done["problem"]["detail"]

    def test_an_impact_that_leaves_the_cohort_while_it_is_fitted_fails_the_job(
        self, api: Api, database: Database, mine: bytes, house: House, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(runs, "computing", inline)
        made = fill(database, mine)
        ordered = order(api)

        def late(self: Fit, work: Any) -> None:
            with work.computing("headimpact_service.jobs.fit_compute:compute", self._arguments(work)) as values:
                for value in values:
                    api.delete(f"/v1/impacts/{ids.encode('imp', made[0])}/label")
                    work.commit(0, 1, lambda conn, value=value: _register(work.job, value, conn))

        monkeypatch.setattr(Fit, "run", late)
        runs.run(house, KINDS, ids.decode("job", ordered["id"]) or b"", 1)
        done = api.get(f"/v1/jobs/{ordered['id']}").json()
        assert done["problem"]["type"] == "/problems/cohort-changed"
        assert "an impact was" in done["problem"]["detail"]
        assert api.get("/v1/models/spring").status_code == 404

    def test_a_range_of_incidences_holds_the_one_that_is_served(self, api: Api) -> None:
        asked = QUICK | {"incidence_range": [0.001, 0.02]}
        assert api.post("/v1/models/fits", json=asked).status_code == 202
        api.patch("/v1/settings", json={"incidence": 0.1})
        refused = api.post("/v1/models/fits", json=asked)
        assert refused.status_code == 422
        assert refused.json()["errors"] == [
            {
                "pointer": "/incidence_range",
                "code": "out-of-range",
                "detail": "The incidence_range must hold the incidence, 0.1: its first number is at most that, its "
                "second at least.",
            }
        ]
        assert api.post("/v1/models/fits", json=asked | {"sampling": "full_follow_up"}).status_code == 202

    def test_one_idempotency_key_makes_one_job(self, api: Api) -> None:
        headers = {"idempotency-key": "monday"}
        first, again = (api.post("/v1/models/fits", json=QUICK, headers=headers).json() for _ in range(2))
        assert first["id"] == again["id"]
        other = api.post("/v1/models/fits", json=QUICK | {"seed": 2}, headers=headers)
        assert other.json()["type"] == "/problems/idempotency-conflict"

    @pytest.mark.parametrize(
        ("fields", "pointer"),
        [
            ({"criteria": ["nonsense"]}, "/criteria/0"),
            ({"criteria": ["bam", "bam"]}, "/criteria"),
            ({"criteria": ["bam+bric", "bric+bam"]}, "/criteria"),
            ({"criteria": []}, "/criteria"),
            ({"incidence": 0}, "/incidence"),
            ({"incidence_range": [0.5, 0.1]}, "/incidence_range"),
            ({"incidence": 0.5, "incidence_range": [0.001, 0.01]}, "/incidence_range"),
            ({"incidence_range": [0.01, 0.02]}, "/incidence_range"),
            ({"cohort": {"occurred_from": "2026-10-01T00:00:00Z", "occurred_to": "2026-09-01T00:00:00Z"}}, "/cohort"),
            ({"replicas": 10001}, "/replicas"),
            ({"folds": 1}, "/folds"),
            ({"seed": -1}, "/seed"),
            ({"version": "a b"}, "/version"),
            ({"cohort": {"occurred_from": "yesterday"}}, "/cohort/occurred_from"),
            ({"cohort": {"mood": "x"}}, "/cohort/mood"),
        ],
    )
    def test_a_fit_that_cannot_be_is_refused(self, api: Api, fields: dict[str, Any], pointer: str) -> None:
        answer = api.post("/v1/models/fits", json=QUICK | fields)
        assert answer.status_code == 422
        assert answer.json()["errors"][0].get("pointer", "") == pointer

    @pytest.mark.parametrize("version", ["laksari-2020", "fits", "aliases", "active", "candidate"])
    def test_a_name_that_is_taken_for_good_is_refused(self, api: Api, version: str) -> None:
        assert api.post("/v1/models/fits", json=QUICK | {"version": version}).status_code == 409


class TestService:
    """The fitted model in service."""

    def promote(self, api: Api, version: str, revision: int) -> Any:
        body = {"version": version, "reason": "Reviewed."}
        headers = {"if-match": f'"{revision}"'}
        return api.put("/v1/models/aliases/active", json=body, headers=headers)

    def test_new_impacts_are_scored_by_the_active_model_and_old_ones_keep_theirs(
        self, api: Api, spring: dict[str, Any]
    ) -> None:
        register(api, spring)
        before = api.create("before", 2.0)
        assert self.promote(api, "spring", 0).status_code == 200
        after = api.create("after", 2.0)
        assert before["score"]["model"] == "laksari-2020"
        assert after["score"]["model"] == "spring"
        bam = after["score"]["criteria"]["bam"]
        low, high = bam["probability_interval"]
        assert low < bam["probability"] < high
        assert bam["value"] == before["score"]["criteria"]["bam"]["value"]
        assert after["score"]["criteria"]["hic15"]["probability"] is None
        assert "no curve" in after["score"]["criteria"]["hic15"]["reason"]
        assert after["score"]["operating_points"][0]["basis"] == "cohort"
        assert api.get(f"/v1/impacts/{before['id']}").json()["score"]["model"] == "laksari-2020"
        assert api.get(f"/v1/impacts/{after['id']}").json()["score"] == after["score"]
        assert api.post("/v1/score", json={"kinematics": impact_body()["kinematics"]}).json()["model"] == "spring"
        assert api.post("/v1/impacts", json=impact_body("before", 2.0)).json()["score"]["model"] == "laksari-2020"

    def test_another_process_stores_scores_of_the_active_model_at_once(
        self, api: Api, database: Database, spring: dict[str, Any]
    ) -> None:
        register(api, spring)
        other = Api(api.portal, create_app(Settings(), database), api.key)
        assert other.create("before")["score"]["model"] == "laksari-2020"
        assert self.promote(api, "spring", 0).status_code == 200
        assert other.create("after")["score"]["model"] == "spring"

    def test_rollback_is_the_same_call_and_the_history_says_why(self, api: Api, spring: dict[str, Any]) -> None:
        register(api, spring)
        self.promote(api, "spring", 0)
        back = self.promote(api, "laksari-2020", 1)
        assert [change["version"] for change in back.json()["history"]] == [
            "laksari-2020",
            "spring",
            "laksari-2020",
        ]
        first, second, _ = back.json()["history"]
        assert (first["revision"], first["created_at"], first["superseded_at"]) == (0, None, second["created_at"])
        assert back.headers["etag"] == '"2"'
        assert api.create("e")["score"]["model"] == "laksari-2020"
        assert self.promote(api, "spring", 1).status_code == 412

    def test_promotion_needs_if_match_a_reason_and_a_version_that_is_there(self, api: Api) -> None:
        address, body = "/v1/models/aliases/active", {"version": "laksari-2020", "reason": "x"}
        assert api.put(address, json=body).status_code == 428
        assert self.promote(api, "nobody", 0).status_code == 404
        assert api.put(address, json={"version": "laksari-2020"}, headers={"if-match": "*"}).status_code == 422
        blank = api.put(address, json=body | {"reason": "  "}, headers={"if-match": "*"})
        assert (blank.status_code, blank.json()["errors"][0]["pointer"]) == (422, "/reason")
        nothing = api.put(address, json={"version": None, "reason": "x"}, headers={"if-match": "*"})
        assert nothing.status_code == 409
        assert api.get("/v1/models/aliases/nonsense").status_code == 404

    def test_a_model_without_the_organisations_operating_point_is_not_promoted(
        self, api: Api, spring: dict[str, Any]
    ) -> None:
        only = {name: {"bric": spring[name]["bric"]} for name in ("curves", "operating_points")}
        register(api, spring | only)
        api.patch("/v1/settings", json={"operating_points": [{"criterion": "bam", "sensitivity": 0.9}]})
        refused = self.promote(api, "spring", 0)
        assert refused.json()["type"] == "/problems/operating-point-unreachable"
        api.patch("/v1/settings", json={"operating_points": None})
        assert self.promote(api, "spring", 0).status_code == 200
        points = api.create("e")["score"]["operating_points"]
        assert [(point["requested"], point["threshold"]) for point in points] == [
            ({"sensitivity": 0.5}, None),
            ({"sensitivity": 0.9}, None),
        ]

    def test_a_default_point_that_another_model_lacks_is_answered_in_its_place_with_the_reason(
        self, api: Api, spring: dict[str, Any], make_key: Callable[..., str]
    ) -> None:
        register(api, spring)
        assert self.promote(api, "spring", 0).status_code == 200
        points = [{"criterion": "bric", "sensitivity": 0.9}, {"criterion": "bam", "sensitivity": 0.9}]
        assert api.patch("/v1/settings", json={"operating_points": points}).status_code == 200
        impact = api.create("e", 2.0)
        sandbox = make_key(mode="test")
        scores = f"/v1/impacts/{impact['id']}/scores"
        stored = api.post("/v1/impacts", key=sandbox, json=impact_body("e", 2.0)).json()
        answers = [
            api.post("/v1/score", key=sandbox, json={"kinematics": impact_body(scale=2.0)["kinematics"]}).json(),
            stored["score"],
            api.post("/v1/impacts", key=sandbox, json=impact_body("e", 2.0)).json()["score"],
            api.get(f"/v1/impacts/{stored['id']}", key=sandbox).json()["score"],
            api.post(scores, json={"model": "laksari-2020"}).json(),
            api.get(scores).json()["data"][1],
        ]
        missing = dict.fromkeys(("threshold_interval", "exceeded", "sensitivity", "specificity", "basis", "threshold"))
        for answer in answers:
            first, second = answer["operating_points"]
            reason = first.pop("reason")
            assert first == missing | {"criterion": "bric", "requested": {"sensitivity": 0.9}}
            assert reason == "Model laksari-2020 has no operating points for bric; ask for a threshold instead."
            assert (second["criterion"], second["exceeded"]) == ("bam", True)
            assert "reason" not in second
        assert [point["basis"] for point in impact["score"]["operating_points"]] == ["cohort", "cohort"]
        asked = api.post(scores, json={"model": "laksari-2020", "operating_points": points})
        assert (asked.status_code, asked.json()["errors"][0]["pointer"]) == (422, "/operating_points/0")

    def test_models_belong_to_their_data_set(
        self, api: Api, spring: dict[str, Any], make_key: Callable[..., str]
    ) -> None:
        register(api, spring)
        for other in (make_key(*SCOPES, organisation="other"), make_key(*SCOPES, mode="test")):
            assert api.get("/v1/models/spring", key=other).status_code == 404
            assert api.get("/v1/models/spring/report", key=other).status_code == 404
            assert api.get("/v1/models/spring/risk-map", key=other).status_code == 404
            body = {"version": "spring", "reason": "x"}
            request = {"json": body, "headers": {"if-match": "*"}, "key": other}
            assert api.put("/v1/models/aliases/active", **request).status_code == 404

    def test_scores_of_another_version_are_made_by_a_job_and_kept_beside(
        self, api: Api, database: Database, mine: bytes, do: Do, spring: dict[str, Any]
    ) -> None:
        made = fill(database, mine)
        register(api, spring)
        ordered = api.post("/v1/models/spring/scores", json={}).json()
        late = api.create("late")
        done = do(ordered)
        assert done["state"] == "succeeded", done
        assert done["progress"] == {"done": 120, "total": 120}
        assert done["result"]["summary"] == {"scored": 120, "unchanged": 0, "changed": 0, "failed": 0}
        first = ids.encode("imp", made[0])
        assert api.get(f"/v1/impacts/{first}").json()["score"]["model"] == "spring"
        scores = api.get(f"/v1/impacts/{first}/scores").json()["data"]
        assert [(score["model"], score["current"]) for score in scores] == [("laksari-2020", False), ("spring", True)]
        assert api.get(f"/v1/impacts/{late['id']}").json()["score"]["model"] == "laksari-2020"
        again = do(api.post("/v1/models/spring/scores", json={"cohort": {"sport": "rugby"}}).json())
        assert again["result"]["summary"]["unchanged"] == 120
        beside = do(api.post("/v1/models/laksari-2020/scores", json={"make_current": False}).json())
        assert beside["result"]["summary"]["unchanged"] == 121
        assert api.get(f"/v1/impacts/{first}").json()["score"]["model"] == "spring"

    def test_a_risk_map_is_numbers_or_a_picture(self, api: Api) -> None:
        found = api.get("/v1/models/laksari-2020/risk-map", params={"criteria": "bam,bric"}).json()
        assert set(found["probabilities"]) == {"bam", "bric"}
        assert len(found["probabilities"]["bam"]) == len(found["amplitudes_rad_s2"])
        picture = api.get("/v1/models/laksari-2020/risk-map", headers={"accept": "image/svg+xml"})
        assert picture.headers["content-type"] == "image/svg+xml"
        assert picture.text.startswith("<svg")
        assert api.get("/v1/models/laksari-2020/risk-map", params={"criteria": "hic15"}).status_code == 422
        assert api.get("/v1/models/laksari-2020/report").status_code == 404


class TestRegistration:
    def test_the_model_of_the_command_line_is_registered_once(
        self, api: Api, database: Database, mine: bytes, tmp_path: Path
    ) -> None:
        fill(database, mine)
        (tmp_path / "t.csv").write_bytes(api.get("/v1/impacts", headers={"accept": "text/csv"}).content)
        request = refit_command.Request({"criteria": ("bam",), "replicas": 0}, frozenset(), None, None, None, "mine-1")
        refit_command.run(tmp_path / "t.csv", tmp_path / "out", request)
        document = json.loads((tmp_path / "out" / "model.json").read_text())
        assert api.post("/v1/models", json=document).status_code == 201
        assert api.post("/v1/models", json=document).status_code == 200
        listed = [model["version"] for model in api.get("/v1/models").json()["data"]]
        assert listed == ["mine-1", "laksari-2020"]
        document["title"] = "Another"
        assert api.post("/v1/models", json=document).status_code == 409
        document["incidence"] = 2
        wrong = api.post("/v1/models", json=document)
        assert wrong.json()["errors"][0]["pointer"] == "/incidence"
        assert api.post("/v1/models", json=document | {"version": "laksari-2020", "incidence": 0.1}).status_code == 409


def meanwhile(monkeypatch: pytest.MonkeyPatch, work: Callable[[], None]) -> None:
    """Have something happen once between a fit and its registration."""
    fitted = fit_compute._fitted

    def late(*given: Any) -> Any:
        found = fitted(*given)
        monkeypatch.setattr(fit_compute, "_fitted", fitted)
        work()
        return found

    monkeypatch.setattr(fit_compute, "_fitted", late)


WEEKLY = {"cron": "30 3 * * 1", "fit": {name: value for name, value in QUICK.items() if name != "version"}}
LENIENT = WEEKLY | {
    "promote": True,
    "gates": {
        "min_events": 5,
        "min_athletes_with_events": 3,
        "max_auc_loss": 1.0,
        "expected_over_observed": [0.01, 100.0],
        "calibration_slope": [-10.0, 10.0],
        "waive_lowering": ["bam"],
        "max_panel_change": 1.0,
    },
}


class TestSchedules:
    def fire(self, database: Database, after: timedelta = timedelta(days=8)) -> list[Any]:
        now = datetime.now(UTC) + after
        return database.write(lambda conn: schedules.fire(conn, now, next_due))

    def test_a_schedule_is_made_read_replaced_and_deleted(self, api: Api) -> None:
        made = api.put("/v1/schedules/weekly", json=WEEKLY | {"time_zone": "Europe/Dublin"})
        assert (made.status_code, made.headers["etag"]) == (201, '"1"')
        assert made.json()["gates"]["min_events"] == 30
        assert made.json()["fit"]["incidence"] == 0.0055
        due = datetime.fromisoformat(made.json()["next_due"])
        assert due.weekday() == 0
        assert api.get("/v1/schedules/weekly").json() == made.json()
        assert api.put("/v1/schedules/weekly", json=WEEKLY | {"time_zone": "Europe/Dublin"}).status_code == 200
        off = api.put("/v1/schedules/weekly", json=WEEKLY | {"enabled": False}, headers={"if-match": '"1"'})
        assert off.json()["next_due"] is None
        assert [one["name"] for one in api.get("/v1/schedules").json()["data"]] == ["weekly"]
        assert api.delete("/v1/schedules/weekly").status_code == 204
        assert api.get("/v1/schedules/weekly").status_code == 404
        assert api.delete("/v1/schedules/weekly").status_code == 404

    @pytest.mark.parametrize(
        ("fields", "pointer"),
        [
            ({"cron": "every monday"}, "/cron"),
            ({"cron": "* * * * * *"}, "/cron"),
            ({"cron": "0 0 30 2 *"}, "/cron"),
            ({"time_zone": "Mars/Olympus"}, "/time_zone"),
            ({"gates": {"min_events": 0}}, "/gates/min_events"),
            ({"fit": {"version": "x"}}, "/fit/version"),
            ({"fit": {"incidence": 0.1, "incidence_range": [0.001, 0.02]}}, "/fit/incidence_range"),
            ({"fit": {"criteria": ["bam"]}, "gates": {"criteria": ["hic15"]}}, "/gates"),
            ({"gates": {"calibration_slope": [2, 1]}}, "/gates/calibration_slope"),
            ({"gates": {"expected_over_observed": [1.25, 0.8]}}, "/gates/expected_over_observed"),
            ({"gates": {"waive_lowering": ["foo.q"]}}, "/gates/waive_lowering/0"),
            ({"gates": {"waive_lowering": ["bam.w"]}}, "/gates/waive_lowering/0"),
            ({"gates": {"waive_lowering": ["hic15+bric.x"]}}, "/gates/waive_lowering/0"),
        ],
    )
    def test_a_schedule_that_cannot_be_is_refused(self, api: Api, fields: dict[str, Any], pointer: str) -> None:
        answer = api.put("/v1/schedules/weekly", json=WEEKLY | fields)
        assert answer.status_code == 422
        assert answer.json()["errors"][0]["pointer"] == pointer

    def test_gates_that_name_no_criterion_judge_what_is_fitted(self, api: Api) -> None:
        for fitted, judged in ((["hic15"], ["hic15"]), (["bam", "bric"], ["bam"]), (None, ["bam"])):
            fit = {} if fitted is None else {"criteria": fitted}
            answer = api.put("/v1/schedules/weekly", json=WEEKLY | {"fit": fit})
            assert answer.json()["gates"]["criteria"] == judged

    def test_promotion_by_itself_needs_the_scope(self, api: Api, make_key: Callable[..., str]) -> None:
        key = make_key("models:fit")
        assert api.put("/v1/schedules/w", json=WEEKLY | {"promote": True}, key=key).status_code == 403
        assert api.put("/v1/schedules/w", json=WEEKLY, key=key).status_code == 201

    def test_two_that_look_at_once_order_one_job(self, api: Api, database: Database) -> None:
        api.put("/v1/schedules/weekly", json=WEEKLY)
        ordered: list[Any] = []
        threads = [threading.Thread(target=lambda: ordered.extend(self.fire(database))) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(ordered) == 1
        assert len(api.get("/v1/jobs", params={"kind": "fit"}).json()["data"]) == 1

    def test_what_was_missed_is_made_up_for_once(self, api: Api, database: Database) -> None:
        api.put("/v1/schedules/weekly", json=WEEKLY)
        assert len(self.fire(database, timedelta(days=100))) == 1
        assert self.fire(database, timedelta(days=100)) == []
        due = datetime.fromisoformat(api.get("/v1/schedules/weekly").json()["next_due"])
        assert due > datetime.now(UTC) + timedelta(days=100)

    def test_it_skips_with_the_reason_where_there_is_nothing_to_learn(
        self, api: Api, database: Database, mine: bytes, do: Do
    ) -> None:
        api.put("/v1/schedules/weekly", json=WEEKLY)

        def fired(days: int) -> dict[str, Any]:
            (job,) = self.fire(database, timedelta(days=days))
            return do({"id": ids.encode("job", job.id)})

        assert "no impacts" in fired(8)["result"]["skipped"]
        made = fill(database, mine)
        second = fired(16)
        version = second["result"]["version"]
        assert version.startswith("fit-")
        assert api.get(f"/v1/models/{version}").json()["schedule"] == "weekly"
        assert "since the last fit" in fired(24)["result"]["skipped"]
        new = NewLabel(outcome="concussion", basis="physician_diagnosis")
        database.write(lambda conn: labels.put(conn, mine, made[0], new))
        assert fired(32)["result"]["version"] not in {None, version}

    def test_gates_hold_a_model_back_or_let_it_through(self, api: Api, database: Database, mine: bytes, do: Do) -> None:
        fill(database, mine, 400, athletes=60)
        api.put("/v1/schedules/strict", json=WEEKLY | {"promote": True, "gates": {"min_events": 10_000}})
        (job,) = self.fire(database)
        held = do({"id": ids.encode("job", job.id)})["result"]
        assert held["promoted"] is False
        failed = [gate for gate in held["gates"] if not gate["passed"]]
        assert failed[0]["gate"] == "events"
        assert "at least 10000 are needed" in failed[0]["detail"]
        assert "did not pass every gate of its schedule (events" in self.page(api, held["version"])
        assert api.get("/v1/models/aliases/active").json()["version"] == "laksari-2020"
        api.delete("/v1/schedules/strict")
        api.put("/v1/schedules/lenient", json=LENIENT)
        (job,) = self.fire(database)
        done = do({"id": ids.encode("job", job.id)})["result"]
        assert [gate["gate"] for gate in done["gates"] if not gate["passed"]] == []
        assert done["promoted"] is True
        active = api.get("/v1/models/aliases/active").json()
        assert active["version"] == done["version"]
        assert "Passed all gates of the schedule lenient" in active["reason"]
        assert "The model passed every gate of its schedule." in self.page(api, done["version"])

    def test_what_a_person_makes_active_while_it_is_fitted_stays_so(
        self, api: Api, database: Database, mine: bytes, do: Do, spring: dict[str, Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        fill(database, mine, 400, athletes=60)
        api.put("/v1/schedules/lenient", json=LENIENT)
        (job,) = self.fire(database)

        def by_hand() -> None:
            register(api, spring)
            change = {"version": "spring", "reason": "By hand."}
            assert api.put("/v1/models/aliases/active", json=change, headers={"if-match": '"0"'}).status_code == 200

        meanwhile(monkeypatch, by_hand)
        done = do({"id": ids.encode("job", job.id)})["result"]
        assert all(gate["passed"] for gate in done["gates"])
        assert done["promoted"] is False
        assert "judged against laksari-2020, but spring is active now" in done["not_promoted"]
        assert api.get("/v1/models/aliases/active").json()["version"] == "spring"
        assert api.get("/v1/models/aliases/candidate").json()["version"] == done["version"]

    def test_a_model_that_lacks_a_point_which_was_set_is_not_promoted_by_its_schedule(
        self, api: Api, database: Database, mine: bytes, do: Do
    ) -> None:
        fill(database, mine, 400, athletes=60)
        only = {"fit": WEEKLY["fit"] | {"criteria": ["bric"]}, "gates": LENIENT["gates"] | {"waive_lowering": ["bric"]}}
        assert api.put("/v1/schedules/lenient", json=LENIENT | only).status_code == 201
        point = {"criterion": "bam", "sensitivity": 0.9}
        assert api.patch("/v1/settings", json={"operating_points": [point]}).status_code == 200
        (job,) = self.fire(database)
        done = do({"id": ids.encode("job", job.id)})["result"]
        assert done["promoted"] is False
        assert all(gate["passed"] for gate in done["gates"])
        assert "bam" in done["not_promoted"]
        assert api.get("/v1/models/aliases/active").json()["version"] == "laksari-2020"

    def test_of_two_jobs_of_a_schedule_that_overlap_one_learns_the_cohort(
        self, api: Api, database: Database, mine: bytes, do: Do, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        fill(database, mine)
        api.put("/v1/schedules/weekly", json=WEEKLY)
        (first,) = self.fire(database, timedelta(days=8))
        (second,) = self.fire(database, timedelta(days=16))
        versions: list[str] = []
        meanwhile(monkeypatch, lambda: versions.append(do({"id": ids.encode("job", second.id)})["result"]["version"]))
        done = do({"id": ids.encode("job", first.id)})["result"]
        assert versions[0].startswith("fit-")
        assert (done["version"], "since the last fit" in done["skipped"]) == (None, True)
        listed = [model["version"] for model in api.get("/v1/models").json()["data"]]
        assert listed == [versions[0], "laksari-2020"]

    @staticmethod
    def page(api: Api, version: str) -> str:
        return api.get(f"/v1/models/{version}/report", headers={"accept": "text/html"}).text

    def test_another_organisation_sees_no_schedule(self, api: Api, make_key: Callable[..., str]) -> None:
        api.put("/v1/schedules/weekly", json=WEEKLY)
        other = make_key(*SCOPES, organisation="other")
        assert api.get("/v1/schedules/weekly", key=other).status_code == 404
        assert api.get("/v1/schedules", key=other).json()["data"] == []
        assert api.delete("/v1/schedules/weekly", key=other).status_code == 404


def test_a_fit_is_for_the_incidence_that_is_served() -> None:
    own = replace(LAKSARI_2020, version="own", incidence=0.02)
    assert stored(FitBody(), Terms())["incidence"] == 0.0055
    assert stored(FitBody(), Terms(model=own))["incidence"] == 0.02
    assert stored(FitBody(), Terms(incidence=0.01, model=own))["incidence"] == 0.01
    assert stored(FitBody(incidence=0.03), Terms(incidence=0.01, model=own))["incidence"] == 0.03


def test_a_job_of_another_version_is_not_forgotten(database: Database, mine: bytes) -> None:
    """Every kind that can be ordered can be run."""
    with database.read() as conn:
        assert job_runs.unfinished(conn) == []
    assert {"import", "fit", "rescore"} == set(KINDS)
    assert {"succeeded", "failed", "cancelled"} == jobs.ENDED
