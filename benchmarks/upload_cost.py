"""CPU of one upload of many impacts against as many requests with one impact each, both stored.

    uv run python benchmarks/upload_cost.py [--impacts 1000] [--rounds 3]

Starts `headimpact serve` in a temporary folder. In each round the same number of new impacts is sent as single requests
and as one upload of each format; CPU is that of the service and of its children, waited for or not.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import httpx
from import_job import CSV_MAPPING, TYPES, kinematics, serving, write_file


def cpu_seconds(pid: int) -> float:
    """Of a process, its children that have ended, and those that live."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    own = sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
    listed = [path.read_text().split() for path in Path(f"/proc/{pid}/task").glob("*/children")]
    return own + sum(cpu_seconds(int(child)) for children in listed for child in children)


def main() -> None:
    """Alternate the ways, and compare their medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--impacts", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, serving(Path(name)) as (address, key, pid):
        client = httpx.Client(base_url=address, headers={"Authorization": f"Bearer {key}"}, timeout=120)
        costs: dict[str, list[float]] = defaultdict(list)

        def spend(way: str, send: Callable[..., None], *what: Any) -> None:
            before = cpu_seconds(pid)
            send(client, options.impacts, *what)
            costs[way].append((cpu_seconds(pid) - before) / options.impacts * 1e3)

        for number in range(-1, options.rounds):
            spend("single requests", single, number)
            for at, kind in enumerate(TYPES, start=1):
                file = Path(name) / f"{number}.{kind}"
                write_file(file, options.impacts, kind, least=1 + 0.00037 * (at + 4 * number + 4))
                spend(kind, upload, file, kind)
            if number < 0:
                costs.clear()  # what is loaded and compiled once
    alone = median(costs["single requests"])
    for way, spent in costs.items():
        print(f"{way:16} {median(spent):7.3f} ms of CPU an impact, {alone / median(spent):5.1f} times cheaper")


def single(client: httpx.Client, impacts: int, turn: int) -> None:
    """One impact a request."""
    for number in range(impacts):
        body: dict[str, Any] = {"external_id": f"s-{turn}-{number}"}
        body["athlete"] = {"external_id": f"p-{number % 40}"}
        client.post("/v1/impacts", json=body | {"kinematics": kinematics(1 + number / impacts)}).raise_for_status()


def upload(client: httpx.Client, impacts: int, file: Path, kind: str) -> None:
    """All in one, under names of their own."""
    mapping = {name: value for name, value in CSV_MAPPING.items() if name != "external_id"}
    params = {} if kind == "ndjson" else {"mapping": json.dumps(mapping)}
    data = file.read_bytes()
    if kind == "ndjson":  # its impacts have names, which are taken once
        data = data.replace(b'"e-', f'"{file.stem}-'.encode())
    answer = client.post("/v1/imports", content=data, headers={"Content-Type": TYPES[kind]}, params=params)
    counts = answer.raise_for_status().json()["summary"]
    assert counts["created"] == impacts, counts


if __name__ == "__main__":
    main()
