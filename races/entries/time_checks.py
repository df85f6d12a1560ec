"""Checks of a race's times against the clock for a racer."""

from datetime import datetime

from core import times
from paddock.errors import UserFault

from ..models import Race, RaceState


def require_open(race: Race, now: datetime) -> None:
    """Pass from ``opens_at`` until just before ``closes_at``. Raises UserFault("race_not_open_yet") and as below."""
    require_not_over(race, now)
    if race.state_at(now) == RaceState.UPCOMING:
        raise UserFault("race_not_open_yet", opens=moment(race.opens_at))


def require_not_over(race: Race, now: datetime) -> None:
    """Pass until the race closes. Raises UserFault("race_closed" | "race_cancelled" | "race_recorded")."""
    if race.imported_at is not None and race.cancelled_at is None:
        raise UserFault("race_recorded")
    state = race.state_at(now)
    if state == RaceState.CANCELLED:
        raise UserFault("race_cancelled", reason=race.cancel_reason)
    if state == RaceState.CLOSED:
        raise UserFault("race_closed", closes=moment(race.closes_at))


def moment(time: datetime) -> str:
    """A time for a reason's sentence, its zone named."""
    return times.stored(time)
