"""What the API tests send: whole impacts of our own wave forms, and a client that sends them in process."""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from math import pi, sin
from typing import Any

import httpx
from anyio.from_thread import BlockingPortal
from conforming import assert_conforms
from starlette.applications import Starlette

SAMPLES = 100
ONSET = 10
WIDTH = 12
OCCURRED_AT = "2026-11-20T19:04:05.123Z"


def half_sine(peak: float, samples: int = SAMPLES, onset: int = ONSET, width: int = WIDTH) -> list[float]:
    """One half sine, zero before and after, rounded as a device would send it."""
    inside = range(onset, onset + width + 1)
    return [round(peak * sin(pi * (i - onset) / width), 3) if i in inside else 0.0 for i in range(samples)]


def signal(unit: str, peaks: tuple[float, float, float], rate: float = 1000, samples: int = SAMPLES) -> dict[str, Any]:
    """A three-axis signal of half sines."""
    axes = dict(zip("xyz", (half_sine(peak, samples) for peak in peaks), strict=True))
    return {"unit": unit, "sample_rate_hz": rate, **axes}


def kinematics(scale: float = 1.0, **fields: Any) -> dict[str, Any]:
    """A head impact of about 55 g and 22 rad/s at scale 1."""
    return {
        "axes": "anatomical",
        "location": "head_cg",
        "pre_trigger_ms": ONSET,
        "filter": "paper",
        "linear_acceleration": signal("g", (50 * scale, -20 * scale, 10 * scale)),
        "angular_velocity": signal("rad/s", (5 * scale, 20 * scale, 8 * scale)),
        "angular_acceleration": None,
    } | fields


def score_body(scale: float = 1.0, **fields: Any) -> dict[str, Any]:
    """A body of POST /v1/score."""
    return {"kinematics": kinematics(scale)} | fields


def impact_body(external_id: str | None = None, scale: float = 1.0, **fields: Any) -> dict[str, Any]:
    """A body of POST /v1/impacts."""
    named = {} if external_id is None else {"external_id": external_id}
    athlete = {"athlete": {"external_id": "p-17"}, "occurred_at": OCCURRED_AT}
    return named | athlete | score_body(scale) | fields


def changed(body: Mapping[str, Any], pointer: str, value: Any) -> dict[str, Any]:
    """A copy of a body with the member at a JSON pointer set; `...` removes it."""
    copy: Any = deepcopy(dict(body))
    *way, last = pointer.strip("/").split("/")
    node = copy
    for step in way:
        node = node[int(step)] if isinstance(node, list) else node[step]
    place = int(last) if isinstance(node, list) else last
    if value is ...:
        del node[place]
    else:
        node[place] = value
    return dict(copy)


@dataclass
class Api:
    """A client of the application in this process; `key` goes with every request that names no other."""

    portal: BlockingPortal
    app: Starlette
    key: str | None

    def send(self, method: str, path: str, *, key: str | None = "", **request: Any) -> httpx.Response:
        """One request; `key=None` sends none."""
        used = self.key if key == "" else key
        headers = dict(request.pop("headers", {}) or {})
        if used is not None:
            headers.setdefault("Authorization", f"Bearer {used}")
        answer = self.portal.call(self._send, method, path, headers, request)
        assert_conforms(method, answer.request.url.path, answer)
        return answer

    async def _send(self, method: str, path: str, headers: dict[str, str], request: dict[str, Any]) -> httpx.Response:
        transport = httpx.ASGITransport(self.app)
        async with httpx.AsyncClient(transport=transport, base_url="http://service") as client:
            return await client.request(method, path, headers=headers, **request)

    def get(self, path: str, **request: Any) -> httpx.Response:
        """GET."""
        return self.send("GET", path, **request)

    def post(self, path: str, **request: Any) -> httpx.Response:
        """POST."""
        return self.send("POST", path, **request)

    def put(self, path: str, **request: Any) -> httpx.Response:
        """PUT."""
        return self.send("PUT", path, **request)

    def patch(self, path: str, **request: Any) -> httpx.Response:
        """PATCH."""
        return self.send("PATCH", path, **request)

    def delete(self, path: str, **request: Any) -> httpx.Response:
        """DELETE."""
        return self.send("DELETE", path, **request)

    def create(self, external_id: str | None = None, scale: float = 1.0, **fields: Any) -> dict[str, Any]:
        """A stored impact."""
        answer = self.post("/v1/impacts", json=impact_body(external_id, scale, **fields))
        assert answer.status_code == 201, answer.text
        return dict(answer.json())


def zipped(body: Any) -> bytes:
    """A body as gzip."""
    return gzip.compress(body if isinstance(body, bytes) else json.dumps(body).encode(), mtime=0)
