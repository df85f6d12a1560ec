"""Checks before times are taken: permissions, time windows and uploaded laps. No other module compares a race of real
cars with the clock."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from uuid import UUID

from accounts.models import Racer
from paddock.errors import UserFault

from ...entries.engines import is_final, is_official
from ...entries.selectors.visibility import can_organise
from ...entries.time_checks import moment
from ...models import LapNote, Race
from ...models.race import LONGEST_LAP_MS
from ...models.timing import MOST_LAPS
from ..selectors import can_keep_time

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
    organiser's, as long as the results are not final. Raises UserFault("race_cancelled" | "timing_clock_ahead" |
    "race_not_open_yet" | "race_closed" | "timing_too_late" | "timing_final")."""
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
    """Allow corrections to the organiser, to admins alone once results are official, and to nobody once they are final.
    Raises UserFault("race_not_physical" | "race_not_yours" | "race_cancelled" | "timing_final" | "timing_stewards")."""
    require_organiser(race, by)
    if race.cancelled_at is not None:
        raise UserFault("race_cancelled", reason=race.cancel_reason)
    require_not_final(race, now)
    if is_official(race) and not by.is_staff:
        raise UserFault("timing_stewards")


# Two clocks of one device differ by so much over a lap, and by this share of it, before one of them stood or jumped.
CLOCKS_DIFFER_MS = 1000
CLOCKS_DIFFER = 0.02
# A lap that is recorded as begun after the session's end by rounding is none.
END_SLACK_MS = 1000
MOST_FAULTS = 999


@dataclass(frozen=True)
class SentLap:
    """A lap as it was measured. ``time_ms``: by the monotonic clock; ``wall_ms``: by the wall clock, if the device sent
    it; ``note``: a :class:`LapNote`."""

    id: UUID
    number: int
    time_ms: int
    off_tracks: int = 0
    resets: int = 0
    valid: bool = True
    note: str = LapNote.NONE
    wall_ms: int | None = None


def check_time(race: Race, number: int, time_ms: int, *, valid: bool = True) -> None:
    """Refuse what cannot be the time of a lap; one that does not count may be shorter than any lap, but not nothing.
    Raises UserFault("lap_too_short" | "lap_too_long")."""
    shortest = race.minimum_lap_ms if valid else 1
    if time_ms < shortest:
        raise UserFault("lap_too_short", lap=number, shortest=shortest)
    if time_ms > LONGEST_LAP_MS:
        raise UserFault("lap_too_long", lap=number, minutes=LONGEST_LAP_MS // 60_000)


def check_laps(race: Race, laps: Sequence[SentLap], *, in_session: bool = True) -> None:
    """Refuse laps that cannot have been driven so. ``in_session``: one after the other from the start of a session, of
    which none begins after the session is over. Raises UserFault("lap_numbers" | "laps_too_many" | "lap_too_short" |
    "lap_too_long" | "lap_clock" | "lap_after_session"), with the number of the ``lap``."""
    if len(laps) > MOST_LAPS:
        raise UserFault("laps_too_many", most=MOST_LAPS)
    if len({lap.id for lap in laps}) < len(laps) or [lap.number for lap in laps] != list(range(1, len(laps) + 1)):
        raise UserFault("lap_numbers")
    begins = 0
    for lap in laps:
        check_time(race, lap.number, lap.time_ms, valid=lap.valid)
        if lap.valid and lap.wall_ms is not None:
            differ = abs(lap.wall_ms - lap.time_ms)
            if differ > CLOCKS_DIFFER_MS + CLOCKS_DIFFER * lap.time_ms:
                raise UserFault("lap_clock", lap=lap.number, seconds=round(differ / 1000))
        if in_session and lap.valid and begins > race.session_s * 1000 + END_SLACK_MS:
            raise UserFault("lap_after_session", lap=lap.number, seconds=race.session_s)
        begins += lap.time_ms
