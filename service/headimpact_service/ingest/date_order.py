"""Dates in numbers that do not begin with the year: read in the order that a mapping says, which is never guessed."""

from __future__ import annotations

import re
from typing import Literal

from headimpact_service.ingest.times import TimeError

DateOrder = Literal["dmy", "mdy", "ymd"]
_DATE = re.compile(r"([0-9]{1,4})([-./])([0-9]{1,2})\2([0-9]{1,4})(?![0-9./-])", re.ASCII)
_FIRST = {"dmy": "day", "mdy": "month", "ymd": "year"}


def year_first(text: str, order: DateOrder | None) -> str:
    """A date, or one with a time behind it, as RFC 3339 writes it; what is none of that stays as it is.

    Raises
    ------
    TimeError
        Which part is the day and which the month is not said, or the date contradicts the order that is.
    """
    found = _DATE.match(text)
    if found is None or (order is None and len(found[1]) == 4):
        return text.replace("/", "-")
    if order is None:
        raise TimeError("Whether a date begins with its day or its month is not guessed.", code="date-order-missing")
    part = dict(zip(order, (found[1], found[3], found[4]), strict=True))
    if len(part["y"]) != 4 or not (1 <= int(part["m"]) <= 12 and 1 <= int(part["d"]) <= 31):
        raise TimeError(
            f"The date is none that begins with its {_FIRST[order]}, as the mapping's order says: such a date has a "
            "month of at most 12, a day of at most 31, and a year of four digits.",
            code="date-order",
        )
    date = f"{part['y']}-{part['m']:0>2}-{part['d']:0>2}"
    time = text[found.end() :].lstrip(" ,Tt")
    return f"{date}T{time}" if time else date
