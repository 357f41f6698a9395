"""CPU per request: the running service against a bare FastAPI echo of the same body, in turn in one run.

    uv run python benchmarks/request_cost.py

Both are separate processes on loopback; what is counted is the server process's user and system time, the writer
thread and SQLite included. Complete requests on keep-alive connections: key, checks, filter, score, answer. Measured
with one sender, where every commit is its own, and with eight and thirty-two at once, where those that arrive together
are scored together and share one.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from waves import impact

REQUESTS = 400
ROUNDS = 9


def body(number: int | None) -> bytes:
    """An impact of 100 samples x 6 channels, as a mouthguard's cloud sends it: values to four decimals."""
    motion = impact(7 if number is None else number)

    def signal(unit, values):
        columns = np.round(values, 4).T.tolist()
        return {"unit": unit, "sample_rate_hz": 1000, **dict(zip("xyz", columns, strict=True))}

    sent = {
        "kinematics": {
            "axes": "anatomical",
            "location": "head_cg",
            "linear_acceleration": signal("g", motion.linear_acceleration_g),
            "angular_velocity": signal("rad/s", motion.angular_velocity),
        }
    }
    if number is not None:
        sent |= {
            "external_id": f"mg-0042/{number}",
            "athlete": {"external_id": f"p-{number % 50}"},
            "occurred_at": f"2026-11-20T19:{number // 60 % 60:02}:{number % 60:02}.{number % 1000:03}Z",
            "device": {"serial": f"mg-{number % 50}"},
            "context": {"session_id": "g-2026-11-20", "activity": "game"},
        }
    return json.dumps(sent).encode()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Server:
    """A server process, and keep-alive connections to it, one a sender."""

    def __init__(self, command: list[str], port: int, folder: str) -> None:
        self.output = Path(folder, f"{port}.log")
        environment = {**os.environ, "HEADIMPACT_PORT": str(port), "OMP_NUM_THREADS": "1"}
        with self.output.open("wb") as log:
            self.process = subprocess.Popen(command, cwd=folder, env=environment, stdout=log, stderr=log)
        self.port = port
        self._wait()

    def _wait(self) -> None:
        for _ in range(200):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 1):
                return
            time.sleep(0.1)
        raise SystemExit(self.output.read_text())

    def cpu_seconds(self) -> float:
        return time.clock_gettime(~self.process.pid << 3 | 2)  # the CPU clock of a process, as Linux numbers it

    def cost(self, send: Callable[[http.client.HTTPConnection], None], senders: int) -> float:
        """CPU seconds of one request."""
        before = self.cpu_seconds()
        with ThreadPoolExecutor(senders) as pool:
            list(pool.map(lambda _: self._send(send, REQUESTS // senders), range(senders)))
        # what the writer does after the answer, if anything, is the request's cost too
        time.sleep(0.05)
        return (self.cpu_seconds() - before) / (REQUESTS // senders * senders)

    def _send(self, send: Callable[[http.client.HTTPConnection], None], requests: int) -> None:
        with contextlib.closing(http.client.HTTPConnection("127.0.0.1", self.port)) as connection:
            for _ in range(requests):
                send(connection)


def post(
    connection: http.client.HTTPConnection, path: str, sent: bytes, headers: dict[str, str], expected: int
) -> None:
    connection.request("POST", path, sent, {"Content-Type": "application/json", **headers})
    answer = connection.getresponse()
    content = answer.read()
    if answer.status != expected:
        raise SystemExit(f"{path}: {answer.status} {content[:500]!r}")


@contextlib.contextmanager
def servers(folder: str) -> Iterator[tuple[Server, Server, str]]:
    echo_port, our_port = free_port(), free_port()
    made = subprocess.run(
        [sys.executable, "-m", "headimpact_service", "keys", "create", "--organisation", "bench", "--scope", "all"],
        cwd=folder,
        check=True,
        capture_output=True,
        text=True,
    )
    key = made.stdout.strip().splitlines()[-1]
    started = [
        Server([sys.executable, str(Path(__file__).parent / "echo.py"), str(echo_port)], echo_port, folder),
        Server([sys.executable, "-m", "headimpact_service", "serve"], our_port, folder),
    ]
    try:
        yield started[0], started[1], key
    finally:
        for server in started:
            server.process.terminate()
            server.process.wait()


def measure(senders: int) -> None:
    with tempfile.TemporaryDirectory() as folder, servers(folder) as (echo, ours, key):
        headers = {"Authorization": f"Bearer {key}"}
        # made before anything is timed: eight senders that share a lock to make them would send one by one
        bodies = iter([body(number) for number in range(REQUESTS * (ROUNDS + 1))])
        plain = body(None)

        def store(connection: http.client.HTTPConnection) -> None:
            post(connection, "/v1/impacts", next(bodies), headers, 201)

        ways = {
            "bare FastAPI echo": (echo, lambda c: post(c, "/echo", plain, {}, 200)),
            "POST /v1/score, not stored": (ours, lambda c: post(c, "/v1/score", plain, headers, 200)),
            "POST /v1/impacts, committed": (ours, store),
        }
        costs: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(ROUNDS + 1):
            for name, (server, send) in ways.items():
                costs[name].append(server.cost(send, senders))
    report(costs, senders)


def report(costs: dict[str, list[float]], senders: int) -> None:
    echo_costs = costs["bare FastAPI echo"][1:]
    print(f"\n{senders} sender(s), {REQUESTS} requests a round, {ROUNDS} rounds in turn after one to warm up\n")
    print("| request | CPU, median | ratio to echo, median (range) |")
    print("|---|---|---|")
    for name, found in costs.items():
        ratios = sorted(a / b for a, b in zip(found[1:], echo_costs, strict=True))
        cpu = statistics.median(found[1:]) * 1e6
        print(f"| {name} | {cpu:.0f} us | {statistics.median(ratios):.2f} ({ratios[0]:.2f} to {ratios[-1]:.2f}) |")


if __name__ == "__main__":
    for count in (1, 8, 32):
        measure(count)
