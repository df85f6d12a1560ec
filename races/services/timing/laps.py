"""What laps may be: sent laps, checked before anything is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from uuid import UUID

from paddock.errors import UserFault

from ...models import LapNote, Race
from ...models.race import LONGEST_LAP_MS
from ...models.timing import MOST_LAPS

# Two clocks of one device differ by so much over a lap, and by this share of it, before one of them stood or jumped.
CLOCKS_DIFFER_MS = 1000
CLOCKS_DIFFER = 0.02
# A lap that is recorded as begun after the session's end by rounding is none.
END_SLACK_MS = 1000
MOST_FAULTS = 999


@dataclass(frozen=True)
class SentLap:
    """A lap as it was measured. ``time_ms``: by the monotonic clock; ``wall_ms``: the same by the wall clock, where the
    device told it. ``note``: a :class:`LapNote`."""

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

    Raises UserFault("lap_too_short" | "lap_too_long").
    """
    shortest = race.minimum_lap_ms if valid else 1
    if time_ms < shortest:
        raise UserFault("lap_too_short", lap=number, shortest=shortest)
    if time_ms > LONGEST_LAP_MS:
        raise UserFault("lap_too_long", lap=number, minutes=LONGEST_LAP_MS // 60_000)


def check_laps(race: Race, laps: Sequence[SentLap], *, in_session: bool = True) -> None:
    """Refuse laps that cannot have been driven so. ``in_session``: one after the other from the start of a session, of
    which none begins after the session is over.

    Raises UserFault("lap_numbers" | "laps_too_many" | "lap_too_short" | "lap_too_long" | "lap_clock" |
    "lap_after_session"), with the number of the ``lap``.
    """
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
