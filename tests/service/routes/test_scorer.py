"""Scores of requests that arrive at one moment: together, with the digits and the faults of each alone."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Sequence
from typing import Any

import pytest
from sending import kinematics, score_body, signal

from headimpact_service.errors import Problem
from headimpact_service.ingest.impact_json import ScoreBody
from headimpact_service.ingest.impact_reading import to_record
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.intake.rendering import new_score, score_document
from headimpact_service.intake.scoring import UNKNOWN_DEVICE, DeviceFacts, Scored, Terms, score_record
from headimpact_service.routes import scorer
from headimpact_service.routes.scorer import Scorer

TERMS, RARE = Terms(), Terms(incidence=0.001)


def record(scale: float = 1.0, **fields: Any) -> ImpactRecord:
    return to_record(ScoreBody.model_validate_json(json.dumps(score_body(scale, **fields))))


BEYOND = record(kinematics=kinematics(linear_acceleration=signal("g", (1e6, 0, 0))))
"""Out of any head's range, which its samples say and not its form."""


def document(scored: Scored) -> dict[str, Any]:
    return score_document(new_score(scored))


def score_all(asked: Sequence[tuple[ImpactRecord, Terms]]) -> list[Scored | BaseException]:
    async def run() -> list[Scored | BaseException]:
        one = Scorer()
        tasks = [one.score(record, terms, UNKNOWN_DEVICE) for record, terms in asked]
        return await asyncio.gather(*tasks, return_exceptions=True)

    return asyncio.run(run())


@pytest.fixture
def together(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many records each call had that scored several."""
    sizes: list[int] = []
    whole = scorer.score_records

    def count(records: list[tuple[ImpactRecord, DeviceFacts]], terms: Terms) -> list[Scored | Problem]:
        sizes.append(len(records))
        return whole(records, terms)

    monkeypatch.setattr(scorer, "score_records", count)
    return sizes


class TestScorer:
    def test_scores_what_arrives_in_one_turn_together_with_the_digits_of_each_alone(self, together: list[int]) -> None:
        records = [record(0.5 + 0.1 * number) for number in range(10)]
        found = score_all([(one, TERMS) for one in records])
        assert together == [10]
        for one, scored in zip(records, found, strict=True):
            assert isinstance(scored, Scored)
            assert document(scored) == document(score_record(one, TERMS))

    def test_scores_each_under_its_own_terms(self, together: list[int]) -> None:
        asked = [(record(), TERMS), (record(), RARE), (record(), TERMS), (record(), RARE)]
        found = score_all(asked)
        assert together == [2, 2]
        for (one, terms), scored in zip(asked, found, strict=True):
            assert isinstance(scored, Scored)
            assert document(scored) == document(score_record(one, terms))

    def test_a_fault_is_answered_to_the_one_that_has_it(self, together: list[int]) -> None:
        good = record()
        found = score_all([(good, TERMS), (BEYOND, TERMS), (good, TERMS)])
        assert together == [3]
        assert [type(item) for item in found] == [Scored, Problem, Scored]

    def test_a_failure_of_all_is_answered_to_the_one_that_fails_alone(self, monkeypatch: pytest.MonkeyPatch) -> None:
        broken = record(2.0)

        def fail(*_: object) -> None:
            raise ZeroDivisionError

        def fail_of(one: ImpactRecord, terms: Terms, device: DeviceFacts) -> Scored:
            if one is broken:
                raise ZeroDivisionError
            return score_record(one, terms, device)

        monkeypatch.setattr(scorer, "score_records", fail)
        monkeypatch.setattr(scorer, "score_record", fail_of)
        found = score_all([(record(), TERMS), (broken, TERMS), (record(), TERMS)])
        assert [type(item) for item in found] == [Scored, ZeroDivisionError, Scored]

    def test_what_would_hold_the_loop_is_left_to_its_next_turn(self, together: list[int]) -> None:
        def long() -> ImpactRecord:
            samples = scorer.MANY_SAMPLES // 2
            return record(
                kinematics=kinematics(
                    linear_acceleration=signal("g", (50, 0, 0), samples=samples),
                    angular_velocity=signal("rad/s", (20, 0, 0), samples=samples),
                )
            )

        found = score_all([(long(), TERMS) for _ in range(5)])
        assert together == [2, 2]
        assert all(isinstance(scored, Scored) for scored in found)

    def test_a_request_that_is_gone_takes_nothing_from_the_others(self) -> None:
        async def run() -> list[Scored]:
            one = Scorer()
            tasks = [asyncio.create_task(one.score(record(), TERMS, UNKNOWN_DEVICE)) for _ in range(3)]
            await asyncio.sleep(0)
            tasks[1].cancel()
            with pytest.raises(asyncio.CancelledError):
                await tasks[1]
            return await asyncio.gather(tasks[0], tasks[2])

        assert len(asyncio.run(run())) == 2

    def test_keeps_the_motion_of_a_record_that_asks_for_its_traces(self) -> None:
        found = score_all([(record(), TERMS), (record(include=["traces"]), TERMS)])
        assert isinstance(found[1], Scored)
        assert found[1].preparation is not None
