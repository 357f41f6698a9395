"""Damaged files of every format: what comes out is impacts or problems, soon, and never another exception."""

from __future__ import annotations

import io
import random
import time
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from binary_files import arrow, mat, nested, noise, npz, parquet, structs, wide, xlsx
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ingest_files import GENERIC, body, csv_text, encoded, outcome, six_axis, statuses, zipped
from laboratory import DTS_COLUMNS, dts, iso_mme
from making import nhtsa

MAX_SECONDS = 5.0
STRUCT = structs({"t": np.arange(20.0)[:, None] / 1000, "lin_acc_CG": np.ones((20, 3)), "ang_vel": np.ones((20, 3))})
SHEET = [GENERIC.split(","), *([i / 1000, *row] for i, row in enumerate(six_axis(24).tolist()))]
FILES: dict[str, tuple[bytes, dict[str, Any]]] = {
    "parquet, a row a sample": (parquet(wide(noise(2, 20))), {}),
    "parquet, a row an impact": (parquet(nested(noise(2, 20)), compression="zstd"), {}),
    "parquet, our JSON": (parquet(pa.Table.from_pylist([body()])), {}),
    "arrow file": (arrow(nested(noise(2, 20))), {}),
    "arrow file, compressed": (arrow(wide(noise(2, 20)), compression="lz4"), {}),
    "arrow stream": (arrow(wide(noise(2, 20)), pa.ipc.new_stream), {}),
    "npz": (npz(linear_acceleration=noise(2, 20)[..., :3], linear_acceleration_unit="g", time_ms=np.arange(20.0)), {}),
    "mat": (mat({"impacts": noise(2, 20), "names": "text"}), {"preset": "stanford_mat"}),
    "mat, structs": (mat({"impact": STRUCT}, do_compression=True), {"preset": "stanford_mat"}),
    "xlsx": (xlsx({"Summary": [["a", "b"], [1.0, 2.0]], "event": SHEET}), {}),
    "csv": (csv_text(six_axis(24), before={"external_id": '"a"'}).encode(), {}),
    "csv, decimal commas": (csv_text(six_axis(24), delimiter=";").replace(".", ",").encode(), {}),
    "csv, utf-16": (csv_text(six_axis(24), delimiter="\t").encode("utf-16"), {}),
    "json": (encoded(body()), {}),
    "ndjson": (encoded(body()) + b"\n" + encoded(body(external_id="b")), {}),
    "dts": (dts(DTS_COLUMNS, samples=200, length=60).encode(), {}),
    "iso-mme": (iso_mme(), {}),
    "nhtsa": (nhtsa().data, {}),
}
formats = pytest.mark.parametrize("name", FILES)


def cut(data: bytearray, rng: random.Random) -> None:
    """The end is missing."""
    del data[rng.randrange(len(data)) :]


def flip(data: bytearray, rng: random.Random) -> None:
    """Some bits are others."""
    for _ in range(rng.randint(1, 8)):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def overwrite(data: bytearray, rng: random.Random) -> None:
    """A number is another one, often a very large or a negative one."""
    size = rng.choice((1, 2, 4, 8))
    value = rng.choice(
        (0, 1, 0x7F, 0x80, 0xFF, 2 ** (8 * size - 1), 2 ** (8 * size) - 1, rng.randrange(2 ** (8 * size)))
    )
    place = rng.randrange(len(data))
    data[place : place + size] = (value % 2 ** (8 * size)).to_bytes(size, rng.choice(("little", "big")))


def repeat(data: bytearray, rng: random.Random) -> None:
    """A part stands twice."""
    start = rng.randrange(len(data))
    data[start:start] = data[start : start + rng.randint(1, 200)]


def drop(data: bytearray, rng: random.Random) -> None:
    """A part is missing."""
    start = rng.randrange(len(data))
    del data[start : start + rng.randint(1, 64)]


def swap(data: bytearray, rng: random.Random) -> None:
    """A part comes from another format's file."""
    other = FILES[rng.choice(list(FILES))][0]
    start, source = rng.randrange(len(data)), rng.randrange(len(other))
    data[start : start + 64] = other[source : source + 64]


def punctuate(data: bytearray, rng: random.Random) -> None:
    """What means something to a reader of text stands where it should not."""
    place = rng.randrange(len(data))
    data[place:place] = rng.choice(
        (b",", b";", b"\t", b'"', b"\n", b".", b"\0", b"1,234", b"\x1d", b"\xff\xfe", b"-" * 300)
    )


DAMAGES: tuple[Callable[[bytearray, random.Random], None], ...] = (cut, flip, overwrite, repeat, drop, swap, punctuate)


def damaged(data: bytes, seed: int) -> bytes:
    """The file with one to three damages, the same for the same seed; of a zip archive often one member of it."""
    rng = random.Random(seed)
    if data[:4] == b"PK\3\4" and rng.random() < 0.75:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        name = rng.choice(list(members))
        return zipped(members | {name: _damaged(members[name], rng)})
    return _damaged(data, rng)


def _damaged(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.randint(1, 3)):
        if changed:
            rng.choice(DAMAGES)(changed, rng)
    return bytes(changed)


def require_harmless(name: str, seed: int) -> None:
    """Only impacts and problems of these statuses, in little time."""
    data, options = FILES[name]
    started = time.monotonic()
    assert statuses(outcome(damaged(data, seed), **options)) <= {413, 415, 422}
    assert time.monotonic() - started < MAX_SECONDS


@formats
def test_the_undamaged_file_is_read(name: str):
    data, options = FILES[name]
    found = outcome(data, **options)
    assert found
    assert statuses(found) == set()


@formats
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow], database=None)
@given(seed=st.integers(0, 2**32))
def test_a_damaged_file_is_read_or_refused(name: str, seed: int):
    require_harmless(name, seed)


@pytest.mark.campaign
@formats
def test_campaign_of_damaged_files(name: str):
    for seed in range(5000):
        require_harmless(name, seed)
