"""The season of docs/recalibration.md: its requests, in their order, to a running service."""

from __future__ import annotations

import csv
import io
import json
import re
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from running import Service
from sending import half_sine, impact_body

from headimpact_service.store.database import Database
from headimpact_service.store.tables import schedules

PAGE = Path(__file__).parents[3] / "docs" / "recalibration.md"
IMPACTS, ATHLETES = 360, 45
PATIENCE_S = 120.0
BLOCK = re.compile(
    r"```http\n(?P<method>[A-Z]+) (?P<path>\S+)\n(?P<headers>(?:[\w-]+: [^\n]*\n)*)(?:\n(?P<body>.*?))?```", re.DOTALL
)


def season() -> tuple[list[dict[str, Any]], list[bool]]:
    """Impacts of 20 to 60 g, a few larger, as Table 1 of Laksari et al. 2020 has them; who was hurt, by chance."""
    generator = np.random.default_rng(2)
    scales = generator.lognormal(0.0, 0.45, (IMPACTS, 3))
    hurt = generator.random(IMPACTS) < 1 / (1 + np.exp(6.0 - 2.2 * scales.sum(axis=1) / 1.5))
    lines = []
    for number, scale in enumerate(scales):
        signals = {
            name: {"unit": unit, "sample_rate_hz": 1000}
            | {axis: half_sine(peak * s, 32) for axis, peak, s in zip("xyz", peaks, scale, strict=True)}
            for name, unit, peaks in (
                ("linear_acceleration", "g", (25, 15, 10)),
                ("angular_velocity", "rad/s", (8, 12, 6)),
            )
        }
        lines.append(
            {
                "external_id": f"e-{number}",
                "athlete": {"external_id": f"p-{number % ATHLETES}"},
                "occurred_at": "2026-09-12T15:00:00Z",
                "context": {"session_id": f"s-{number}", "sport": "rugby"},
                "kinematics": signals,
            }
        )
    return lines, hurt.tolist()


class Walk:
    """Goes through the page's requests, one by one."""

    def __init__(self, client: httpx.Client, files: dict[str, str]) -> None:
        self._client = client
        self._files = files
        self._blocks = BLOCK.finditer(PAGE.read_text("utf-8"))
        self.names: dict[str, str] = {}

    def next(self, status: int) -> Any:
        """Send the next request; its answer."""
        block = next(self._blocks)
        headers = dict(line.split(": ", 1) for line in block["headers"].splitlines())
        body = (block["body"] or "").strip()
        body = self._files.get(body, body)
        answer = self._client.request(
            block["method"], self._named(block["path"]), headers=headers, content=self._named(body).encode() or None
        )
        assert answer.status_code == status, f"{block['method']} {block['path']}: {answer.text[:500]}"
        return answer.json()

    def ended(self) -> bool:
        """Whether the page has no more."""
        return next(self._blocks, None) is None

    def job(self, job: dict[str, Any]) -> dict[str, Any]:
        """The job once it has ended."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            found = dict(self._client.get(f"/v1/jobs/{job['id']}").json())
            if found["state"] in {"succeeded", "failed", "cancelled"}:
                return found
            time.sleep(0.2)
        raise TimeoutError(job["id"])

    def _named(self, text: str) -> str:
        for name, value in self.names.items():
            text = text.replace(f"{{{name}}}", value)
        return text


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    running = Service(tmp_path)
    yield running
    running.stop()


def monday_comes(folder: Path) -> None:
    """Put the schedule's clock forward instead of waiting."""
    database = Database(f"sqlite:///{folder / 'headimpact.db'}")
    now = datetime.now(UTC)
    database.write(lambda conn: conn.execute(schedules.update().values(next_due=now)))
    database.close()


def test_the_season_of_the_docs_runs_as_it_is_written(service: Service, tmp_path: Path) -> None:
    impacts, hurt = season()
    diagnosed = hurt.index(True)
    table = io.StringIO()
    rows = csv.writer(table)
    rows.writerow(["external_id", "outcome", "basis"])
    for number, concussion in enumerate(hurt):
        if number != diagnosed:
            rows.writerow([f"e-{number}", "concussion" if concussion else "no_concussion", "follow_up"])
    files = {
        "<season.ndjson>": "\n".join(json.dumps(line) for line in impacts),
        "<labels.csv>": table.getvalue(),
        "<impact.json>": json.dumps(impact_body("new", 1.5)),
    }
    with service.client(service.key) as client:
        walk = Walk(client, files)
        imported = walk.next(207)
        assert imported["summary"] == {"created": IMPACTS, "unchanged": 0, "failed": 0}
        first = client.get(f"/v1/impacts/{imported['data'][diagnosed]['id']}").json()
        walk.names |= {"athlete": first["athlete"]["id"], "session": f"s-{diagnosed}"}
        assert walk.next(201)["impact"] == first["id"]
        assert walk.next(207)["summary"] == {"labelled": IMPACTS - 1, "unchanged": 0, "failed": 0}
        assert walk.next(201)["next_due"] > datetime.now(UTC).isoformat()

        monday_comes(tmp_path)
        deadline = time.monotonic() + PATIENCE_S
        while not client.get("/v1/schedules/weekly").json()["last_job"] and time.monotonic() < deadline:
            time.sleep(0.2)
        (listed,) = walk.next(200)["data"]
        done = walk.job(listed)
        assert done["state"] == "succeeded", done
        assert [gate["gate"] for gate in done["result"]["gates"] if not gate["passed"]] == []
        assert done["result"]["promoted"] is False
        walk.names["version"] = done["result"]["version"]
        assert client.get("/v1/models/aliases/candidate").json()["version"] == done["result"]["version"]
        report = walk.next(200)
        assert report["cohort"]["n"] == IMPACTS
        assert report["cohort"]["events"] == sum(hurt)

        assert walk.next(200)["version"] == done["result"]["version"]
        new = walk.next(201)
        assert new["score"]["model"] == done["result"]["version"]
        assert new["score"]["criteria"]["bam"]["probability_interval"] is not None
        rescored = walk.job(walk.next(202))
        assert rescored["result"]["summary"]["scored"] == IMPACTS
        assert client.get(f"/v1/impacts/{first['id']}").json()["score"]["model"] == done["result"]["version"]
        assert walk.next(200)["history"][-1]["version"] == "laksari-2020"
        assert client.post("/v1/impacts", json=impact_body("later", 1.5)).json()["score"]["model"] == "laksari-2020"
        assert len(client.get(f"/v1/impacts/{first['id']}/scores").json()["data"]) == 2
        assert walk.ended()
