"""Two processes on one database: what one has changed is what the other stores scores under."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from anyio.from_thread import BlockingPortal
from sending import Api, changed, half_sine, impact_body

from headimpact_service.app import create_app
from headimpact_service.routes import impacts as impact_routes
from headimpact_service.settings import Settings
from headimpact_service.store import keys, organisation_settings
from headimpact_service.store.database import Database

ANY = {"If-Match": "*"}


@pytest.fixture
def other(portal: BlockingPortal, database: Database, settings: Settings, api: Api) -> Api:
    """Another process, with a memory of its own, that has just scored an impact of p-17 by mg-1."""
    process = Api(portal, create_app(settings, database), api.key)
    for name in ("before-1", "before-2"):  # the first makes athlete and device, which the second then remembers
        process.create(name, 0.9, device={"serial": "mg-1"})
    return process


def codes(impact: dict[str, Any]) -> set[str]:
    return {note["code"] for note in impact["score"]["quality"]}


def test_settings_that_another_process_changed_are_those_of_the_next_stored_score(api: Api, other: Api) -> None:
    points = [{"criterion": "bam", "sensitivity": 0.75}]
    assert api.patch("/v1/settings", json={"incidence": 0.04, "operating_points": points}).status_code == 200
    stored = other.create("e-1")
    assert stored["score"]["provenance"]["incidence"] == 0.04
    assert [point["requested"] for point in stored["score"]["operating_points"]] == [{"sensitivity": 0.75}]
    assert other.get(f"/v1/impacts/{stored['id']}").json() == stored
    assert stored["score"] == api.create("e-2")["score"] | {"quality": stored["score"]["quality"]}


def test_a_correction_and_a_score_made_anew_follow_too(api: Api, other: Api) -> None:
    impact = other.create("e-1")
    address = f"/v1/impacts/{impact['id']}"
    api.patch("/v1/settings", json={"incidence": 0.04})
    put = other.put(address, json=impact_body("e-1", 1.2), headers={"If-Match": '"1"'}).json()
    assert (put["revision"], put["score"]["provenance"]["incidence"]) == (2, 0.04)
    api.patch("/v1/settings", json={"incidence": 0.03})
    again = other.post(f"{address}/scores", json={"model": "laksari-2020"}).json()
    assert again["provenance"]["incidence"] == 0.03


def test_an_import_follows_too(api: Api, other: Api) -> None:
    api.patch("/v1/settings", json={"incidence": 0.04})
    row = other.post("/v1/imports", json=impact_body("e-1")).json()["data"][0]
    assert other.get(f"/v1/impacts/{row['id']}").json()["score"]["provenance"]["incidence"] == 0.04


def test_an_athlete_whom_another_process_changed_is_noted_as_they_are_now(api: Api, other: Api) -> None:
    (athlete,) = api.get("/v1/athletes").json()["data"]
    api.patch(f"/v1/athletes/{athlete['id']}", json={"sex": "female"}, headers=ANY)
    for by in ({"external_id": "p-17"}, {"id": athlete["id"]}):
        stored = other.create(f"e-{next(iter(by))}", athlete=by, device={"serial": "mg-1"})
        assert "outside_model_population" in codes(stored)


def test_a_device_whose_range_another_process_changed_is_read_as_it_is_now(api: Api, other: Api) -> None:
    api.put("/v1/devices/mg-1", json={"linear_acceleration_range_g": 40}, headers=ANY)
    clipped = [min(value, 40.0) for value in half_sine(50)]
    body = changed(impact_body("e-1", device={"serial": "mg-1"}), "/kinematics/linear_acceleration/x", clipped)
    assert "saturated" in codes(other.post("/v1/impacts", json=body).json())


def test_an_event_that_is_sent_again_stays_what_it_is(api: Api, other: Api) -> None:
    impact = other.create("e-1")
    api.patch("/v1/settings", json={"incidence": 0.04})
    again = other.post("/v1/impacts", json=impact_body("e-1"))
    assert (again.status_code, again.json()) == (200, impact)


def test_what_changes_at_every_try_is_503_and_stores_nothing(
    api: Api, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    with database.read() as conn:
        key = keys.find_key(conn, api.key or "")
    assert key is not None
    real, incidences = impact_routes.score, iter([0.01 + 0.001 * number for number in range(impact_routes.TRIES)])

    async def scored_before_a_change(*given: Any) -> Any:
        found = await real(*given)
        incidence = next(incidences)
        database.write(
            lambda conn: organisation_settings.put(conn, key.organisation_id, incidence=incidence, operating_points=())
        )
        return found

    monkeypatch.setattr(impact_routes, "score", scored_before_a_change)
    answer = api.post("/v1/impacts", json=impact_body("e-1"))
    assert (answer.status_code, answer.json()["type"]) == (503, "/problems/unavailable")
    assert "retry-after" in answer.headers
    assert list(incidences) == []
    assert api.get("/v1/impacts").json()["data"] == []


def test_what_nobody_changed_is_scored_once(
    other: Api, monkeypatch: pytest.MonkeyPatch, make_key: Callable[..., str]
) -> None:
    scored = []
    real = impact_routes.score

    async def counted(*given: Any) -> Any:
        scored.append(given)
        return await real(*given)

    monkeypatch.setattr(impact_routes, "score", counted)
    athletes = [{"external_id": "p-17"}, {"external_id": "new"}, {"external_id": "new"}, {"external_id": "new"}]
    for number, athlete in enumerate(athletes):
        other.create(f"e-{number}", athlete=athlete, device={"serial": f"mg-{number % 2}"})
    other.post("/v1/impacts", key=make_key(mode="test"), json=impact_body("e-1"))
    assert len(scored) == len(athletes) + 1
