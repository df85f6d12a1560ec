"""Who may take times in a race and when: the one place that compares a race of real cars with the clock."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import TYPE_CHECKING

from paddock.errors import UserFault

from ...engines import is_final, is_official
from ...models import Race
from ...selectors.timing import can_keep_time
from ...selectors.visibility import can_organise
from ..gates import moment

if TYPE_CHECKING:
    from accounts.models import Racer

# Laps that were driven in time are taken for so long after the race has closed: a day without a network, and a night.
CARRY_OVER = timedelta(hours=48)
# A device's clock and the server's agree to so much, after the one is set right by the other.
CLOCK_SLACK = timedelta(seconds=5)


def require_timekeeper(race: Race, by: Racer) -> None:
    """Raises UserFault("race_not_physical" | "timing_not_yours")."""
    require_physical(race)
    if not can_keep_time(by, race):
        raise UserFault("timing_not_yours")


def require_organiser(race: Race, by: Racer) -> None:
    """Raises UserFault("race_not_physical" | "race_not_yours")."""
    require_physical(race)
    if not can_organise(by, race):
        raise UserFault("race_not_yours")


def require_physical(race: Race) -> None:
    """Raises UserFault("race_not_physical")."""
    if not race.physical:
        raise UserFault("race_not_physical")


def require_driven_in_time(race: Race, started_at: datetime, now: datetime, *, at_once: bool = True) -> None:
    """Pass for a session that began while the race was open, carried over soon enough; not ``at_once``: a file of the
    organiser's, as long as the results are not final.

    Raises UserFault("race_cancelled" | "timing_clock_ahead" | "race_not_open_yet" | "race_closed" | "timing_too_late" |
    "timing_final").
    """
    if race.cancelled_at is not None:
        raise UserFault("race_cancelled", reason=race.cancel_reason)
    if min(started_at, now) < race.opens_at - CLOCK_SLACK:
        raise UserFault("race_not_open_yet", opens=moment(race.opens_at))
    if started_at > now + CLOCK_SLACK:
        raise UserFault("timing_clock_ahead")
    if started_at >= race.closes_at:
        raise UserFault("race_closed", closes=moment(race.closes_at))
    if at_once and now >= race.closes_at + CARRY_OVER:
        raise UserFault("timing_too_late", hours=int(CARRY_OVER.total_seconds()) // 3600)
    require_not_final(race, now)


def require_not_final(race: Race, now: datetime) -> None:
    """Raises UserFault("timing_final") once the steward window over the results is over."""
    if is_final(race, now):
        raise UserFault("timing_final")


def require_may_correct(race: Race, by: Racer, now: datetime) -> None:
    """Who organises a race corrects its laps; once its results are official only admins do, as stewards, and once they
    are final nobody. Raises UserFault("race_not_physical" | "race_not_yours" | "race_cancelled" | "timing_final" |
    "timing_stewards")."""
    require_organiser(race, by)
    if race.cancelled_at is not None:
        raise UserFault("race_cancelled", reason=race.cancel_reason)
    require_not_final(race, now)
    if is_official(race) and not by.is_staff:
        raise UserFault("timing_stewards")
