"""How people spell headings and units: what differs only in that is one."""

from __future__ import annotations

import re
import tomllib
import unicodedata
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.resources import files
from typing import Any

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")
_NO_SIGN_OR_LETTER = re.compile(r"[^0-9a-z]+")
_WORDED = str.maketrans({"°": "deg", "º": "deg", "µ": "u", "μ": "u", "ω": "omega", "α": "alpha"})
MAX_COMPACT = 200
_PRESET = files("headimpact_service.ingest") / "presets" / "generic_six_axis.toml"


def words_of(heading: str) -> list[str]:
    """The words of a heading in small letters without accents, whatever parts them: punctuation, numbers, a capital."""
    if not heading.isascii():
        whole = unicodedata.normalize("NFD", heading.replace("ß", "ss"))
        heading = "".join(letter for letter in whole if not unicodedata.combining(letter))
    return [word.lower() for word in _WORD.findall(heading)]


def compact(heading: str) -> str:
    """A heading without what people spell differently: case, spaces, punctuation, `²` for `2`, `µ` for `u`."""
    plain = unicodedata.normalize("NFKC", heading[:MAX_COMPACT].translate(_WORDED)).casefold()
    return _NO_SIGN_OR_LETTER.sub("", plain)


@cache
def vocabulary() -> dict[str, Any]:
    """The words of the generic preset."""
    found: dict[str, Any] = tomllib.loads(_PRESET.read_text("utf-8"))["vocabulary"]
    return found


@cache
def _units() -> dict[str, dict[str, str]]:
    """Of time and of each signal, every spelling of a unit, as :func:`compact` has it, and the unit."""
    return {
        quantity: {compact(spelling): unit for unit, spellings in said["units"].items() for spelling in spellings}
        for quantity, said in vocabulary().items()
        if "units" in said
    }


def unit_spelled(signal: str, text: str | None) -> str | None:
    """The unit that a text names, if it is one of the signal's."""
    return None if text is None else _units()[signal].get(compact(text))


def spellings_of(quantity: str) -> Iterator[tuple[str, list[str]]]:
    """The units of a quantity, each with its spellings."""
    yield from vocabulary()[quantity]["units"].items()


@cache
def _written(quantity: str) -> tuple[tuple[str, str], ...]:
    """Spellings of a quantity's units as they are written, the longest first, each with its unit."""
    units = vocabulary()[quantity]["units"].items()
    return tuple(sorted(((text, unit) for unit, texts in units for text in texts), key=lambda said: -len(said[0])))


def unit_ending(quantity: str, heading: str) -> str | None:
    """The unit of a quantity that ends a heading as a word of its own."""
    at_end = unit_at_end(quantity, heading)
    return None if at_end is None else at_end[1]


def unit_at_end(quantity: str, heading: str) -> tuple[str, str] | None:
    """What stands before a unit of a quantity that ends a heading as a word of its own, and that unit."""
    found = next(ending(heading, _written(quantity)), None)
    return None if found is None else (found[0], found[2])


def ending(heading: str, spellings: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str, str]]:
    """The spellings that end a heading as a word of their own: what stands before each, it, and the unit it is of."""
    text = (
        unicodedata.normalize("NFKC", heading[:MAX_COMPACT].translate(_WORDED))
        .casefold()
        .replace("^", "")
        .rstrip(" )]")
    )
    for spelling, unit in spellings:
        rest = text.removesuffix(spelling)
        if rest != text and rest and not rest[-1].isalnum():
            yield rest, spelling, unit
