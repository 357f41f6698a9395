"""What a file is, told by its content; its name and media type decide only where content cannot."""

from __future__ import annotations

import codecs
from enum import Enum

from headimpact_service.errors import Problem

READ = "CSV (also of DTS), JSON, NDJSON, and ISO-MME and NHTSA crash tests (zip)"


class Kind(Enum):
    """The kinds of file that are told apart."""

    ZIP = "zip"
    JSON = "json"
    NDJSON = "ndjson"
    CSV = "csv"
    PARQUET = "parquet"
    ARROW = "arrow"


_BINARY = {
    b"\x1f\x8b": "gzip",
    b"PAR1": "Parquet",
    b"ARROW1": "Arrow IPC",
    b"MATLAB 5.0": "MATLAB",
    b"\x89HDF\r\n\x1a\n": "HDF5 (MATLAB v7.3)",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook",
    b"\x93NUMPY": "npy",
    b"%PDF": "PDF",
}
_ZIP = (b"PK\x03\x04", b"PK\x05\x06")
HEAD = 64 * 1024
"""The bytes of a file that tell its kind."""
_NDJSON_TYPES = frozenset({"application/x-ndjson", "application/jsonl", "application/ndjson"})
_NDJSON_NAMES = (".ndjson", ".jsonl")


def detect(data: bytes, *, filename: str | None = None, content_type: str | None = None) -> Kind:
    """The kind of a file, by its first bytes.

    Raises
    ------
    Problem
        422 for an empty file; 415 for one of a kind that is not read here, by its name where it is known.
    """
    head = data[:HEAD].removeprefix(codecs.BOM_UTF8).lstrip()
    if not head:
        raise Problem("unreadable-file", "The file is empty.")
    if data.startswith(_ZIP):
        return Kind.ZIP
    _refuse_binary(data)
    if head.startswith((b"{", b"[")):
        return Kind.NDJSON if _is_ndjson(head, filename, content_type) else Kind.JSON
    return Kind.CSV


def _refuse_binary(data: bytes) -> None:
    for magic, name in _BINARY.items():
        if data.startswith(magic):
            raise Problem("unsupported-media-type", f"This file is {name}; files that are read: {READ}.")
    if b"\0" in data[:HEAD]:
        raise Problem("unsupported-media-type", f"The kind of this file is not known; files that are read: {READ}.")


def _is_ndjson(head: bytes, filename: str | None, content_type: str | None) -> bool:
    """Whether the lines are objects: two of them, or one that the sender calls so."""
    if not head.startswith(b"{"):
        return False
    called = (content_type or "").partition(";")[0].strip().lower() in _NDJSON_TYPES
    if called or (filename or "").lower().endswith(_NDJSON_NAMES):
        return True
    first, _, rest = head.partition(b"\n")
    return first.rstrip().endswith(b"}") and rest.lstrip().startswith(b"{")
