"""When an impact happened: RFC 3339 with an offset, or a local time and its IANA zone."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

_RFC3339 = re.compile(
    r"[0-9]{4}-[0-9]{2}-[0-9]{2}[Tt ][0-9]{2}:[0-9]{2}:[0-9]{2}(\.[0-9]{1,9})?([Zz]|[+-][0-9]{2}:[0-9]{2})?"
)
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_ZONE = re.compile(r"[A-Za-z0-9_+-]+(/[A-Za-z0-9_+-]+){0,2}")

_OF_THE_HOST = frozenset({"localtime", "posixrules", "factory"})
"""Files beside the zones that are none: what they say depends on the machine."""
FORM = "A time is written as RFC 3339 does, 2026-11-20T19:04:05.123Z"


class TimeError(ValueError):
    """A time that cannot be placed; `field` is what has to be corrected, the text a sentence without the value."""

    def __init__(self, message: str, *, code: str, field: str = "occurred_at") -> None:
        super().__init__(message)
        self.code = code
        self.field = field


def instant(text: str, time_zone: str | None = None) -> datetime:
    """The instant in UTC that `text` names; a local time is placed by `time_zone`.

    Raises
    ------
    TimeError
        Text that is no time, a local time without a zone, an unknown zone, or a local time that the zone's clock
        showed twice or never.
    """
    zone = None if time_zone is None else _zone(time_zone)
    moment = _parse(text)
    if moment.tzinfo is None:
        if zone is None:
            raise TimeError("A time needs its offset from UTC, or `time_zone` beside it.", code="offset-missing")
        moment = _placed(moment, zone)
    try:
        return moment.astimezone(UTC)
    except OverflowError:
        raise TimeError("A time lies between the years 1 and 9999 in UTC.", code="out-of-range") from None


def nanoseconds(text: str) -> int | None:
    """How long after 1970 a time is, a local one as if it were UTC; None for what is no time."""
    found = _RFC3339.fullmatch(text)
    seconds = None if found is None else _whole_seconds(text[:19], found[2] or "Z")
    if found is None or seconds is None:
        return None
    return seconds * 10**9 + int((found[1] or "")[1:].ljust(9, "0"))


@lru_cache(maxsize=64)
def _whole_seconds(text: str, offset: str) -> int | None:
    """The same to the second: stamps that follow each other share it."""
    try:
        return (datetime.fromisoformat(f"{text}{offset}".upper()) - _EPOCH) // timedelta(seconds=1)
    except ValueError:
        return None


def known_zone(name: str) -> None:
    """Refuse a zone that the IANA data base does not name."""
    _zone(name)


def _parse(text: str) -> datetime:
    if _RFC3339.fullmatch(text) is None:
        raise TimeError(f"{FORM}.", code="not-a-time")
    try:
        return datetime.fromisoformat(text.upper())
    except ValueError:
        raise TimeError(f"{FORM}; this day or hour does not exist.", code="not-a-time") from None


@lru_cache(maxsize=64)
def _zone(name: str) -> ZoneInfo:
    unknown = TimeError(
        "The time zone must be one of the IANA data base, such as Europe/Dublin.",
        code="unknown-zone",
        field="time_zone",
    )
    if len(name) > 64 or _ZONE.fullmatch(name) is None or name.lower() in _OF_THE_HOST:
        raise unknown
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise unknown from None


def _placed(local: datetime, zone: ZoneInfo) -> datetime:
    """`local` on that zone's clock, refused where the clock was put forward or back over it."""
    early, late = local.replace(tzinfo=zone, fold=0), local.replace(tzinfo=zone, fold=1)
    if early.utcoffset() == late.utcoffset():
        return early
    if early.astimezone(UTC).astimezone(zone).replace(tzinfo=None) == local:
        raise TimeError(
            "This local time happened twice, as clocks were put back: give its offset.", code="ambiguous-time"
        )
    raise TimeError(
        "This local time never happened, as clocks were put forward: give its offset.", code="nonexistent-time"
    )
