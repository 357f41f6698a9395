"""The text files of ISO-MME: lines of ``key (padded to 28) :value``, and in a channel's file a number a line below."""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass

import numpy as np

from headimpact_service.ingest.file_faults import file_fault
from headimpact_service.ingest.impact_json import MAX_SAMPLES
from headimpact_service.ingest.table import FloatArray
from headimpact_service.ingest.text_facts import UTF_16

NO_VALUE = "NOVALUE"
MAX_FILE = 4 * 1024 * 1024
MAX_VALUE = 200
"""Characters of a header's value that is given back."""

_LISTED = re.compile(r"name of channel ([0-9]{1,4})")


@dataclass(frozen=True, slots=True)
class Header:
    """Keys, in lower case, and values; of a key that occurs more than once, the first."""

    fields: dict[str, str]

    def text(self, key: str) -> str | None:
        """The value of a key, unless it is empty or said to be none."""
        value = self.fields.get(key, "")
        return None if value in {"", NO_VALUE} else value[:MAX_VALUE]

    def number(self, key: str) -> float | None:
        """The value of a key as a number."""
        value = self.text(key)
        return float(value) if value is not None and re.fullmatch(NUMBER, value, re.ASCII) else None


NUMBER = r"[+-]?([0-9]++(\.[0-9]*+)?|\.[0-9]++)([eE][+-]?[0-9]{1,3})?"


def decoded(data: bytes) -> str:
    """Text in whichever encoding its laboratory writes: marked UTF-16, UTF-8, else CP1252, which Latin-1 completes."""
    if data.startswith(UTF_16):
        return data.decode("utf-16", "replace")
    for encoding in ("utf-8-sig", "cp1252"):
        try:
            return codecs.decode(data, encoding)
        except UnicodeDecodeError:
            continue
    return data.decode("latin-1")


def read_header(data: bytes) -> Header:
    """A file that is all header."""
    return _header(_lines(data))[0]


def read_channel(data: bytes, named: str) -> tuple[Header, FloatArray]:
    """A channel's header and samples; NaN where it says that there is no value.

    Raises
    ------
    Problem
        422: below the header stands what is no number, or too many of them.
    """
    if len(data) > MAX_FILE:
        raise file_fault(f"The file of {named} may have at most {MAX_FILE} bytes.", "sample-count")
    lines = _lines(data)
    header, first = _header(lines)
    return header, _samples(lines[first:], named)


def listed_channels(header: Header) -> dict[int, str]:
    """The channels that a ``.chn`` file lists: number and code."""
    found = ((_LISTED.fullmatch(key), value) for key, value in header.fields.items())
    return {int(match[1]): value.partition("/")[0].strip()[:MAX_VALUE] for match, value in found if match is not None}


def _lines(data: bytes) -> list[str]:
    # Not splitlines(): in CP1252 read as Latin-1, an ellipsis would end a line.
    return [line.strip() for line in decoded(data).replace("\r\n", "\n").replace("\r", "\n").split("\n")]


def _header(lines: list[str]) -> tuple[Header, int]:
    """The header's fields, and the line that it ends before."""
    fields: dict[str, str] = {}
    for number, line in enumerate(lines):
        key, colon, value = line.partition(":")
        if not colon and line:
            return Header(fields), number
        if colon:
            fields.setdefault(" ".join(key.split()).casefold(), value.strip())
    return Header(fields), len(lines)


def _samples(lines: list[str], named: str) -> FloatArray:
    cells = [line for line in lines if line]
    if not 3 <= len(cells) <= MAX_SAMPLES:
        raise file_fault(f"The file of {named} must hold 3 to {MAX_SAMPLES} samples.", "sample-count")
    numbers = ["nan" if cell.upper() == NO_VALUE else cell for cell in cells]
    for index, cell in enumerate(numbers):
        if cell != "nan" and re.fullmatch(NUMBER, cell, re.ASCII) is None:
            raise file_fault(f"The file of {named} holds what is no number at sample {index}.", "missing-sample")
    return np.array([float(cell) for cell in numbers])
