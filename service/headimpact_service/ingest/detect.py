"""What a file is, told by its content; its name and media type decide only where content cannot."""

from __future__ import annotations

import codecs
from enum import Enum

from headimpact_service.errors import Problem
from headimpact_service.ingest.text_facts import UTF_16

READ = (
    "CSV (also of DTS), JSON, NDJSON, Parquet, Arrow IPC, MATLAB (-v7), xlsx, npz, "
    "and folders as zip: ISO-MME and NHTSA crash tests, CSV files"
)


class Kind(Enum):
    """The kinds of file that are told apart."""

    ZIP = "zip"
    JSON = "json"
    NDJSON = "ndjson"
    CSV = "csv"
    PARQUET = "parquet"
    ARROW = "arrow"
    MAT = "mat"


_BINARY = {
    b"\x1f\x8b": ("gzip", "unpack it, or send it alone as the body with Content-Encoding: gzip"),
    b"\xd0\xcf\x11\xe0": ("an old Excel workbook", "save it as xlsx"),
    b"\x93NUMPY": ("npy", "save its array in an npz (numpy.savez)"),
    b"%PDF": ("PDF", "send the table that it was made from"),
}
"""What is known and not read, and what to do."""
_READ_BINARY = {
    b"PAR1": Kind.PARQUET,
    b"ARROW1\0\0": Kind.ARROW,
    b"\xff\xff\xff\xff": Kind.ARROW,  # a stream: the mark before each message
    b"MATLAB 5.0 MAT-file": Kind.MAT,
}
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HDF5_PLACES = (0, 512, 1024, 2048)
_MAT_73 = b"MATLAB 7.3 MAT-file"
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
    if data.startswith(UTF_16):
        _refuse_utf16_json(data)
        return Kind.CSV
    known = next((kind for magic, kind in _READ_BINARY.items() if data.startswith(magic)), None)
    if known is not None:
        return known
    _refuse_binary(data)
    if head.startswith((b"{", b"[")):
        return Kind.NDJSON if _is_ndjson(head, filename, content_type) else Kind.JSON
    return Kind.CSV


def _refuse_utf16_json(data: bytes) -> None:
    """JSON that is exchanged is UTF-8 (RFC 8259); only tables are read in a spreadsheet's UTF-16."""
    text = "".join(data[:HEAD].decode("utf-16", "ignore").split())
    if text.startswith(('{"', "[{")):
        raise Problem("unreadable-file", "The file is JSON in UTF-16: write it in UTF-8.")


def _refuse_binary(data: bytes) -> None:
    if data.startswith(_MAT_73) or any(data.startswith(_HDF5, place) for place in _HDF5_PLACES):
        raise Problem(
            "unsupported-media-type",
            "This file is HDF5, as MATLAB writes with -v7.3, and is not read because its links can lead to other "
            f"files: save it with -v7. Files that are read: {READ}.",
        )
    for magic, (name, remedy) in _BINARY.items():
        if data.startswith(magic):
            detail = f"This file is {name}: {remedy}. Files that are read: {READ}."
            raise Problem("unsupported-media-type", detail)
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
