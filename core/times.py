"""Times and differences as racing writes them."""

from __future__ import annotations

import re
from datetime import UTC, date, datetime

from django.utils import timezone

_STORED = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC")


def gap(milliseconds: int) -> str:
    """A difference as ``+s.mmm``, ``+m:ss.mmm`` from a minute on."""
    sign = "+" if milliseconds >= 0 else "−"
    minutes, rest = divmod(abs(milliseconds), 60_000)
    seconds = f"{rest // 1000:02d}" if minutes else f"{rest // 1000}"
    return f"{sign}{f'{minutes}:' if minutes else ''}{seconds}.{rest % 1000:03d}"


def clock(milliseconds: int | None) -> str:
    """A time as ``m:ss.mmm``; a dash for none."""
    if milliseconds is None:
        return "–"
    return f"{milliseconds // 60_000}:{milliseconds // 1000 % 60:02}.{milliseconds % 1000:03}"


def written(when: datetime) -> str:
    """A moment in the reader's time zone, which it names."""
    return timezone.localtime(when).strftime("%Y-%m-%d %H:%M %Z")


def stored(when: datetime) -> str:
    """A moment as reasons, notices and logs keep it, in UTC; :func:`for_the_reader` shows it."""
    return f"{when.astimezone(UTC):%Y-%m-%d %H:%M} UTC"


def for_the_reader(value: object) -> object:
    """A value of a reason or a notice; what :func:`stored` wrote in the reader's time zone."""
    if isinstance(value, str) and _STORED.fullmatch(value):
        return written(datetime.strptime(value, "%Y-%m-%d %H:%M UTC").replace(tzinfo=UTC))
    return value


def site_day(now: datetime) -> date:
    """The day in the site's time zone, whoever asks."""
    return timezone.localdate(now, timezone.get_default_timezone())


def start_of_month(now: datetime) -> datetime:
    """When the month began in the site's time zone, whoever asks."""
    local = timezone.localtime(now, timezone.get_default_timezone())
    return local.replace(day=1, hour=0, minute=0, second=0, microsecond=0)
