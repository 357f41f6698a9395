"""One command from an empty folder to a service that answers, and what it survives."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest
from running import Service
from sending import impact_body


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    running = Service(tmp_path)
    yield running
    if running.process.poll() is None:
        running.stop()


@pytest.fixture(scope="module")
def impatient(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """One service for all stalling clients: a start costs seconds."""
    timeouts = {"HEADIMPACT_HEAD_TIMEOUT_S": "0.5", "HEADIMPACT_BODY_TIMEOUT_S": "0.5"}
    running = Service(tmp_path_factory.mktemp("impatient"), timeouts)
    yield running
    running.stop()


def test_head_is_answered_as_get_is_without_the_body(impatient: Service) -> None:
    with impatient.client(impatient.key) as client:
        for path in ("/livez", "/v1/impacts", "/openapi.json"):
            got, head = client.get(path), client.head(path)
            assert (head.status_code, head.content) == (200, b"")
            assert head.headers["content-type"] == got.headers["content-type"]


class TestFirstStart:
    def test_the_printed_example_works_when_pasted_in_any_folder(self, service: Service, tmp_path: Path) -> None:
        assert "Research use only" in service.printed
        found = re.search(r"^curl .*$", service.printed, re.MULTILINE)
        assert found
        elsewhere = tmp_path / "elsewhere"
        elsewhere.mkdir()
        for status in ("201", "200"):
            pasted = found[0] + " -w '\\n%{http_code}'"
            answer = subprocess.run(["sh"], input=pasted, cwd=elsewhere, capture_output=True, text=True, check=True)
            assert answer.stdout.rpartition("\n")[2] == status, answer.stdout
        with service.client(service.key) as client:
            impact = client.get("/v1/impacts").json()["data"][0]
        assert impact["external_id"] == "first-impact"
        assert impact["score"]["quality"] == []

    def test_a_port_that_is_taken_is_one_line_and_leaves_nothing_behind(self, tmp_path: Path) -> None:
        with socket.socket() as other:
            other.bind(("127.0.0.1", 0))
            other.listen()
            command = [sys.executable, "-m", "headimpact_service", "serve", "--port", str(other.getsockname()[1])]
            ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert ended.returncode == 2
        assert len(ended.stderr.splitlines()) == 1
        assert list(tmp_path.iterdir()) == []


class TestStalledClients:
    def test_a_head_that_does_not_come_closes_the_connection(self, impatient: Service) -> None:
        for begun in (b"", b"GET /livez HTTP/1.1\r\nHost: x\r\n"):
            with socket.create_connection(("127.0.0.1", impatient.port), timeout=10) as connection:
                connection.sendall(begun)
                assert connection.recv(1000) == b""

    def test_a_body_that_stops_is_408(self, impatient: Service) -> None:
        head = (
            f"POST /v1/score HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {impatient.key}\r\n"
            'Content-Type: application/json\r\nContent-Length: 1000\r\n\r\n{"kinematics"'
        )
        with socket.create_connection(("127.0.0.1", impatient.port), timeout=10) as connection:
            connection.sendall(head.encode())
            answer = received(connection)
        assert answer.startswith(b"HTTP/1.1 408 ")
        assert b"/problems/request-timeout" in answer

    def test_the_rest_of_a_refused_body_is_not_waited_for_for_ever(self, impatient: Service) -> None:
        head = b"POST /v1/score HTTP/1.1\r\nHost: x\r\nContent-Length: 100000\r\n\r\nx"
        with socket.create_connection(("127.0.0.1", impatient.port), timeout=10) as connection:
            connection.sendall(head)
            assert received(connection).startswith(b"HTTP/1.1 401 ")

    def test_what_is_no_http_is_a_problem_too(self, impatient: Service) -> None:
        with socket.create_connection(("127.0.0.1", impatient.port), timeout=10) as connection:
            connection.sendall(b"nonsense\r\n\r\n")
            answer = received(connection)
        assert answer.startswith(b"HTTP/1.1 400 ")
        assert b"application/problem+json" in answer

    @pytest.mark.parametrize(
        ("head", "status"),
        [
            (b"X: " + b"a" * 60_000, b"200"),
            (b"X: " + b"a" * 70_000, b"400"),
            (b"\r\n".join([b"X: a"] * 9_000), b"200"),
            (b"\r\n".join([b"X: a"] * 20_000), b"400"),
        ],
    )
    def test_a_head_has_64_kib_at_most(self, impatient: Service, head: bytes, status: bytes) -> None:
        with socket.create_connection(("127.0.0.1", impatient.port), timeout=10) as connection:
            connection.sendall(b"GET /livez HTTP/1.1\r\nHost: x\r\n" + head + b"\r\nConnection: close\r\n\r\n")
            answer = received(connection)
        assert answer.startswith(b"HTTP/1.1 " + status + b" ")

    @pytest.mark.parametrize(
        "sent",
        [
            b"GET /livez HTTP/1.1\r\nX: " + b"a" * 30_000_000,
            b"GET /livez HTTP/1.1\r\n" + b"X: a\r\n" * 5_000_000,
            b"POST /v1/score HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n" + b"X: a\r\n" * 5_000_000,
        ],
        ids=["one field", "many", "behind a body"],
    )
    def test_a_longer_one_is_not_read_to_its_end(self, impatient: Service, sent: bytes) -> None:
        address = ("127.0.0.1", impatient.port)
        with socket.create_connection(address, timeout=10) as connection, pytest.raises(ConnectionError):
            connection.sendall(sent)
        with impatient.client(impatient.key) as client:
            assert client.get("/livez").status_code == 200

    def test_a_body_that_is_too_large_is_answered_although_it_is_still_being_sent(self, impatient: Service) -> None:
        with impatient.client(impatient.key) as client:
            headers = {"Content-Type": "application/json"}
            for size in (8 * 1024 * 1024 + 1, 40_000_000):
                assert client.post("/v1/score", content=b" " * size, headers=headers).status_code == 413
            assert client.get("/livez").status_code == 200

    @pytest.mark.parametrize("size", [8 * 1024 * 1024 + 1, 40_000_000])
    def test_a_client_that_sends_everything_before_it_listens_hears_413(self, impatient: Service, size: int) -> None:
        head = f"POST /v1/score HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {impatient.key}\r\n"
        head += f"Content-Type: application/json\r\nContent-Length: {size}\r\n\r\n"
        with socket.create_connection(("127.0.0.1", impatient.port), timeout=20) as connection:
            connection.sendall(head.encode() + b" " * size)
            answer = received(connection)
        assert answer.startswith(b"HTTP/1.1 413 ")
        assert b"at most 8388608 bytes" in answer

    @pytest.mark.parametrize("asks", ["", "Expect: 100-continue\r\n"])
    def test_a_body_that_is_far_too_large_is_refused_before_it_is_sent(self, impatient: Service, asks: str) -> None:
        size = 10_000_000 if asks else 2_000_000_000
        head = f"POST /v1/score HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {impatient.key}\r\n{asks}"
        head += f"Content-Type: application/json\r\nContent-Length: {size}\r\n\r\n"
        with socket.create_connection(("127.0.0.1", impatient.port), timeout=20) as connection:
            connection.sendall(head.encode())
            assert received(connection).startswith(b"HTTP/1.1 413 ")


def received(connection: socket.socket) -> bytes:
    """Everything until the other side closes."""
    parts = []
    while part := connection.recv(65536):
        parts.append(part)
    return b"".join(parts)


class Senders:
    """Some clients that send impacts one after another until the service is gone; what was answered 201 is kept."""

    def __init__(self, service: Service, key: str, name: str, count: int, enough: int) -> None:
        self.answered: list[str] = []
        self.lock = threading.Lock()
        self.enough = threading.Event()
        self.enough_count = enough
        self.service, self.key, self.name, self.count = service, key, name, count

    def run(self, sender: int) -> None:
        with self.service.client(self.key) as client:
            for number in range(self.count):
                external_id = f"{self.name}-{sender}-{number}"
                body = impact_body(external_id, scale=1 + number / 1000, athlete={"external_id": f"p-{sender}"})
                try:
                    answer = client.post("/v1/impacts", json=body)
                except httpx.TransportError:
                    return
                if answer.status_code == 201:
                    self.keep(external_id)

    def keep(self, external_id: str) -> None:
        with self.lock:
            self.answered.append(external_id)
            if len(self.answered) >= self.enough_count:
                self.enough.set()


def stored(service: Service, key: str) -> set[str]:
    with service.client(key) as client:
        rows = client.get("/v1/impacts", headers={"Accept": "application/x-ndjson"}).text.splitlines()
    return {re.search(r'"external_id":"([^"]+)"', row)[1] for row in rows}  # type: ignore[index]  # every row has one


def kill_in_the_middle(folder: Path, *, kills: int, each: int) -> int:
    """Kill the service `kills` times in the middle of requests; the number of impacts that it had acknowledged."""
    service = Service(folder)
    key = service.key
    acknowledged: set[str] = set()
    for turn in range(kills):
        senders = Senders(service, key, f"turn{turn}", count=10_000, enough=each)
        with ThreadPoolExecutor(4) as pool:
            running = [pool.submit(senders.run, sender) for sender in range(4)]
            assert senders.enough.wait(120)
            service.kill()
            for sender in running:
                sender.result()
        acknowledged |= set(senders.answered)
        service = Service(folder)
        assert acknowledged <= stored(service, key)
    service.stop()
    return len(acknowledged)


class TestEnds:
    def test_every_201_outlives_a_kill_in_the_middle_of_requests(self, tmp_path: Path) -> None:
        assert kill_in_the_middle(tmp_path, kills=1, each=100) >= 100

    @pytest.mark.campaign
    def test_every_201_outlives_twenty_kills_in_the_middle_of_500_requests(self, tmp_path: Path) -> None:
        assert kill_in_the_middle(tmp_path, kills=20, each=500) >= 10_000

    def test_told_to_stop_it_answers_what_is_under_way_first_and_starts_again_with_its_key(
        self, service: Service, tmp_path: Path
    ) -> None:
        key = service.key
        senders = Senders(service, key, "stop", count=10_000, enough=30)
        with ThreadPoolExecutor(4) as pool:
            running = [pool.submit(senders.run, sender) for sender in range(4)]
            assert senders.enough.wait(60)
            start = time.monotonic()
            service.stop()
            assert time.monotonic() - start < 15
            for sender in running:
                sender.result()
        again = Service(tmp_path)
        try:
            assert set(senders.answered) <= stored(again, key)
            assert "him_live_" not in again.printed
            with again.client(key) as client:
                assert client.get("/v1/me").json()["organisation"] == "default"
        finally:
            again.stop()


def test_the_web_process_loads_nothing_that_only_fits_and_plots_need() -> None:
    code = (
        "import sys, headimpact_service.app, headimpact_service.serving\n"
        "print([name for name in ('statsmodels', 'matplotlib', 'pyarrow', 'pandas') if name in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_help_loads_neither_the_science_nor_the_database() -> None:
    code = (
        "import sys, headimpact_service.__main__\n"
        "print([name for name in ('numpy', 'scipy', 'sqlalchemy', 'pydantic', 'starlette') if name in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_a_table_of_parquet_loads_no_pandas() -> None:
    script = (
        "import sys\n"
        "from headimpact_service.routes.tables import ParquetForm\n"
        "form = ParquetForm(['a', 'b'], {'a': 'number'}, lambda row: row)\n"
        "made = form.encode([(1.0, 'x'), (None, None)]) + form.finish()\n"
        "print(made[:4], 'pyarrow' in sys.modules, 'pandas' in sys.modules)\n"
        "import pandas\n"  # which is there all the same for whoever asks for it
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["b'PAR1'", "True", "False"]
