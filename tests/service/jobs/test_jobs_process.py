"""Imports by a real service: killed at any moment, every impact is there once."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest
from importing import Importer, ndjson

COUNT = 2000


@pytest.fixture
def importer(empty_url: str, tmp_path: Path) -> Iterator[Importer]:
    """A service of the test's own, to be killed."""
    importer = Importer(tmp_path, empty_url)
    yield importer
    if importer.service.process.poll() is None:
        importer.service.stop()


@pytest.fixture(scope="session")
def importers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Importer]]:
    """Services that every test leaves alive, by the kind of their database: a start costs seconds."""
    made: dict[str, Importer] = {}
    yield made
    for importer in made.values():
        importer.service.stop()


@pytest.fixture
def served(
    backend: str,
    importers: dict[str, Importer],
    tmp_path_factory: pytest.TempPathFactory,
    request: pytest.FixtureRequest,
) -> Importer:
    """One service on each kind of database for all that leave it alive."""
    if backend not in importers:
        folder = tmp_path_factory.mktemp("served")
        url = f"sqlite:///{folder}/headimpact.db"
        if backend == "postgresql":
            url = request.getfixturevalue("postgresql_server").create()
        importers[backend] = Importer(folder, url)
    return importers[backend]


def assert_whole(importer: Importer, count: int) -> None:
    """The job has ended, every impact is there once, nothing is left behind."""
    job = importer.end()
    assert job["state"] == "succeeded", job["problem"]
    assert job["progress"] == {"done": count, "total": count}
    summary = {"created": count, "unchanged": 0, "failed": 0}
    assert job["result"] == {"summary": summary, "failed": [], "failed_not_shown": 0}
    assert sorted(importer.stored()) == sorted(f"e-{number}" for number in range(count))
    assert importer.uploads() == []


def test_an_import_that_is_killed_at_several_moments_stores_every_impact_once(importer: Importer) -> None:
    data = ndjson(COUNT)
    made = importer.order(data, **{"Idempotency-Key": "k-1"})
    assert made["state"] == "queued"
    for orphan in ("0123456789abcdef.part", "job_01m83javvted48sxhg2mzndhsa"):
        (importer.folder / "uploads" / orphan).write_bytes(b"x")
    importer.again(kill=True)  # before anybody has taken it up
    importer.until(lambda job: job["progress"]["done"] >= 500)
    importer.again(kill=True)  # in its midst
    assert importer.order(data, **{"Idempotency-Key": "k-1"})["id"] == made["id"]
    assert_whole(importer, COUNT)


def test_faulty_impacts_are_counted_and_the_others_stored(served: Importer) -> None:
    lines = ndjson(30, "f").split(b"\n")
    bad = [b'{"external_id": "bad"}', lines[0].replace(b'"g"', b'"furlong"')]
    served.order(b"\n".join([*lines, *bad, lines[1]]))
    job = served.end()
    assert (job["state"], job["problem"]) == ("succeeded", None)
    assert job["result"]["summary"] == {"created": 30, "unchanged": 1, "failed": 2}
    assert [(row["index"], row["external_id"]) for row in job["result"]["failed"]] == [(30, "bad"), (31, "f-0")]
    assert all(row["problem"]["type"] == "/problems/invalid-payload" for row in job["result"]["failed"])


def test_a_file_that_breaks_in_its_midst_stores_nothing_and_its_job_says_why(served: Importer) -> None:
    served.order(b"t,ax,ay,az\n0,1,2,3\n1,2", **{"Content-Type": "text/csv"})
    job = served.end()
    assert (job["state"], job["result"], job["progress"]["done"]) == ("failed", None, 0)
    assert job["problem"]["type"] == "/problems/unreadable-file"
    assert served.uploads() == []


def test_a_cancelled_import_keeps_what_it_stored(served: Importer) -> None:
    served.order(ndjson(COUNT, "c"))
    served.until(lambda job: job["progress"]["done"] >= 500)
    with served.service.client(served.key) as client:
        assert client.delete(f"/v1/jobs/{served.job}").json()["state"] == "cancelling"
    job = served.end()
    assert job["state"] == "cancelled"
    done = job["progress"]["done"]
    assert 500 <= done < COUNT
    assert job["problem"]["detail"] == f"Cancelled after {done} of {COUNT}; what was stored until then stays stored."
    assert job["result"]["summary"]["created"] == done == len(served.stored("c"))
    assert served.uploads() == []


@pytest.mark.campaign
def test_an_import_that_is_killed_twenty_times_stores_every_impact_once(importer: Importer) -> None:
    """Prints the moments, for docs/campaigns.md."""
    random, count = Random(1), 60_000
    importer.order(ndjson(count))
    moments = []
    for number in range(20):
        # One wherever it is, between its start and its first part too; then one once it has got on, or three in a row
        # might meet it at one place, and it would rightly be given up. One in five is in peace.
        enough = moments[-1] + 500 if number % 2 else 0
        job = importer.until(lambda job, enough=enough: job["progress"]["done"] >= enough)
        assert job["finished_at"] is None
        time.sleep(random.uniform(0.0, 0.5 if enough else 8.0))
        importer.again(kill=number % 5 != 4)
        moments.append(importer.look()["progress"]["done"])
    assert_whole(importer, count)
    print(f"20 ends after {moments} of {count} impacts; every one is there once")


@pytest.mark.campaign
def test_another_process_takes_over_from_a_dead_one(importer: Importer) -> None:
    """Prints how long it took, for docs/campaigns.md."""
    importer.order(ndjson(20_000))
    importer.until(lambda job: job["progress"]["done"] >= 500)
    other = importer.start()
    importer.service.kill()
    importer.service, died = other, time.monotonic()
    before = importer.look()
    assert before["finished_at"] is None
    importer.until(lambda job: job["progress"]["done"] > before["progress"]["done"])
    print(f"taken over {time.monotonic() - died:.1f} s after the death")
    assert_whole(importer, 20_000)
