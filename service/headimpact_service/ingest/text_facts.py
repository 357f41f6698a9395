"""What has to be known of a text before its first line is read, by a look through all of it."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from headimpact_service.errors import Problem
from headimpact_service.ingest.decimal_commas import CLEAR, CLEAR_POINT

MAX_LINE = 256 * 1024
UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
"""How a spreadsheet's "Unicode text" begins."""

DELIMITERS = (",", ";", "\t")
_BARE = re.compile(rf"(?:^|[;\t\r\n]){CLEAR}(?=[;\t\r\n]|$)".encode())
_POINT = re.compile(rf"(?:^|[;\t\r\n\"]){CLEAR_POINT}(?=[;\t\r\n\"]|$)".encode())
_IN_QUOTES = re.compile(f'"{CLEAR}"'.encode())


@dataclass(frozen=True, slots=True)
class TextFacts:
    """Its encoding, whether quotes occur in it, and its beginning as UTF-8."""

    encoding: str
    quoted: bool
    head: bytes

    def has_decimal_commas(self, delimiter: str) -> bool:
        """Whether a comma in its numbers is a decimal comma: one of them at the beginning groups no thousands.

        Between commas only numbers in quotes can have one.
        """
        patterns = (_IN_QUOTES,) if delimiter == "," else (_BARE, _IN_QUOTES)
        return any(pattern.search(self.head) for pattern in patterns)

    def has_decimal_points(self, delimiter: str) -> bool:
        """Whether points in its numbers are decimal: between commas, or where one of them groups no thousands."""
        return delimiter == "," or _POINT.search(self.head) is not None


def text_facts(stream: BinaryIO) -> TextFacts:
    """Look through the whole text; 422 for what would make a text reader hold a great deal at once."""
    first = stream.read(3)
    stream.seek(0)
    if first.startswith(UTF_16):
        return _of_pieces(_from_utf16(stream), "utf-16")
    return _of_pieces(iter(lambda: stream.read(MAX_LINE), b""), "utf-8-sig" if first == codecs.BOM_UTF8 else None)


def _of_pieces(pieces: Iterator[bytes], marked: str | None) -> TextFacts:
    utf8, quoted, line, head = codecs.getincrementaldecoder("utf-8")(), False, 0, b""
    is_utf8 = True
    for piece in pieces:
        if b"\0" in piece:
            raise unreadable("A text file holds no NUL bytes.")
        head = head or piece
        line = _line_after(piece, line)
        quoted = quoted or b'"' in piece
        is_utf8 = is_utf8 and _decodes(utf8, piece, final=False)
    is_utf8 = is_utf8 and _decodes(utf8, b"", final=True)
    if marked is not None and not is_utf8:
        raise unreadable("The text is marked as UTF-8, which it is not.")
    return TextFacts(marked or ("utf-8" if is_utf8 else "latin-1"), quoted, head)


def _from_utf16(stream: BinaryIO) -> Iterator[bytes]:
    """The text as UTF-8, piece by piece."""
    decoder = codecs.getincrementaldecoder("utf-16")()
    try:
        while raw := stream.read(MAX_LINE):
            if piece := decoder.decode(raw).encode():
                yield piece
        decoder.decode(b"", final=True)
    except UnicodeError:
        raise unreadable("The text is marked as UTF-16, which it is not.") from None


def _line_after(piece: bytes, before: int) -> int:
    """The length of the line that the piece leaves unended; 422 where a line is too long."""
    ends = [place for place in (piece.find(b"\n"), piece.find(b"\r")) if place >= 0]
    if before + min(ends, default=len(piece)) > MAX_LINE:
        raise unreadable(f"A line may have at most {MAX_LINE} bytes.")
    if not ends:
        return before + len(piece)
    return len(piece) - 1 - max(piece.rfind(b"\n"), piece.rfind(b"\r"))


def _decodes(decoder: codecs.IncrementalDecoder, piece: bytes, *, final: bool) -> bool:
    try:
        decoder.decode(piece, final)
    except UnicodeDecodeError:
        return False
    return True


def unreadable(detail: str) -> Problem:
    """The 422 for a text that cannot be read as a whole."""
    return Problem("unreadable-file", detail)


def delimiter_of(heading: str) -> str:
    """The one separator of the headings outside quotes; where two occur, the one that occurs more often."""
    bare = re.sub(r'"[^"]*"', "", heading)
    counts = sorted(((bare.count(delimiter), delimiter) for delimiter in DELIMITERS), reverse=True)
    if counts[0][0] == 0:
        raise unreadable("The headings are not separated by commas, semicolons or tabs.")
    if counts[0][0] == counts[1][0]:
        raise unreadable("The headings hold two separators equally often: use one for the whole file.")
    return counts[0][1]
