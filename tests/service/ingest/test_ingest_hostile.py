"""Files made to do harm: bombs, links, lies. The answer is 413, 415 or 422, in little memory and little time."""

from __future__ import annotations

import io
import json
import stat
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from binary_files import COLUMNS, SHEET, arrow, mat, npz, parquet, with_part, xlsx
from ingest_files import one

MEBIBYTE = 1024**2
MAX_GROWTH = 150 * MEBIBYTE
MAX_SECONDS = 15.0
"""Wall time on a machine that runs other tests too; alone, the slowest takes 1.5 s."""
SECRET = "planted-outside-7f3a"


def lists(*lengths: int) -> pa.Table:
    """Impacts of so many equal samples in lists."""
    offsets = pa.array(np.concatenate(([0], np.cumsum(lengths))), pa.int32())
    values = pa.ListArray.from_arrays(offsets, pa.array(np.zeros(sum(lengths))))
    return pa.table(dict.fromkeys(("t_ms", *COLUMNS), values))


def long_table(rows: int, names: int) -> bytes:
    """A Parquet file of very many equal rows, a few thousand bytes long."""
    part = rows // 10
    zeros = dict.fromkeys(("t_ms", *COLUMNS), np.zeros(part))
    buffer = io.BytesIO()
    writer: pq.ParquetWriter | None = None
    for number in range(10):
        keys = (np.arange(part) + part * number) * names // rows
        table = pa.table({"external_id": keys, **zeros})
        writer = writer or pq.ParquetWriter(buffer, table.schema, compression="zstd")
        writer.write_table(table)
    assert writer is not None
    writer.close()
    return buffer.getvalue()


def sheet(changed: Callable[[bytes], bytes]) -> bytes:
    rows = [["t (s)", "ax_g", "ay_g", "az_g"], *([i / 1000, 1.0, 2.0, float(i)] for i in range(9))]
    return with_part(xlsx({"a": rows}), SHEET, changed)


def entities(declared: str, used: str) -> bytes:
    document = f'<?xml version="1.0"?><!DOCTYPE worksheet [{declared}]>'
    return sheet(lambda part: document.encode() + part.replace(b"t (s)", f"t (s)&{used};".encode()))


def laughs() -> bytes:
    levels = [f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 10)]
    return entities('<!ENTITY l0 "aaaaaaaaaa">' + "".join(levels), "l9")


def many_arrays() -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        held = io.BytesIO()
        np.save(held, np.zeros((2, 3, 3)))
        for number in range(10_000):
            archive.writestr(f"a{number}.npy", held.getvalue())
    return buffer.getvalue()


def linked(target: str) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        link = zipfile.ZipInfo("linear_acceleration.npy")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(link, target)
    return buffer.getvalue()


def lying_matrix() -> bytes:
    """A matrix whose header says 20 000 000 x 20 000 x 6 and that holds nothing."""
    data = bytearray(mat({"a": np.zeros((3, 4, 6))}))
    place = data.index((3).to_bytes(4, "little") + (4).to_bytes(4, "little") + (6).to_bytes(4, "little"))
    data[place : place + 8] = (20_000_000).to_bytes(4, "little") + (20_000).to_bytes(4, "little")
    return bytes(data)


def deep_cells(depth: int) -> bytes:
    """A cell that holds a cell that holds a cell, so many times."""
    level = struct.Struct("<IIIIIIIIiiII")  # tag, array flags, dimensions, an empty name
    sizes = (left * level.size - 8 for left in range(depth, 0, -1))
    cells = (level.pack(14, size, 6, 8, 1, 0, 5, 8, 1, 1, 1, 0) for size in sizes)
    return mat({"a": np.zeros((1, 1))})[:128] + b"".join(cells)


