"""Formats of lap times, gaps and dates."""

import re
from datetime import UTC, date, datetime

from django.utils import timezone
from django.utils.dateformat import format as date_format
from django.utils.translation import pgettext

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


def written(when: datetime, *, zone: bool = True) -> str:
    """A moment in the reader's time zone and language: ``Sat 28 Nov, 14:32 UTC``; the year only if it is another."""
    local = timezone.localtime(when)
    if local.year == timezone.localdate().year:
        text = _format(local, pgettext("format of a moment", "D j M, H:i"))
    else:
        text = _format(local, pgettext("format of a moment in another year", "D j M Y, H:i"))
    return f"{text} {local:%Z}" if zone else text


def written_day(when: date | datetime) -> str:
    """A day in the reader's language: ``Sat 28 Nov``, ``11 June 2021`` in another year."""
    day = timezone.localtime(when) if isinstance(when, datetime) else when
    if day.year == timezone.localdate().year:
        return _format(day, pgettext("format of a day", "D j M"))
    return _format(day, pgettext("format of a day in another year", "j F Y"))


def _format(value: date, form: str) -> str:
    return date_format(value, form).replace("요일", "")  # Django's short weekdays are whole words in Korean


def stored(when: datetime) -> str:
    """A moment as reasons, notices and logs keep it, in UTC; :func:`for_the_reader` shows it."""
    return f"{when.astimezone(UTC):%Y-%m-%d %H:%M} UTC"


def for_the_reader(value: object) -> object:
    """A value of a reason or a notice; what :func:`stored` wrote in the reader's time zone."""
    if isinstance(value, str) and _STORED.fullmatch(value):
        return written(datetime.strptime(value, "%Y-%m-%d %H:%M UTC").replace(tzinfo=UTC))
    return value


def site_day(now: datetime) -> date:
    """The day in the site's time zone, independent of the reader's."""
    return timezone.localdate(now, timezone.get_default_timezone())


def start_of_month(now: datetime) -> datetime:
    """When the month began in the site's time zone, independent of the reader's."""
    local = timezone.localtime(now, timezone.get_default_timezone())
    return local.replace(day=1, hour=0, minute=0, second=0, microsecond=0)
