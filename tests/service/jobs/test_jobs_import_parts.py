"""Impacts are worked on in parts: many short ones together, few long ones, and none is lost or taken twice."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from headimpact_service.intake import parts as bounds
from headimpact_service.intake.parts import MAX_VALUES, parts
from headimpact_service.jobs.import_compute import compute
from headimpact_service.jobs.import_score import Chunk
from headimpact_service.store.database import Database
from headimpact_service.store.impacts import NewImpact


@given(st.lists(st.integers(0, 2 * MAX_VALUES), max_size=60), st.integers(1, 20))
def test_parts_hold_everything_in_order_within_their_bounds(sizes: list[int], most: int) -> None:
    found = list(parts(sizes, lambda size: size, most))
    assert [size for part in found for size in part] == sizes
    assert all(0 < len(part) <= most for part in found)
    assert all(sum(part) <= MAX_VALUES or len(part) == 1 for part in found)


def test_no_part_is_smaller_than_it_must_be() -> None:
    short = [600] * 450
    assert [len(part) for part in parts(short, lambda size: size, 200)] == [200, 200, 50]
    assert [len(part) for part in parts([75_000] * 7, lambda size: size, 200)] == [2, 2, 2, 1]


def long_records(path: Path, count: int, samples: int) -> None:
    """One impact a line, each with other values."""
    lines = []
    for number in range(count):
        wave = [0.0] * (samples - 8) + [10.0 + number, 30.0, 50.0, 30.0, 10.0, 0.0, 0.0, 0.0]
        signal = {"sample_rate_hz": 10_000, **dict.fromkeys("xyz", wave)}
        kinematics = {"linear_acceleration": {"unit": "g", **signal}, "angular_velocity": {"unit": "rad/s", **signal}}
        lines.append(json.dumps({"external_id": f"e-{number}", "kinematics": kinematics}))
    path.write_text("\n".join(lines))


@pytest.mark.parametrize("first", [0, 1])
def test_an_import_of_long_records_takes_few_at_a_time_and_goes_on_behind_those_that_are_stored(
    database: Database, database_url: str, data_set: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, first: int
) -> None:
    monkeypatch.setattr(bounds, "MAX_VALUES", 20_000)
    long_records(tmp_path / "file", 7, 1500)  # 9000 values each
    arguments: dict[str, Any] = {
        "path": str(tmp_path / "file"),
        "chunk": 200,
        "fields": {},
        "known": {"filename": None, "content_type": "application/x-ndjson"},
        "terms": {"incidence": None, "operating_points": []},
        "total": None,
        "first": first,
        "database_url": database_url,
        "data_set_id": data_set,
        "key_id": None,
    }
    total, *chunks = compute(arguments)
    assert total == 7
    assert all(isinstance(chunk, Chunk) for chunk in chunks)
    shape = [(chunk.number, chunk.first, len(chunk.ready)) for chunk in chunks]
    assert shape == [(0, 0, 2), (1, 2, 2), (2, 4, 2), (3, 6, 1)][first:]
    stored = [item.new for chunk in chunks for item in chunk.ready]
    assert all(isinstance(new, NewImpact) and new.score.state == "scored" for new in stored)
