"""Tables longer than a window: read block by block, from memory or from disk, to the same impacts."""

from __future__ import annotations

import codecs
from pathlib import Path

import numpy as np
import pytest
from ingest_files import body, csv_text, encoded, outcome, read, refused, six_axis, zipped

from headimpact_service.errors import Problem
from headimpact_service.ingest import csv_format, text_facts, windows
from headimpact_service.ingest.options import ImportOptions
from headimpact_service.ingest.record import ImpactRecord
from headimpact_service.ingest.source import Source
from headimpact_service.ingest.upload import read_upload, sample_count


def grouped(*names: str) -> str:
    parts = [csv_text(six_axis() * (1 + i), before={"external_id": name}) for i, name in enumerate(names)]
    return parts[0] + "".join(part.split("\n", 1)[1] for part in parts[1:])


def told(items: list[ImpactRecord | Problem]) -> list[tuple[object, ...]]:
    """What matters of each item: name and samples, or the words of its problem."""
    return [
        (item.detail,)
        if isinstance(item, Problem)
        else (item.external_id, *(signal.values.tobytes() for _, signal in item.recording.signals()))
        for item in items
    ]


@pytest.fixture
def small_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(windows, "WINDOW_ROWS", 100)
    monkeypatch.setattr(csv_format, "ROWS_AT_ONCE", 30)


@pytest.mark.usefixtures("small_windows")
def test_windows_make_no_difference(monkeypatch: pytest.MonkeyPatch):
    lines = grouped(*"abcdefgh").splitlines()
    lines[150] = lines[150].rpartition(",")[0] + ",nan"
    text = "\n".join(lines)
    by_window = told(read(text))
    monkeypatch.undo()
    whole = told(read(text))
    assert by_window == whole
    assert len(whole) == 8
    assert "row 121" in str(whole[3])


@pytest.mark.usefixtures("small_windows")
def test_rows_of_one_impact_far_apart_are_refused_as_a_whole():
    lines = grouped(*"abcdefgh").splitlines()
    moved = [*lines[:1], *lines[2:], lines[1]]
    assert "follow each other" in refused_after("\n".join(moved))
    alternating = [lines[0], *(lines[1 + 40 * impact + row] for row in range(40) for impact in range(8))]
    assert "follow each other" in refused_after("\n".join(alternating))


@pytest.mark.usefixtures("small_windows")
def test_one_impact_longer_than_a_window_is_refused():
    assert "100 rows belong to one impact" in refused_after(csv_text(np.ones((300, 6)), before={"external_id": "a"}))


def refused_after(text: str) -> str:
    """The file's problem, whatever came before it."""
    with pytest.raises(Problem) as raised:
        read(text)
    return raised.value.detail


@pytest.mark.parametrize(
    "data",
    [
        grouped("a", "b").encode(),
        encoded([body(external_id="a"), body(external_id="b")]),
        encoded(body(external_id="a")) + b"\n" + encoded(body(external_id="b")) + b"\n",
        codecs.BOM_UTF8 + encoded(body()) + b"\n\n" + encoded(body(external_id="b")),
        zipped({"readme.txt": "nothing"}),
        b"",
        b"PAR1 no",
    ],
)
def test_a_file_on_disk_gives_what_its_bytes_give(data: bytes, tmp_path: Path):
    path = tmp_path / "upload"
    path.write_bytes(data)
    try:
        from_disk = list(read_upload(path, ImportOptions()))
    except Problem as problem:
        from_disk = [problem]
    assert told(from_disk) == told(outcome(data))


def test_a_document_that_is_held_whole_has_a_bound(tmp_path: Path):
    path = tmp_path / "large"
    path.write_bytes(b" " * 1000)
    assert Source(path).read(1000) == b" " * 1000
    with pytest.raises(Problem, match="999 bytes"):
        Source(path).read(999)


def test_the_samples_of_an_impact_are_counted_over_all_its_channels():
    assert [sample_count(item) for item in read(grouped("a", "b"))] == [240, 240]
    assert sample_count(Problem("unreadable-file", "x")) == 0


def test_text_that_is_marked_utf8_and_is_not_is_refused():
    assert "UTF-8" in refused(codecs.BOM_UTF8 + csv_text().encode() + b"\xff").detail


@pytest.mark.parametrize("ending", [b"\n", b"\r", b"\r\n"])
def test_lines_are_measured_across_the_pieces_that_are_read(ending: bytes, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(text_facts, "MAX_LINE", 130)
    text = csv_text(before={"label": "x"}).encode().replace(b"\n", ending)
    assert max(map(len, text.split(ending))) <= 130
    assert len(read(text)) == 1
    assert "at most 130 bytes" in refused(text + b"9" * 131).detail
