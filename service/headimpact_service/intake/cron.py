"""When a schedule is due: cron expressions of five fields, on the clock of a time zone."""

from __future__ import annotations

from datetime import UTC, datetime
from zoneinfo import ZoneInfo

from croniter import CroniterBadCronError, CroniterBadDateError, croniter

FIELDS = 5


def require_cron(expression: str) -> None:
    """Refuse what is no cron expression of five fields, or one whose days never come.

    Raises
    ------
    ValueError
        With a sentence for whoever wrote it.
    """
    if len(expression.split()) != FIELDS or not croniter.is_valid(expression):
        raise ValueError(
            "A schedule is a cron expression of five fields, as in 30 3 * * 1: minute, hour, day, month, weekday."
        )
    if next_due(expression, "UTC", datetime.now(UTC)) is None:
        raise ValueError("The days of this cron expression never come.")


def next_due(expression: str, time_zone: str, after: datetime) -> datetime | None:
    """The first instant after `after` at which the expression is due; None if there is none for years."""
    try:
        found = croniter(expression, after.astimezone(ZoneInfo(time_zone))).get_next(datetime)
    except (CroniterBadDateError, CroniterBadCronError):
        return None
    due: datetime = found.astimezone(UTC)
    return due
