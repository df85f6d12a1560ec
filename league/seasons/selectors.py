"""Seasons for reading: the list, the running season, a racer's way through one, the hall of fame."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime

from django.db.models import Count, Exists, OuterRef, Q, QuerySet, Subquery
from django.db.models.functions import Coalesce
from django.utils import timezone

from accounts.models import Racer
from paddock.errors import UserFault
from races.boards.selectors.board import BoardRow, podiums, ranks_of
from races.models import Division, Entry, Race, RaceState

from ..models import (
    ChampionshipPlace,
    FinalePlace,
    Membership,
    Round,
    RoundPoints,
    Season,
    Stage,
    StewardDecision,
)
from ..models.season import RESERVED_SLUGS
from ..standings.rules import RacerStanding
from ..standings.selectors.months import Month
from ..standings.selectors.standings import standings_of


@dataclass(frozen=True)
class MonthRace:
    """A race of a season with its present state and its leader or winner (None: nobody yet)."""

    round: Round
    state: RaceState
    leader: BoardRow | None

    @property
    def race(self) -> Race:
        return self.round.race


@dataclass(frozen=True)
class Standpoint:
    """Where a racer stands in a season. ``lines``: their line in the standings of each division that they are in."""

    division: Division
    promoted_in: Round | None
    championship: ChampionshipPlace | None
    lines: dict[str, RacerStanding] = field(default_factory=dict)


def seasons_listed() -> QuerySet[Season]:
    """All seasons, the latest first, each with ``race_count`` and ``official_count`` of its rounds."""
    official = Count("rounds", filter=Q(rounds__closed_at__isnull=False))
    return Season.objects.annotate(race_count=Count("rounds"), official_count=official).order_by("-starts_on", "-pk")


def current_season(now: datetime) -> Season | None:
    """The season of this day, else the next, else the last one; of several one with an open race, then a coming
    race."""
    today = timezone.localdate(now)
    left = Round.objects.filter(season=OuterRef("pk"), race__cancelled_at=None, race__closes_at__gt=now)
    seasons = Season.objects.annotate(is_on=Exists(left.filter(race__opens_at__lte=now)), goes_on=Exists(left))
    running = seasons.filter(starts_on__lte=today, ends_on__gte=today)
    return (
        running.order_by("-is_on", "-goes_on", "-starts_on", "-pk").first()
        or seasons.filter(starts_on__gt=today).order_by("-goes_on", "starts_on", "pk").first()
        or seasons.order_by("-ends_on", "-pk").first()
    )


def month_races(months: Sequence[Month], now: datetime) -> dict[int, MonthRace]:
    """The races of these months by the id of their round, with leader or winner: two queries."""
    rounds = [one for month in months for one in month]
    leaders = podiums([one.race for one in rounds], size=1)
    return {one.pk: MonthRace(one, one.race.state_at(now), next(iter(leaders[one.race_id]), None)) for one in rounds}


def standpoint_of(season: Season, racer: Racer) -> Standpoint:
    """Where a racer stands in a season: four queries."""
    member = Membership.objects.filter(season=season, racer=racer).select_related("promoted_in__race").first()
    place = ChampionshipPlace.objects.filter(season=season, racer=racer).select_related("round__race").first()
    lines = {
        name: line for name, own in standings_of([season])[season.pk].items() for line in own if line.holder == racer.pk
    }
    division = Division.OPEN if member is None else Division(member.division)
    return Standpoint(division, None if member is None else member.promoted_in, place, lines)


@dataclass(frozen=True)
class RacerRound:
    """A round of a racer's season and its outcome. ``rank``: None if not classified; ``points``: 0 while not
    official."""

    round: Round
    entry: Entry
    rank: int | None
    points: int
    promoted: bool = False
    in_finale: bool = False
    qualified: bool = False


@dataclass(frozen=True)
class Champion:
    racer: Racer
    round: Round


@dataclass(frozen=True)
class HallOfFame:
    """The winners of a season. ``divisions``: the leaders of the standings of each division; empty before any round."""

    season: Season
    champion: Champion | None
    finales: list[Champion] = field(default_factory=list)
    divisions: dict[str, Racer] = field(default_factory=dict)

    @property
    def division_leaders(self) -> list[tuple[Division, Racer]]:
        """Division and racer, the pro division first."""
        order = (Division.PRO, Division.OPEN, Division.ALL)
        return [(division, self.divisions[division]) for division in order if division in self.divisions]


def racer_season(season: Season, racer: Racer) -> list[RacerRound]:
    """Every round of a season that the racer is in, in the order of closing: two queries."""
    here = Q(round=OuterRef("race__round"), racer=racer)
    points = RoundPoints.objects.filter(here).order_by().values("points")
    entries = list(
        Entry.objects.filter(racer=racer, withdrawn_at=None, race__round__season=season)
        .select_related("race__round", "race__track")
        .annotate(
            won_points=Coalesce(Subquery(points), 0),
            promoted=Exists(Membership.objects.filter(promoted_in=OuterRef("race__round"), racer=racer)),
            in_finale=Exists(FinalePlace.objects.filter(here)),
            qualified=Exists(ChampionshipPlace.objects.filter(here)),
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
    """Every season with an official round, the latest first, with its winners: seven queries in all."""
    official = Round.objects.filter(closed_at__isnull=False)
    seasons = list(Season.objects.filter(pk__in=official.values("season")).order_by("-starts_on", "-pk"))
    finals = official.filter(season__in=seasons, stage__in=[Stage.FINALE, Stage.CHAMPIONSHIP])
    rounds = list(finals.select_related("race").order_by("race__closes_at", "pk"))
    winners = podiums([one.race for one in rounds], size=1)
    lines = standings_of(seasons)
    leaders = {pk: {name: own[0].holder for name, own in by.items()} for pk, by in lines.items()}
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
    """The decisions of stewards on a round, the latest first."""
    return round_.decisions.select_related("racer", "by")


def why_kept(race: Race, now: datetime) -> UserFault | None:
    """Why a race of a season cannot be deleted; None where it can."""
    was_cancelled_before = race.cancelled_at is not None and race.cancelled_at <= race.opens_at
    if race.imported_at is not None or (race.opens_at <= now and not was_cancelled_before):
        return UserFault("season_has_opened", race=race.name)
    if Entry.objects.filter(race=race, withdrawn_at=None, is_baseline=False).exists():
        return UserFault("season_has_entries", race=race.name)
    return None


def season_at(slug: str) -> Season | None:
    """The season that holds an address, in any case; a season with only cancelled races holds none."""
    return _cancelled(Season.objects.filter(slug__iexact=slug), False).first()


def cancelled_at(slug: str) -> QuerySet[Season]:
    """The seasons at an address all of whose races are cancelled."""
    return _cancelled(Season.objects.filter(slug__iexact=slug), True)


def free_season_slug(slug: str) -> str:
    """This address, or one with a number behind it that no season has."""
    limit = Season._meta.get_field("slug").max_length or 50
    free, number = slug[:limit], 1
    while free.lower() in RESERVED_SLUGS or Season.objects.filter(slug__iexact=free).exists():
        number += 1
        free = f"{slug[: limit - 4]}-{number}"
    return free


def _cancelled(seasons: QuerySet[Season], whole: bool) -> QuerySet[Season]:
    rounds = Round.objects.filter(season=OuterRef("pk"))
    seasons = seasons.annotate(has_rounds=Exists(rounds), is_on=Exists(rounds.filter(race__cancelled_at=None)))
    wholly = {"has_rounds": True, "is_on": False}
    return seasons.filter(**wholly) if whole else seasons.exclude(**wholly)
