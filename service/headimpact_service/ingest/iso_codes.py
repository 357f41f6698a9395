"""Channel codes of ISO/TS 13499: sixteen characters that say what was measured, where, and how it was filtered.

Test object (1), position (1), main location (4), three fine locations (2 each), dimension (2), direction (1), filter
(1): ``11HEADCG00H3ACXA`` is the x acceleration at the head's centre of gravity of the dummy in position 1 of test
object 1, filtered to class 1000.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from headimpact.recording import SignalName

RESULTANT = "r"

_CODE = re.compile(r"[0-9A-Z?]{16}")
_SIGNALS: dict[str, SignalName] = {
    "AC": "linear_acceleration",
    "AV": "angular_velocity",
    "AA": "angular_acceleration",
}
_AXES = {"X": "x", "Y": "y", "Z": "z", "R": RESULTANT}
# The head's centre of gravity is its default place; sides, top and redundant sensors have codes of their own.
_CENTRE = frozenset({"00", "CG"})
FILTERS = {"0": "none", "P": "prefiltered", "A": "CFC1000", "B": "CFC600", "C": "CFC180", "D": "CFC60", "S": "special"}
"""What the last letter says of the filtering before the data were written, the weakest first."""


@dataclass(frozen=True, slots=True)
class HeadCode:
    """The code of a channel at a head's centre of gravity; `axis` may be :data:`RESULTANT`."""

    code: str
    signal: SignalName
    axis: str

    @property
    def head(self) -> str:
        """Whose head: test object and position."""
        return self.code[:2]

    @property
    def is_explicit(self) -> bool:
        """Whether it says the centre of gravity, and not only the head."""
        return "CG" in {self.code[6:8], self.code[8:10]}

    @property
    def filtering(self) -> str:
        """The filter that the last letter names."""
        return FILTERS.get(self.code[15], "unknown")

    @property
    def strength(self) -> int:
        """How strong that filter is, to take the weakest of several."""
        return [*FILTERS, self.code[15]].index(self.code[15])


def head_code(text: str) -> HeadCode | None:
    """The code, if it is that of acceleration or rotation at the centre of gravity of a head."""
    code = text.strip().upper()
    if _CODE.fullmatch(code) is None or code[2:6] != "HEAD" or not {code[6:8], code[8:10]} <= _CENTRE:
        return None
    signal, axis = _SIGNALS.get(code[12:14]), _AXES.get(code[14])
    return None if signal is None or axis is None else HeadCode(code, signal, axis)


def is_time(text: str) -> bool:
    """Whether a code is that of a channel of times, which other channels refer to."""
    code = text.strip().upper()
    return _CODE.fullmatch(code) is not None and code[2:6] in {"TIRS", "TIME"}
