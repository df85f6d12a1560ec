"""Seasons for reading: months, a racer's way through one, the hall of fame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from django.db.models import Exists, OuterRef, QuerySet, Subquery
from django.db.models.functions import Coalesce

from accounts.models import Racer
from races.models import Division, Entry
from races.selectors import podiums
from races.selectors.boards import ranks_of

from ..models import ChampionshipPlace, FinalePlace, Membership, Round, RoundPoints, Season, Stage, StewardDecision
from .standings import standings_of


@dataclass(frozen=True)
class Month:
    """The races of one month of a season; None where there is none of a stage. ``others``: of a stage of its own."""

    number: int
    name: str
    open: Round | None = None
    pro: Round | None = None
    finale: Round | None = None
    others: tuple[Round, ...] = ()

    def __iter__(self) -> Iterator[Round]:
        return (one for one in (self.open, self.pro, self.finale, *self.others) if one is not None)


@dataclass(frozen=True)
class RacerRound:
    """One round of a racer's season. ``rank``: None for who is not classified; ``points``: 0 while not official.

    ``promoted``, ``in_finale``, ``qualified``: what came of it for them.
    """

    round: Round
    entry: Entry
    rank: int | None
    points: int
    promoted: bool = False
    in_finale: bool = False
    qualified: bool = False


@dataclass(frozen=True)
class Champion:
    """Who won something, and in which round."""

    racer: Racer
    round: Round


@dataclass(frozen=True)
class HallOfFame:
    """The winners of one season. ``divisions``: who leads the standings of each division; empty before any round."""

    season: Season
    champion: Champion | None
    finales: list[Champion] = field(default_factory=list)
    divisions: dict[str, Racer] = field(default_factory=dict)

    @property
    def division_leaders(self) -> list[tuple[Division, Racer]]:
        """Division and racer, the pro division first."""
        order = (Division.PRO, Division.OPEN, Division.ALL)
        return [(division, self.divisions[division]) for division in order if division in self.divisions]


def months_of(season: Season) -> list[Month]:
    """The months of a season in their order, each with its rounds and their races and tracks: one query."""
    months: dict[int, list[Round]] = {}
    for one in season.rounds.select_related("race__track").order_by("number", "race__opens_at", "pk"):
        one.season = season
        months.setdefault(one.number, []).append(one)
    made = []
    for number, rounds in months.items():
        by = {one.stage: one for one in rounds}
        main = (by.get(Stage.OPEN), by.get(Stage.PRO), by.get(Stage.FINALE))
        others = tuple(one for one in rounds if one not in main)
        made.append(Month(number, next((one.name for one in rounds if one.name), ""), *main, others))
    return made


def racer_season(season: Season, racer: Racer) -> list[RacerRound]:
    """Every round of a season that the racer is in, in the order of closing: two queries."""
    here: dict[str, Any] = {"round": OuterRef("race__round"), "racer": racer}
    points = RoundPoints.objects.filter(**here).order_by().values("points")
    entries = list(
        Entry.objects.filter(racer=racer, withdrawn_at=None, race__round__season=season)
        .select_related("race__round", "race__track")
        .annotate(
            won_points=Coalesce(Subquery(points), 0),
            promoted=Exists(Membership.objects.filter(promoted_in=here["round"], racer=racer)),
            in_finale=Exists(FinalePlace.objects.filter(**here)),
            qualified=Exists(ChampionshipPlace.objects.filter(**here)),
        )
        .order_by("race__closes_at", "race__pk")
    )
    ranks = ranks_of(entries)
    rows = []
    for entry in entries:
        one = entry.race.round
        one.season, one.race = season, entry.race
        came = entry.promoted, entry.in_finale, entry.qualified
        rows.append(RacerRound(one, entry, ranks[entry.pk], entry.won_points, *came))
    return rows


def hall_of_fame() -> list[HallOfFame]:
    """Every season with an official round, the latest first, and who won what in it: seven queries for all."""
    official = Round.objects.filter(closed_at__isnull=False)
    seasons = list(Season.objects.filter(pk__in=official.values("season")).order_by("-starts_on", "-pk"))
    finals = official.filter(season__in=seasons, stage__in=[Stage.FINALE, Stage.CHAMPIONSHIP])
    rounds = list(finals.select_related("race").order_by("race__closes_at", "pk"))
    winners = podiums([one.race for one in rounds], size=1)
    lines = standings_of(seasons)
    leaders = {pk: {name: own[0].who for name, own in by.items()} for pk, by in lines.items()}
    racers = Racer.objects.in_bulk({pk for first in leaders.values() for pk in first.values()})
    halls = []
    for season in seasons:
        won = [
            Champion(winners[one.race_id][0].racer, one)
            for one in rounds
            if one.season_id == season.pk and winners[one.race_id]
        ]
        champion = next((one for one in won if one.round.stage == Stage.CHAMPIONSHIP), None)
        finales = [one for one in won if one.round.stage == Stage.FINALE]
        first = leaders[season.pk]
        halls.append(HallOfFame(season, champion, finales, {name: racers[pk] for name, pk in first.items()}))
    return halls


def decisions_of(round_: Round) -> QuerySet[StewardDecision]:
    """What stewards decided about a round, the latest first."""
    return round_.decisions.select_related("racer", "by")
