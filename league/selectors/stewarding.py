"""Whom a steward may choose: the competitors of a round's board, and those who were taken off it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from django.db.models import Q

from races.models import Entry
from races.selectors.boards import ORDER, ranks_of

from ..models import Round

SHOWN = 50  # on one page; whoever is further down is found by alias


@dataclass(frozen=True)
class Competitors:
    """Who can be chosen. ``rows``: entries with their rank (None for who has none), the board's first first, at most
    SHOWN; ``count``: how many there are."""

    rows: list[tuple[Entry, int | None]]
    count: int


def competitors_of(rounds: Sequence[Round], chosen: str = "", find: str = "", *, gone: bool = False) -> Competitors:
    """The racers on the boards of ``rounds``, or with ``gone`` those who were disqualified or removed; with ``find``
    only those whose alias, or of guests the name, holds it. Whose alias is ``chosen`` is among them in any case. House
    cars are not."""
    entries = Entry.objects.filter(race__in=[one.race_id for one in rounds], is_baseline=False)
    entries = entries.filter(removed_at__isnull=False) if gone else entries.filter(withdrawn_at=None)
    named = Q(racer__alias__icontains=find) | Q(racer__guest_name__icontains=find)
    found = entries.filter(named) if find else entries
    shown = list(found.select_related("racer", "race").order_by("race", *ORDER)[:SHOWN])
    if chosen and all(one.racer.alias.lower() != chosen.lower() for one in shown):
        shown += entries.filter(racer__alias__iexact=chosen).select_related("racer", "race")
    ranks = ranks_of(shown)
    return Competitors([(one, ranks[one.pk]) for one in shown], found.count())