def hostile(secret: Path) -> Iterator[tuple[str, bytes]]:
    """Names and contents; all but one say their kind by their content."""
    yield "one_impact.parquet", long_table(5_000_000, 1)
    yield "many_impacts.parquet", long_table(1_000_000, 500_000)
    yield "long_list.parquet", parquet(lists(10_000_000), compression="zstd")
    yield "long_records.parquet", parquet(lists(*[20_000] * 500), compression="zstd")
    yield "long_text.parquet", parquet(pa.table({"kinematics_x": ["x" * 1_000_000] * 100, "ax_g": np.zeros(100)}))
    long_names = {"external_id": ["x" * 1_000_000] * 150, **dict.fromkeys(("t_ms", *COLUMNS), np.zeros(150))}
    yield "long_names.parquet", parquet(pa.table(long_names), compression="zstd", use_dictionary=False)
    yield "columns.parquet", parquet(pa.table({f"c{i}": [0.0] for i in range(30_000)}))
    yield "huge_footer.parquet", b"PAR1" + b"\0" * 100 + (2**31 - 1).to_bytes(4, "little") + b"PAR1"
    zeros = pa.table(dict.fromkeys(("t_ms", *COLUMNS[:3]), np.zeros(8_000_000)))
    yield "batch.arrow", arrow(zeros, compression="zstd")
    yield "batch_stream.arrow", arrow(zeros, pa.ipc.new_stream, compression="zstd")
    yield "columns.arrow", arrow(pa.table({f"c{i}": [0.0] for i in range(20_000)}), pa.ipc.new_stream)
    yield "huge_message.arrow", b"\xff\xff\xff\xff" + (2**31 - 1).to_bytes(4, "little") + b"\0" * 100
    yield "zeros.mat", mat({"a": np.zeros((100, 10_000, 6))}, do_compression=True)
    yield "cells.mat", mat({"a": np.full((200_000, 1), 0.5, dtype=object)}, do_compression=True)
    yield "lying.mat", lying_matrix()
    yield "deep.mat", deep_cells(200_000)
    yield "v73.mat", b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n" + str(secret).encode()
    yield "external.h5", b"\x89HDF\r\n\x1a\n" + str(secret).encode()
    yield "far_cell.xlsx", sheet(lambda part: part.replace(b"</row></sheetData>", _FAR))
    yield "spaces.xlsx", sheet(lambda part: part.replace(b"<sheetData>", b" " * 60_000_000 + b"<sheetData>"))
    yield "laughs.xlsx", laughs()
    yield "entity.xlsx", entities(f'<!ENTITY e SYSTEM "file://{secret}">', "e")
    yield (
        "linked_part.xlsx",
        with_part(
            xlsx({"a": [["t (s)", "ax_g"], [1.0, 2.0]]}),
            "xl/_rels/workbook.xml.rels",
            lambda part: part.replace(b"worksheets/sheet1.xml", f"../../../../..{secret}".encode()),
        ),
    )
    yield "zeros.npz", npz(linear_acceleration=np.zeros((50, 20_000, 3)), linear_acceleration_unit="g")
    yield "entries.npz", many_arrays()
    yield "link.npz", linked(str(secret))
    yield "line.csv", b"t_s,ax_g,ay_g,az_g\n" + b"1" * 100_000_000
    yield "columns.csv", b",".join(b"c%d" % i for i in range(1_000_000)) + b"\n"
    yield "nul.csv", b"t_s,ax_g,ay_g,az_g\n" + b"0,1,2,3\n" * 100_000 + b"\0"
    yield "path.csv", f"t_s,ax_g,ay_g,az_g\n{secret},1,2,3\n".encode()


_FAR = b'</row><row r="1048576"><c r="XFD1048576"><v>1</v></c></row></sheetData>'


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """What a process that reads as the service does makes of every hostile file."""
    folder, outside = tmp_path_factory.mktemp("hostile"), tmp_path_factory.mktemp("outside")
    secret = outside / "secret.csv"
    secret.write_text(f"{SECRET},{SECRET}\n")
    for name, data in hostile(secret):
        (folder / name).write_bytes(data)
    command = [sys.executable, str(Path(__file__).with_name("hostile_run.py")), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    assert SECRET not in done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == len(list(folder.iterdir()))
    return {line["file"]: line for line in found}


def test_every_hostile_file_is_refused_by_a_status_of_its_own(answers: dict[str, dict[str, Any]]):
    told = {name: line["what"] for name, line in answers.items()}
    jobs = {name for name, what in told.items() if what == "job"}
    # These are what they say, only long: a job reads them, block by block.
    assert jobs == {"many_impacts.parquet", "long_records.parquet"}
    assert {what.partition(" ")[0] for name, what in told.items() if name not in jobs} == {"413", "415", "422"}


def test_no_hostile_file_takes_150_mebibytes(answers: dict[str, dict[str, Any]]):
    grown = {name: round(line["grown"] / MEBIBYTE) for name, line in answers.items()}
    assert max(grown.values()) < MAX_GROWTH / MEBIBYTE, grown


def test_no_hostile_file_takes_long(answers: dict[str, dict[str, Any]]):
    seconds = {name: line["seconds"] for name, line in answers.items()}
    assert max(seconds.values()) < MAX_SECONDS, seconds


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("columns.parquet", "footer"),
        ("huge_footer.parquet", "footer"),
        ("long_list.parquet", "more memory or time"),
        ("batch.arrow", "more memory or time"),
        ("columns.arrow", "1024 columns"),
        ("zeros.mat", "33554432 bytes"),
        ("v73.mat", "save it with -v7"),
        ("external.h5", "save it with -v7"),
        ("spaces.xlsx", "200 times its size"),
        ("entries.npz", "4096 entries"),
        ("link.npz", "no links"),
        ("line.csv", "262144 bytes"),
        ("columns.csv", "262144 bytes"),
        ("nul.csv", "NUL"),
        ("one_impact.parquet", "belong to one impact"),
    ],
)
def test_the_answer_says_which_bound_was_met(answers: dict[str, dict[str, Any]], name: str, said: str):
    assert said in answers[name]["what"]


def test_a_formula_in_a_name_is_a_name():
    rows = [["=cmd|' /C calc'!A0", float(i), 1.0, 2.0, float(i)] for i in range(9)]
    record = one(xlsx({"a": [["external_id", "t_ms", "ax_g", "ay_g", "az_g"], *rows]}))
    assert record.external_id == "=cmd|' /C calc'!A0"
