"""Calls from entries up to duels and live events, which add theirs when the site starts."""

from collections.abc import Callable, Sequence
from datetime import datetime

from ..models import Entry, Race

# Work out the standings of drawn entries of a race, which the caller has locked.
RECOUNTS: list[Callable[[Race, Sequence[Entry]], None]] = []
# Called after the commit that takes an entry out of its race.
DEPARTURES: list[Callable[[Entry, datetime], None]] = []


def recount_drawn(race: Race, entries: Sequence[Entry]) -> None:
    """Work out the standings of drawn entries of a race, which the caller has locked."""
    for recount in RECOUNTS:
        recount(race, entries)


def report_departure(entry: Entry, now: datetime) -> None:
    for call in DEPARTURES:
        call(entry, now)
