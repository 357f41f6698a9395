"""Databases built by the real migrations, and impacts to put into them."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from hashlib import sha256
from typing import Any

import numpy as np
import pytest

from headimpact_service.store import keys, traces
from headimpact_service.store.database import Database
from headimpact_service.store.impacts import NewImpact
from headimpact_service.store.keys import KeyRow
from headimpact_service.store.scores import NewScore
from headimpact_service.store.tables import CRITERION_COMPONENTS

Make = Callable[..., NewImpact]


@pytest.fixture
def key(database: Database) -> KeyRow:
    return database.write(lambda conn: keys.create_key(conn, "Club", ["all"], "live", "first"))[0]


@pytest.fixture
def data_set(key: KeyRow) -> bytes:
    return key.data_set_id


@pytest.fixture
def make_score() -> Callable[..., NewScore]:
    return _score


@pytest.fixture
def make_impact() -> Make:
    return _impact


def _score(**changes: Any) -> NewScore:
    members: dict[str, Any] = {
        "state": "scored",
        "model": "laksari-2020",
        "incidence": 0.0055,
        "service_version": "0.1.0",
        "input_digest": sha256(b"input").digest(),
        "values": {
            key: (0.1, 1 / 3, 1e-7) if components == 3 else 139.9 for key, components in CRITERION_COMPONENTS.items()
        },
        "probabilities": {key: number / 17 for number, key in enumerate(CRITERION_COMPONENTS)},
        "brain_angle_resultant": 0.19,
        "linear_acceleration_g": 53.8,
        "angular_velocity_rad_s": 22.1,
        "angular_acceleration_rad_s2": 3612.0,
        "quality_codes": ("record_truncated", "low_sample_rate"),
        "details": {"windows": {"hic15": [77.7, 92.7]}, "reasons": {}},
        "provenance": {"filters": [{"signal": "linear_acceleration", "hz": 300}], "mounting": None},
    }
    return NewScore(**members | changes)


def _impact(content: str = "one", **changes: Any) -> NewImpact:
    """An impact whose content and input are those of a word."""
    wave = np.sin(np.linspace(0, 3, 90)).reshape(30, 3) * len(content)
    members: dict[str, Any] = {
        "content_digest": sha256(b"content" + content.encode()).digest(),
        "input_digest": sha256(b"input" + content.encode()).digest(),
        "document": {"kinematics": {"axes": "anatomical", "note": content}},
        "trace": traces.encode({"linear_acceleration": wave}),
        "external_id": "event-1",
        "athlete_external_id": "p-17",
        "device_serial": "mg-0042",
        "occurred_at": datetime(2026, 11, 20, 19, 4, 5, 123456, tzinfo=UTC),
        "session_id": "g-1",
        "activity": "game",
        "sport": "american_football",
        "position": "LB",
        "context": {"half": 1},
    }
    members |= changes
    return NewImpact(**members | {"score": members.get("score", _score(input_digest=members["input_digest"]))})
