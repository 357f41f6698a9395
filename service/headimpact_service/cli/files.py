"""The files that paths of a command line name, and folders that stand for one file."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

SET_MARKS = ("*.ev5", "*.mme")
"""What makes a folder one set of channels: a laboratory's file that describes the others."""

_BESIDE = (
    "*readme*",
    "*license*",
    "*licence*",
    "notice*",
    "changelog*",
    "citation*",
    "*.md",
    "*.pdf",
    "*.html",
    "*.docx",
)
"""What lies beside recordings in a folder and is for people."""


def files_of(path: Path) -> Iterator[tuple[Path, bytes | Path]]:
    """A file; a folder of one laboratory set as the zip it would be sent as; any other folder file by file."""
    if not path.is_dir():
        yield path, path
    elif is_set(path):
        yield path, zipped(path)
    else:
        for inside in _inside(path):
            if not is_beside(inside):
                yield from files_of(inside)


def texts_beside(path: Path) -> Iterator[Path]:
    """The files within a folder that are for people, which are passed over."""
    if path.is_dir() and not is_set(path):
        for inside in _inside(path):
            if is_beside(inside):
                yield inside
            else:
                yield from texts_beside(inside)


def _inside(folder: Path) -> list[Path]:
    return sorted(inside for inside in folder.iterdir() if not inside.name.startswith("."))


def is_beside(file: Path) -> bool:
    """Whether a file's name says that it is a text for people."""
    return not file.is_dir() and any(fnmatch(file.name.lower(), pattern) for pattern in _BESIDE)


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
