"""A season's races as an iCalendar file (RFC 5545), and the names of time zones."""

from __future__ import annotations

import zoneinfo
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from typing import TYPE_CHECKING

from django.conf import settings

from races.web.names import named

from ..models import Round, Season

if TYPE_CHECKING:  # loaded by the first calendar
    from icalendar import Event

REFRESH = timedelta(hours=6)


@lru_cache(maxsize=1)
def zone_names() -> tuple[str, ...]:
    """Every time zone that people live in, by its name: ``Asia/Seoul``, and ``UTC``."""
    places = ("Africa", "America", "Asia", "Atlantic", "Australia", "Europe", "Indian", "Pacific")
    return ("UTC", *sorted(name for name in zoneinfo.available_timezones() if name.split("/")[0] in places))


def season_calendar(season: Season, *, address: Callable[[str], str]) -> bytes:
    """The races of a season as one calendar, times in UTC, with lasting UIDs; ``address`` makes an address of a
    path."""
    from icalendar import Calendar

    calendar = Calendar()
    calendar.add("prodid", "-//Paddock//League//EN")
    calendar.add("version", "2.0")
    calendar.add("calscale", "GREGORIAN")
    calendar.add("method", "PUBLISH")
    calendar.add("x-wr-calname", named(season.name))
    calendar.add("refresh-interval", REFRESH, parameters={"value": "DURATION"})
    rounds = season.rounds.select_related("race__track").order_by("race__opens_at", "pk")
    for one in rounds:
        calendar.add_component(_event(one, address))
    return calendar.to_ical()


def _event(round_: Round, address: Callable[[str], str]) -> Event:
    from icalendar import Event

    race = round_.race
    host = settings.SITE_URL.split("://", 1)[1].split("/")[0]
    event = Event()
    event.add("uid", f"race-{race.slug}@{host}")
    event.add("dtstamp", _utc(race.cancelled_at or race.created_at))
    event.add("dtstart", _utc(race.opens_at))
    event.add("dtend", _utc(race.closes_at))
    event.add("summary", named(race.name))
    event.add("location", race.track.name)
    event.add("url", address(race.get_absolute_url()))
    event.add("categories", [str(round_.get_stage_display())])
    event.add("status", "CANCELLED" if race.cancelled_at else "CONFIRMED")
    if race.cancelled_at:
        event.add("description", race.cancel_reason)
    event.add("transp", "TRANSPARENT")
    return event


def _utc(moment: datetime) -> datetime:
    return moment.astimezone(UTC).replace(microsecond=0)
