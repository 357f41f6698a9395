"""Zip archives from strangers: bombs, paths, links, and whatever else the directory can hold."""

from __future__ import annotations

import io
import struct
import tracemalloc
import warnings
import zipfile
from collections.abc import Callable
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ingest_files import refused, zipped

from headimpact_service.errors import Problem
from headimpact_service.ingest import zip_guard
from headimpact_service.ingest.zip_guard import GuardedZip


def detail_of(data: bytes) -> str:
    with pytest.raises(Problem) as caught:
        GuardedZip(data)
    assert caught.value.slug == "unreadable-file"
    return caught.value.detail


def edited(change: Callable[[zipfile.ZipInfo], None], content: bytes = b"content") -> bytes:
    buffer = io.BytesIO()
    entry = zipfile.ZipInfo("a.EV5")
    change(entry)
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(entry, content)
    return buffer.getvalue()


def test_files_are_named_in_their_order_and_read():
    archive = GuardedZip(zipped({"b/one.txt": "1", "a.txt": "22", "folder/": ""}))
    assert archive.names == ["b/one.txt", "a.txt"]
    assert archive.read("a.txt") == b"22"


@pytest.mark.parametrize("name", ["../a.EV5", "a/../../b", "/etc/passwd", "C:\\a", "..\\..\\a", "a/b/..", "C:a"])
def test_a_path_that_leads_out_is_refused(name: str):
    assert "leads out" in detail_of(zipped({name: "x"}))


@pytest.mark.parametrize("name", ["MG1-1-2026-11-20T10:05:06Z.csv", "Test 12:30/test.mme", "Spiel 1: Köln/a.csv"])
def test_a_colon_within_a_name_leads_nowhere(name: str):
    assert GuardedZip(zipped({name: "x"})).read(name) == b"x"


def test_an_entry_without_a_name_is_refused():
    data = bytearray(zipped({"a": "x"}))
    directory = data.index(b"PK\x01\x02")
    data[directory + 28 : directory + 30] = b"\0\0"  # the length of its name, which then counts as a comment
    data[directory + 32 : directory + 34] = b"\1\0"
    assert "has a name" in detail_of(bytes(data))


def test_a_link_is_refused():
    def link(entry: zipfile.ZipInfo) -> None:
        entry.external_attr = 0o120777 << 16

    assert "links" in detail_of(edited(link, b"/etc/passwd"))


def test_an_encrypted_entry_is_refused():
    data = bytearray(zipped({"a.EV5": "x"}))
    data[data.index(b"PK\x01\x02") + 8] |= 1
    assert "Encrypted" in detail_of(bytes(data))


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_other_methods_are_refused(method: int):
    assert "stored or deflated" in detail_of(zipped({"a.EV5": "x" * 1000}, method))


def test_too_many_entries_are_refused_without_parsing_the_directory():
    many = zipped({f"{i}": "" for i in range(10_000)}, zipfile.ZIP_STORED)
    tracemalloc.start()
    assert "4096 entries" in detail_of(many)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2_000_000


def test_a_directory_that_understates_its_entries_is_counted():
    data = bytearray(zipped({f"{i}": "" for i in range(5000)}, zipfile.ZIP_STORED))
    place = data.rindex(b"PK\x05\x06")
    struct.pack_into("<HH", data, place + 8, 1, 1)
    assert "4096 entries" in detail_of(bytes(data))


def test_a_bomb_is_refused_by_its_ratio_before_it_inflates():
    bomb = zipped({"a.EV5": b"\0" * 20_000_000})
    assert len(bomb) < 30_000
    tracemalloc.start()
    assert "200 times" in detail_of(bomb)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1_000_000


def test_an_entry_and_the_whole_are_bounded(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(zip_guard, "MAX_ENTRY", 1000)
    assert "1000 bytes" in detail_of(zipped({"a": "x" * 1001}))
    monkeypatch.setattr(zip_guard, "MAX_TOTAL", 1500)
    assert "1500 bytes" in detail_of(zipped({"a": "x" * 800, "b": "x" * 800}))


def test_reading_spends_a_budget(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(zip_guard, "MAX_READ", 1500)
    archive = GuardedZip(zipped({"a": "x" * 800, "b": "x" * 800}))
    archive.read("a")
    with pytest.raises(Problem, match="1500 bytes"):
        archive.read("b")


def test_a_size_that_lies_does_not_inflate_beyond_it():
    data = bytearray(zipped({"a.EV5": b"\0" * 20_000_000}))
    struct.pack_into("<I", data, data.index(b"PK\x01\x02") + 24, 100)
    archive = GuardedZip(bytes(data))
    tracemalloc.start()
    with pytest.raises(Problem, match="broken"):
        archive.read("a.EV5")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5_000_000


def test_a_name_twice_is_refused():
    buffer = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w") as archive:
        warnings.simplefilter("ignore")
        archive.writestr("a.EV5", "1")
        archive.writestr("a.EV5", "2")
    assert "each name once" in detail_of(buffer.getvalue())


def test_a_broken_entry_is_refused_when_it_is_read():
    data = bytearray(zipped({"a.EV5": "x" * 1000}, zipfile.ZIP_STORED))
    data[200] ^= 1
    with pytest.raises(Problem, match="broken"):
        GuardedZip(bytes(data)).read("a.EV5")


@pytest.mark.parametrize("data", [b"PK\x03\x04", b"PK\x03\x04" + b"\0" * 100, zipped({"a.EV5": "x"})[:-30]])
def test_a_torn_archive_is_refused(data: bytes):
    assert "broken" in refused(data).detail


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 400), st.integers(0, 255)), max_size=6), st.integers(0, 400))
def test_any_damage_is_read_or_refused(changes: list[tuple[int, int]], cut: int):
    data = bytearray(zipped({"a.EV5": "----- INSTRUMENTATION -----\n" * 20, "a.001": "0 1\n" * 50}))
    for place, value in changes:
        data[place % len(data)] = value
    torn = bytes(data[: len(data) - cut % len(data)]) if cut % 3 == 0 else bytes(data)
    with suppress(Problem):
        archive = GuardedZip(torn)
        for name in archive.names:
            archive.read(name)
