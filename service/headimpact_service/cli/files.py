"""The files that paths of a command line name, and folders that stand for one file."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path

SET_MARKS = ("*.ev5", "*.mme")
"""What makes a folder one set of channels: a laboratory's file that describes the others."""


def files_of(path: Path) -> Iterator[tuple[Path, bytes | Path]]:
    """A file; a folder of one laboratory set as the zip it would be sent as; any other folder file by file."""
    if not path.is_dir():
        yield path, path
    elif is_set(path):
        yield path, zipped(path)
    else:
        for inside in sorted(path.iterdir()):
            if not inside.name.startswith("."):
                yield from files_of(inside)


def is_set(folder: Path) -> bool:
    """Whether a folder is one laboratory set."""
    return any(file.match(mark) or file.match(mark.upper()) for file in folder.iterdir() for mark in SET_MARKS)


def zipped(folder: Path) -> bytes:
    """A folder as the zip that it would be sent as."""
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file() and not file.is_symlink():
                archive.write(file, file.relative_to(folder))
    return held.getvalue()
