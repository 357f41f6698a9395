"""Uploaded files: small ones in memory, large ones in a folder, none left behind."""

from __future__ import annotations

import errno
import os
from hashlib import sha256
from pathlib import Path

import pytest

from headimpact_service.errors import Problem
from headimpact_service.store import disk
from headimpact_service.store.unavailable import reason_of
from headimpact_service.store.uploads import Uploads


@pytest.fixture
def uploads(tmp_path: Path) -> Uploads:
    return Uploads(tmp_path / "uploads")


def test_a_small_file_stays_in_memory_and_nothing_is_made(uploads: Uploads) -> None:
    with uploads.receive(10) as incoming:
        incoming.write(b"01234")
        incoming.write(b"56789")
        assert (incoming.contents(), incoming.is_large) == (b"0123456789", False)
    assert not uploads.folder.exists()


@pytest.mark.parametrize("size", [3, 30])
def test_a_file_that_is_kept_is_there_whole_for_this_user_only(uploads: Uploads, size: int) -> None:
    with uploads.receive(10) as incoming:
        for _ in range(size):
            incoming.write(b"x")
        assert incoming.digest() == sha256(b"x" * size).digest()
        incoming.keep("job_1")
    assert uploads.path("job_1").read_bytes() == b"x" * size
    assert uploads.path("job_1").stat().st_mode & 0o077 == 0
    assert [path.name for path in uploads.folder.iterdir()] == ["job_1"]


def test_a_file_that_is_not_kept_leaves_nothing(uploads: Uploads) -> None:
    with uploads.receive(2) as incoming:
        incoming.write(b"0123456789")
        assert list(uploads.folder.iterdir())
    assert list(uploads.folder.iterdir()) == []


def test_what_lies_there_is_named_and_told_by_its_age(uploads: Uploads) -> None:
    assert uploads.names() == set()
    for name in ("job_1", "job_2"):
        with uploads.receive(0) as incoming:
            incoming.write(b"x")
            incoming.keep(name)
    os.utime(uploads.path("job_2"), (0, 0))
    assert uploads.names() == {"job_1", "job_2"}
    assert uploads.names(older_than_s=3600) == {"job_2"}
    uploads.remove("job_1")
    uploads.remove("job_1")
    assert uploads.names() == {"job_2"}


class TestFull:
    """A folder that cannot be written to, or hardly."""

    def test_a_folder_that_cannot_be_made_is_said_and_keeps_nothing(self, tmp_path: Path) -> None:
        (tmp_path / "file").touch()
        uploads = Uploads(tmp_path / "file" / "uploads")
        assert uploads.warnings() == ["The folder of uploads cannot be used: Not a directory."]
        with uploads.receive(2) as incoming, pytest.raises(Problem) as raised:
            incoming.write(b"0123456789")
        assert (raised.value.slug, raised.value.headers["Retry-After"]) == ("unavailable", "2")
        assert reason_of(raised.value.__cause__) == "NotADirectoryError: Not a directory"

    @pytest.mark.parametrize("length", [5, 20])
    def test_a_disk_that_is_full_is_said_and_leaves_nothing(
        self, uploads: Uploads, length: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def full(handle: int) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr(os, "fsync", full)
        with uploads.receive(10) as incoming:
            incoming.write(b"x" * length)
            with pytest.raises(Problem) as raised:
                incoming.keep("job_1")
        assert raised.value.slug == "unavailable"
        assert uploads.names() == set()

    def test_little_room_is_warned_of(self, uploads: Uploads, monkeypatch: pytest.MonkeyPatch) -> None:
        assert uploads.warnings() == []
        monkeypatch.setattr(disk, "LOW", 1 << 62)
        [warning] = uploads.warnings()
        assert warning.startswith("The disk of uploads has ")
