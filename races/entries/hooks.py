"""Calls from entries up to duels and live events, which register when the site starts."""

from collections.abc import Callable, Sequence
from datetime import datetime

from ..models import Entry, Race

Recount = Callable[[Race, Sequence[Entry]], None]
Departure = Callable[[Entry, datetime], None]
_RECOUNTS: list[Recount] = []
_DEPARTURES: list[Departure] = []


def register_recount(recount: Recount) -> Recount:
    """Have ``recount`` work out the standings of drawn entries. Registering one twice changes nothing."""
    if recount not in _RECOUNTS:
        _RECOUNTS.append(recount)
    return recount


def recount_drawn(race: Race, entries: Sequence[Entry]) -> None:
    """Work out the standings of drawn entries of a race, which the caller has locked."""
    for recount in _RECOUNTS:
        recount(race, entries)


def register_departure(call: Departure) -> Departure:
    """Call ``call`` after the commit that takes an entry out of its race. Registering one twice changes nothing."""
    if call not in _DEPARTURES:
        _DEPARTURES.append(call)
    return call


def report_departure(entry: Entry, now: datetime) -> None:
    for call in _DEPARTURES:
        call(entry, now)
