"""Days of a time zone: late days, and the calendar day for limits."""

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo


def late_days(accepted_at: datetime, due_at: datetime, time_zone: str) -> int:
    """The number of late days that have begun; 0 in time, at ``due_at`` itself too.

    A late day goes from the local time of day of ``due_at`` to the same of the next day, so that it has 23 or 25 hours
    where the clocks change."""
    if accepted_at <= due_at:
        return 0
    due = due_at.astimezone(ZoneInfo(time_zone))
    days = max(0, (accepted_at - due_at).days - 1)  # a day has at most 25 hours
    while _days_after(due, days) < accepted_at:
        days += 1
    return days


def local_day(now: datetime, time_zone: str) -> tuple[datetime, datetime]:
    """The beginning of the calendar day at ``now``, and of the next one, in UTC."""
    midnight = now.astimezone(ZoneInfo(time_zone)).replace(hour=0, minute=0, second=0, microsecond=0, fold=0)
    return midnight.astimezone(UTC), _days_after(midnight, 1)


def _days_after(local: datetime, days: int) -> datetime:
    return (local + timedelta(days=days)).astimezone(UTC)  # wall clock arithmetic
