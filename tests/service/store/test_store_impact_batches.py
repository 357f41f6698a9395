"""Impacts stored together are what they are when they are stored one after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from hashlib import sha256
from typing import Any

import numpy as np
import pytest

from headimpact_service.errors import Problem
from headimpact_service.store import athletes, devices, impact_batches, impacts, many, organisations
from headimpact_service.store.athletes import AthleteFields
from headimpact_service.store.database import Database
from headimpact_service.store.devices import DeviceFields
from headimpact_service.store.impact_batches import Added, add_many
from headimpact_service.store.impacts import NewImpact

Make = Callable[..., NewImpact]
DAY = datetime(2026, 11, 20, tzinfo=UTC)


def one_by_one(conn: Any, data_set: bytes, news: list[NewImpact]) -> list[Added | Problem]:
    added: list[Added | Problem] = []
    for new in news:
        try:
            outcome = impacts.add(conn, data_set, new, same_event_is_unchanged=True)
        except Problem as problem:
            added.append(problem)
        else:
            added.append(Added(outcome.status, outcome.impact.id, outcome.impact.external_id))
    return added


def told(outcomes: list[Added | Problem]) -> list[tuple[str, str | None]]:
    return [
        (item.slug, item.detail) if isinstance(item, Problem) else (item.status, item.external_id) for item in outcomes
    ]


def kept(database: Database, data_set: bytes) -> list[tuple[Any, ...]]:
    """Every stored impact without what differs from one data set to the next."""
    with database.read() as conn:
        rows = impacts.page(conn, data_set, limit=1000).rows
        of_id = {row.id: (row.external_id, row.input_digest) for row in rows}
        found = [
            (
                str(row.external_id),
                row.athlete_external_id,
                row.device_serial,
                str(row.occurred_at),
                row.input_digest,
                of_id.get(row.duplicate_of),
                row.context,
                row.document,
                [(r.revision, r.content_digest) for r in impacts.revisions(conn, data_set, row.id)],
                impacts.trace(conn, data_set, row.id).signals,  # type: ignore[union-attr]  # a stored impact has one
                row.score.values if row.score else None,
            )
            for row in rows
        ]
    return sorted(found, key=repr)


def some(make_impact: Make, generator: np.random.Generator, count: int) -> list[NewImpact]:
    """Impacts of few names, contents, athletes and days, so that many meet."""

    def pick(*choices: Any) -> Any:
        return choices[int(generator.integers(len(choices)))]

    return [
        make_impact(
            pick("a", "b", "c", *(f"content {number}" for number in generator.integers(1000, size=9))),
            external_id=pick(None, "1", "2", *(f"n-{number}" for number in generator.integers(1000, size=9))),
            athlete_external_id=pick(None, "p-1", "p-2", "merged"),
            athlete_id=pick(*(None for _ in range(9)), b"x" * 16),
            device_serial=pick(None, "mg-1", "mg-2"),
            occurred_at=pick(None, DAY, DAY.replace(hour=3)),
        )
        for _ in range(count)
    ]


@pytest.mark.parametrize("seed", range(8))
def test_together_and_one_by_one_are_the_same(database: Database, make_impact: Make, seed: int) -> None:
    data_sets = []
    for name in ("together", "one by one"):

        def prepare(conn: Any, name: str = name) -> bytes:
            organisation = organisations.ensure(conn, name)
            data_set = organisations.ensure_data_set(conn, organisation.id, "live")
            into = athletes.create(conn, data_set, AthleteFields(external_id="p-1"))
            merged = athletes.create(conn, data_set, AthleteFields(external_id="merged"))
            athletes.merge(conn, data_set, merged.id, into.id)
            return data_set

        data_sets.append(database.write(prepare))
    generator = np.random.default_rng(seed)
    for turn in range(4):
        news = [*some(make_impact, generator, 15), make_impact(f"gone {turn}", external_id=None)]
        together = database.write(lambda conn, news=news: add_many(conn, data_sets[0], news))
        alone = database.write(lambda conn, news=news: one_by_one(conn, data_sets[1], news))
        assert told(together) == told(alone)
        assert kept(database, data_sets[0]) == kept(database, data_sets[1])
        if turn == 1:
            for data_set in data_sets:
                with database.read() as conn:
                    rows = impacts.page(conn, data_set).rows
                named = sorted((row for row in rows if row.external_id), key=lambda row: row.external_id or "")
                unnamed = [row for row in rows if not row.external_id]
                for number, changed in enumerate(named[1:3]):
                    anew = make_impact(f"corrected {number}", external_id=changed.external_id)
                    database.write(lambda conn, d=data_set, i=changed.id, n=anew: impacts.correct(conn, d, i, n))
                for gone in (*named[:1], *unnamed):
                    database.write(lambda conn, d=data_set, i=gone.id: impacts.delete(conn, d, i))
            news = [replace(new, external_id=None) for new in news]
            together = database.write(lambda conn, news=news: add_many(conn, data_sets[0], news))
            alone = database.write(lambda conn, news=news: one_by_one(conn, data_sets[1], news))
            assert told(together) == told(alone)
            assert any(isinstance(item, Problem) and item.slug == "impact-deleted" for item in together)


def test_a_device_that_is_mounted_anew_is_looked_at_one_by_one(
    database: Database, data_set: bytes, make_impact: Make
) -> None:
    mounted = {"external_id": None, "device_serial": "mg-1", "mounted_by_device": True}
    news = [make_impact(f"content {number}", **mounted) for number in range(5)]
    first = database.write(lambda conn: add_many(conn, data_set, news))
    database.write(lambda conn: devices.put(conn, data_set, "mg-1", DeviceFields(maker="M")))
    anew = [replace(new, input_digest=sha256(new.input_digest).digest()) for new in news]
    again = database.write(lambda conn: add_many(conn, data_set, anew))
    assert [(item.status, item.id) for item in again] == [("unchanged", item.id) for item in first]


def test_what_is_stored_together_changes_at_instants_of_its_own(
    database: Database, data_set: bytes, make_impact: Make
) -> None:
    news = [make_impact(f"content {number}", external_id=str(number)) for number in range(50)]
    added = database.write(lambda conn: add_many(conn, data_set, news))
    with database.read() as conn:
        rows = impacts.page(conn, data_set, limit=1000, updated_since=DAY.replace(year=2000)).rows
    assert [row.id for row in rows] == [item.id for item in added if isinstance(item, Added)]
    assert len({row.updated_at for row in rows}) == 50


def test_a_content_that_is_stored_often_hides_no_other(
    database: Database, data_set: bytes, make_impact: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (impact_batches, many):
        monkeypatch.setattr(module, "ASKED_AT_ONCE", 3)
    for number in range(8):
        database.write(lambda conn, n=number: impacts.add(conn, data_set, make_impact("often", external_id=f"o-{n}")))
    first = database.write(lambda conn: impacts.add(conn, data_set, make_impact("rare", external_id="r"))).impact
    news = [make_impact(word, external_id=f"new {word}", occurred_at=DAY) for word in ("often", "rare", "never")]
    database.write(lambda conn: add_many(conn, data_set, news))
    with database.read() as conn:
        found = {row.external_id: row.duplicate_of for row in impacts.page(conn, data_set).rows}
    assert found["new rare"] == first.id
    assert found["new often"] is not None
    assert found["new never"] is None


def test_nothing_is_stored_of_nothing(database: Database, data_set: bytes) -> None:
    assert database.write(lambda conn: add_many(conn, data_set, [])) == []
