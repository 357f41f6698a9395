"""How people spell headings and units: what differs only in that is one."""

from __future__ import annotations

import re
import tomllib
import unicodedata
from functools import cache
from importlib.resources import files

_NO_SIGN_OR_LETTER = re.compile(r"[^0-9a-z]+")
_WORDED = str.maketrans({"°": "deg", "µ": "u", "μ": "u", "ω": "omega", "α": "alpha"})
MAX_COMPACT = 200
_VOCABULARY = files("headimpact_service.ingest") / "presets" / "generic_six_axis.toml"


def compact(heading: str) -> str:
    """A heading without what people spell differently: case, spaces, punctuation, `²` for `2`, `µ` for `u`."""
    plain = unicodedata.normalize("NFKC", heading[:MAX_COMPACT].translate(_WORDED)).casefold()
    return _NO_SIGN_OR_LETTER.sub("", plain)


@cache
def known_units() -> frozenset[str]:
    """Every spelling of a unit of time or of a signal, as :func:`compact` has it."""
    vocabulary = tomllib.loads(_VOCABULARY.read_text("utf-8"))["vocabulary"]
    return frozenset(
        compact(spelling)
        for said in vocabulary.values()
        for spellings in said["units"].values()
        for spelling in spellings
    )
