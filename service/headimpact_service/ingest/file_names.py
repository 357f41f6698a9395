"""What a file's name says of the impact in it, where its device names files so."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime
from pathlib import PurePosixPath

from headimpact_service.ingest.times import TimeError, instant


@dataclass(frozen=True, slots=True)
class NamedFacts:
    """Facts that a name holds."""

    external_id: str | None = None
    device: str | None = None
    occurred_at: datetime | None = None


NOT_NAMED = NamedFacts()
# The separators of an ISO time that no file name may hold, or that makers leave out.
_TIME = re.compile(
    r"([0-9]{4})[-_.]?([0-9]{2})[-_.]?([0-9]{2})[Tt _-]?([0-9]{2})[-_.:h]?([0-9]{2})[-_.:m]?([0-9]{2})"
    r"(?:[.,_-]?([0-9]{1,9}))?(?:([Zz])|([+-])([0-9]{2})[-_:]?([0-9]{2}))?"
)


def named_facts(filename: str | None, pattern: str | None, time_zone: str | None) -> NamedFacts:
    """The facts in a name that is built like `pattern`, whose groups are `device` and `occurred_at`.

    The external id is the whole name without its ending: what it counts starts anew with every device.
    """
    found = None if filename is None or pattern is None else re.fullmatch(pattern, PurePosixPath(filename).stem)
    if found is None:
        return NOT_NAMED
    groups = found.groupdict()
    return NamedFacts(found[0], groups.get("device"), _moment(groups.get("occurred_at"), time_zone))


def _moment(text: str | None, time_zone: str | None) -> datetime | None:
    """The instant of a name; none where its clock is nobody's, since a name is no claim that a sender made."""
    parts = None if text is None else _TIME.fullmatch(text)
    if parts is None:
        return None
    year, month, day, hour, minute, second, fraction, utc, sign, hours, minutes = parts.groups()
    offset = "Z" if utc else f"{sign}{hours}:{minutes}" if sign else ""
    fraction = f".{fraction}" if fraction else ""
    try:
        return instant(f"{year}-{month}-{day}T{hour}:{minute}:{second}{fraction}{offset}", time_zone)
    except TimeError:
        return None
