"""The cup of the day by its pure rules: when the next one starts, what it is driven on, who meets whom.

Qualifying and then a knock-out among drivers of like ability, as Trackmania's cup of the day has them: the fastest so
many are drawn into the first division, the next so many into the second, and everybody can win theirs.
"""

from __future__ import annotations

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
    """The first moment after ``now`` at which a clock of ``zone`` says ``at``; of an hour that comes twice the first,
    of one that is left out the one after it."""
    local = now.astimezone(zone)
    for days in (0, 1, 2):
        start = datetime.combine(local.date() + timedelta(days=days), at, zone)
        # through UTC and back: what no clock shows becomes what it shows then
        start = start.astimezone(ZoneInfo("UTC"))
        if start > now:
            return start
    raise AssertionError("a day has come within two days")


def drawn_ground(day: str, tracks: Sequence[str], recent: Sequence[str]) -> tuple[str, str]:
    """Track and direction of a day's cup: drawn by its date alone, so that nobody chooses them and anybody can check.

    ``tracks``: those to draw from; ``recent``: the last cups' tracks, which are left out as long as others are there.
    Raises ValueError without a track.
    """
    if not tracks:
        raise ValueError("no track to draw from")
    fresh = sorted(set(tracks) - set(recent)) or sorted(tracks)
    digest = int.from_bytes(hashlib.sha256(f"cup of the day {day}".encode()).digest()[:8], "big")
    return fresh[digest % len(fresh)], DIRECTIONS[digest // len(fresh) % 2]


def divisions(cars: int, size: int = CARS_OF_A_DIVISION) -> list[range]:
    """Places of the qualifying (from 0), cut into divisions of at most ``size``, none of which has a single car: a last
    one drives with the division before it. Fewer than two cars make none."""
    if cars < 2:
        return []
    cuts = list(range(0, cars, size))
    if cars - cuts[-1] == 1 and len(cuts) > 1:
        cuts.pop()
    return [range(start, end) for start, end in zip(cuts, [*cuts[1:], cars], strict=True)]
