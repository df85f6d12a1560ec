"""What followers of a racer are told: that they lead a race by a new best, and that they have won.

Only of races that everybody may see, with somebody else on the board; of one racer and race at most one notice a day.
"""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django.db.models import Q

from accounts.following import followers_of
from core.events import Event
from races.models import Entry, Race, Visibility
from races.selectors import podiums
from races.selectors.counting import totals_of
from races.selectors.results import place_of

from ..models import Cup, CupPlace, NoticeKind
from ..selectors.honours import LEAST
from .telling import Told, tell


def tell_of_lead(entry: Entry, event: Event, now: datetime) -> int:
    """Followers of a racer whose new best has put them first, if they still are. ``entry.race`` is read."""
    race = entry.race
    if not _is_everybodys(race) or entry.is_withdrawn or entry.is_baseline:
        return 0
    followers = followers_of(entry.racer_id)
    if not followers:
        return 0
    place = place_of(entry)
    if place.rank != 1 or place.totals.classified < LEAST:
        return 0
    params = {"racer": entry.racer.alias, "race": race.name, "what": "lead", "score_ms": entry.score_ms}
    return tell(_told(entry.racer_id, race, event, followers, params), now)


def tell_of_win(race: Race, event: Event, now: datetime) -> int:
    """Followers of who has won a race by its official results; what is part of a cup is told of with the cup."""
    if not _is_everybodys(race) or totals_of(race).classified < LEAST:
        return 0
    first = next(iter(podiums([race], size=1)[race.pk]), None)
    followers = [] if first is None else followers_of(first.racer.pk)
    if first is None or not followers or Cup.objects.filter(Q(race=race) | Q(divisions__race=race)).exists():
        return 0
    params = {"racer": first.alias, "race": race.name, "what": "race"}
    return tell(_told(first.racer.pk, race, event, followers, params), now)


def tell_of_cup(event: Event, now: datetime) -> int:
    """Followers of who has won a division of a cup."""
    told = 0
    won = CupPlace.objects.filter(cup__day=event.subject, place=1).select_related("cup__race", "racer").order_by("pk")
    for one in won:
        if _is_everybodys(one.cup.race) and (followers := followers_of(one.racer_id)):
            params = {"racer": one.racer.alias, "what": "cup", "division": one.division, "day": event.subject}
            about = f"{one.racer_id}:cup:{event.subject}"
            told += tell(Told(NoticeKind.FOLLOWED, about, followers, one.cup.get_absolute_url(), params), now)
    return told


def _is_everybodys(race: Race) -> bool:
    return race.visibility == Visibility.PUBLIC and race.cancelled_at is None and race.imported_at is None


def _told(racer: int, race: Race, event: Event, followers: list[int], params: dict[str, Any]) -> Told:
    about = f"{racer}:{race.slug}:{event.at:%Y%m%d}"
    return Told(NoticeKind.FOLLOWED, about, followers, race.get_absolute_url(), params)
