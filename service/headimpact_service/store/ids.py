"""Identifiers: UUIDv7 as 16 bytes in the database, a prefix and 26 base32 characters outside it.

The characters are Crockford's alphabet in lower case, so identifiers sort as the times of their making do, survive a
phone call, and fit a URL.
"""

from __future__ import annotations

import re

import uuid_utils

LENGTH = 16
"""Bytes of an identifier in the database."""

_ALPHABET = "0123456789abcdefghjkmnpqrstvwxyz"
_PAIRS = tuple(high + low for high in _ALPHABET for low in _ALPHABET)
_VALUES = {character: value for value, character in enumerate(_ALPHABET)}
_CHARACTERS = 26
_FORM = re.compile(rf"[0-7][{_ALPHABET}]{{{_CHARACTERS - 1}}}")  # 26 x 5 = 130 bits: the first carries three


def new() -> bytes:
    """A new identifier, later than every one made before in this process."""
    return uuid_utils.uuid7().bytes


def encode(prefix: str, raw: bytes) -> str:
    """The public form, `imp_01k…`."""
    number = int.from_bytes(raw, "big")
    return prefix + "_" + "".join([_PAIRS[(number >> shift) & 1023] for shift in range(120, -1, -10)])


def decode(prefix: str, text: str) -> bytes | None:
    """The 16 bytes of a public identifier, or None if it cannot be one of ours."""
    head, separator, tail = text.partition("_")
    if head != prefix or not separator or not _FORM.fullmatch(tail):
        return None
    number = 0
    for character in tail:
        number = number << 5 | _VALUES[character]
    return number.to_bytes(LENGTH, "big")
