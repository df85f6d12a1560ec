"""The rules of the cup of the day, a qualifying and a knock-out for each division of sixteen cars of like pace."""

import hashlib
from collections.abc import Sequence
from datetime import datetime, time, timedelta
from zoneinfo import ZoneInfo

QUALIFYING = timedelta(minutes=15)
KNOCK_OUT_OPEN = timedelta(minutes=2)  # cars are sent when it opens, and it closes as soon as all of them are timed
ANNOUNCED_BEFORE = timedelta(hours=20)
CARS_OF_A_DIVISION = 16
TRACKS_NOT_AGAIN = 14  # a track of the last so many cups is not drawn
DIRECTIONS = ("ccw", "cw")


def next_start(at: time, zone: ZoneInfo, now: datetime) -> datetime:
    """The first moment after ``now`` at which a clock in ``zone`` shows ``at``, the first of two, the next for none."""
    local = now.astimezone(zone)
    for days in (0, 1, 2):
        start = datetime.combine(local.date() + timedelta(days=days), at, zone)
        # through UTC and back: what no clock shows becomes what it shows then
        start = start.astimezone(ZoneInfo("UTC"))
        if start > now:
            return start
    raise AssertionError("a day has come within two days")


def drawn_ground(day: str, tracks: Sequence[str], recent: Sequence[str]) -> tuple[str, str]:
    """Track and direction of a cup, drawn by its date alone. ``recent``: the last cups' tracks, drawn again only if no
    other is left. Raises ValueError without a track."""
    if not tracks:
        raise ValueError("no track to draw from")
    fresh = sorted(set(tracks) - set(recent)) or sorted(tracks)
    digest = int.from_bytes(hashlib.sha256(f"cup of the day {day}".encode()).digest()[:8], "big")
    return fresh[digest % len(fresh)], DIRECTIONS[digest // len(fresh) % 2]


def divisions(cars: int, size: int = CARS_OF_A_DIVISION) -> list[range]:
    """Places of the qualifying (from 0), cut into divisions of at most ``size``; a last single car joins the one
    before."""
    if cars < 2:
        return []
    cuts = list(range(0, cars, size))
    if cars - cuts[-1] == 1 and len(cuts) > 1:
        cuts.pop()
    return [range(start, end) for start, end in zip(cuts, [*cuts[1:], cars], strict=True)]
