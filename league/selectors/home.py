"""Which races the first page shows as cards, and which it folds behind "All races"."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from django.db.models import Exists, QuerySet

from accounts.classes import remember_no_learner
from accounts.models import ClassLearner
from core.forms import explain
from paddock.errors import UserFault
from races.eligibility import refusal
from races.models import Division, Race, RaceKind

from .boards import read_rounds

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

LOOKED_AT, CARDS, LEAST_CARDS = 24, 4, 2


@dataclass(frozen=True)
class FoldedRace:
    """An open race without a card. ``why_not``: why the reader may not enter it; empty where they may."""

    race: Race
    why_not: str


@dataclass(frozen=True)
class HomeRaces:
    """``cards``: open races that the reader may enter, the league's first; ``folded``: the other open ones."""

    cards: list[Race]
    folded: list[FoldedRace]


def home_races(open_now: QuerySet[Race], reader: Racer | AnonymousUser, now: datetime) -> HomeRaces:
    """The races of the first page out of those ``open_now``: a race that nobody has entered has no card unless it is
    the league's or the page would be nearly empty. Two queries, and those of eligibility for races of groups, teams and
    fields."""
    is_learner = Exists(ClassLearner.objects.filter(racer=reader.pk))
    races = list(open_now.annotate(reader_is_learner=is_learner)[:LOOKED_AT])
    if races and not races[0].reader_is_learner:
        remember_no_learner(reader)
    refused = _refusals(races, reader, now)
    allowed = [race for race in races if race.pk not in refused]
    busy = [race for race in allowed if race.entry_count or race.kind == RaceKind.LEAGUE]
    quiet = [race for race in allowed if race not in busy]
    cards = (busy + quiet[: max(0, LEAST_CARDS - len(busy))])[:CARDS]
    rest = sorted((race for race in races if race not in cards), key=lambda race: race.pk in refused)
    return HomeRaces(cards, [FoldedRace(race, refused.get(race.pk, "")) for race in rest])


def _refusals(races: list[Race], reader: Racer | AnonymousUser, now: datetime) -> dict[int, str]:
    """Why the reader may not enter, by race. A guest counts as a racer without any result."""
    if not reader.is_authenticated:
        pro = [race for race in races if race.kind == RaceKind.LEAGUE and race.division == Division.PRO]
        closed: dict[int, UserFault] = {race.pk: UserFault("race_pro_only") for race in pro}
        closed |= {race.pk: UserFault("race_group_only", group=race.group.name) for race in races if race.group}
    else:
        read_rounds(races, reader)
        faults = ((race.pk, refusal(race, reader, now)) for race in races)
        closed = {pk: fault for pk, fault in faults if fault is not None}
    return {pk: explain(fault) for pk, fault in closed.items()}
