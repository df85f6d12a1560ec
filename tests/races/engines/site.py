"""What the tests of engines say again and again."""

from __future__ import annotations

from datetime import timedelta

from paddock.errors import PlatformFault, UserFault
from races.models import Race
from tests.factories import laps
from tests.redrives import end, pending

OLD, NEW, NEWEST = "engine-of-before", "engine-of-now", "engine-after-that"
MINUTE = timedelta(minutes=1)
OURS, THEIRS = PlatformFault("internal_error"), UserFault("policy_died", step=3, how="signal 11")


def fresh(race: Race) -> Race:
    return Race.objects.get(pk=race.pk)


def again(race: Race, now, *times: int) -> None:
    """Let the pending runs end with laps of these times, in the order of the cast."""
    waiting = pending(race)
    assert len(waiting) == len(times)
    for one, time_ms in zip(waiting, times, strict=True):
        end(one, laps(*[time_ms] * 3), now)
