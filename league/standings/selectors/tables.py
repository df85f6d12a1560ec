"""Standings as tables: a line for each racer, country, region or team, and a column for each round."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.db.models import F, QuerySet, Window
from django.db.models.functions import Rank

from accounts.groups.selectors import visible_of
from accounts.models import Racer, RacerGroup
from core.streams.shared_pieces import shared_value
from races.models import Division, RaceState

from ...models import DuelRating, Round, RoundPoints, Season, Stage
from ..rules import RacerStanding, RoundRank
from . import standings
from .months import Month

# The stage whose rounds give the points of a division.
STAGE_OF = {Division.PRO: Stage.PRO, Division.OPEN: Stage.OPEN, Division.ALL: Stage.SINGLE}


@dataclass(frozen=True)
class StandingsRow:
    """One line of standings. ``cells``: for each round of the table the result and whether it is dropped, None for
    none."""

    place: int
    name: str
    racer: Racer | None
    points: int
    cells: list[tuple[RoundRank, bool] | None]


@dataclass(frozen=True)
class StandingsTable:
    """Standings with a column for each round; ``is_provisional``: whether unofficial rounds count as they stand."""

    rounds: list[Round]
    rows: list[StandingsRow]
    is_provisional: bool = False


def standings_table(
    season: Season,
    division: str,
    of: str,
    months: Sequence[Month],
    running: Sequence[Round] = (),
    group: RacerGroup | None = None,
    region: str = "",
) -> StandingsTable:
    """The standings of ``of`` with a column for each official and each ``running`` round, of one group or region.

    Three queries, four for teams; for each of ``running`` one more, two for teams.
    """
    among = group or region
    if among and of == standings.RACERS:
        lines = standings.standings_among(season, division, among, running)
    else:
        lines = standings.season_standings(season, division, of, running)
    rounds = _counted_rounds(months, division, running)
    spelled = _spellings(rounds, running) if of == standings.TEAMS else {}
    racers = Racer.objects.in_bulk([line.holder for line in lines]) if of == standings.RACERS else {}
    rows = []
    for line in lines:
        results = {result.round: result for result in line.results}
        cells = [
            None if number not in results else (results[number], number in line.dropped)
            for number in range(1, len(rounds) + 1)
        ]
        racer, key = racers.get(line.holder), str(line.holder)
        name = racer.shown_name if racer else spelled.get(key, key)
        rows.append(StandingsRow(line.place, name, racer, line.points, cells))
    return StandingsTable(rounds, rows, bool(running))


def groups_raced(season: Season, viewer: Any, most: int = 12) -> list[RacerGroup]:
    """The groups that the reader may see, of which somebody is in a race of the season: one query, or none where all
    are listed."""
    racing = {"members__confirmed_at__isnull": False, "members__racer__entries__race__round__season": season}
    groups = RacerGroup.objects.filter(**racing).distinct().order_by("-is_listed", "name", "pk")
    return visible_of(shared_value(("groups of a season", season.pk), lambda: list(groups)), viewer)[:most]


@dataclass(frozen=True)
class Leaders:
    """The first of a division's standings. ``is_provisional``: of rounds that are not official, as they stand."""

    division: Division
    rows: list[tuple[RacerStanding, Racer]]
    is_provisional: bool


def leaders_shown(season: Season, size: int, months: Sequence[Month], now: datetime) -> list[Leaders]:
    """The first of each division's standings, by open races as they stand where nobody has points yet."""
    lines = {division: own[:size] for division, own in standings.standings_of([season])[season.pk].items()}
    official = frozenset(lines)
    for division in divisions_with_points(months):
        running = [] if division in official else running_rounds(months, division, now)
        if running:
            lines[division] = standings.lines_as_they_stand(season, running)[:size]
    racers = Racer.objects.in_bulk({line.holder for own in lines.values() for line in own})
    return [
        Leaders(name, [(line, racers[line.holder]) for line in lines[name]], name not in official)
        for name in (Division.PRO, Division.OPEN, Division.ALL)
        if lines.get(name)
    ]


def running_rounds(months: Iterable[Month], division: str, now: datetime) -> list[Round]:
    """The rounds of a division that give points, whose races have opened and whose results are not official yet."""
    started = (RaceState.OPEN, RaceState.CLOSED)
    rounds = rounds_with_points(months, division)
    return [one for one in rounds if one.closed_at is None and one.race.state_at(now) in started]


def rounds_with_points(months: Iterable[Month], division: str) -> list[Round]:
    """The rounds that give the points of a division, whether their races have opened or not."""
    return [one for month in months for one in month if one.stage == STAGE_OF[Division(division)]]


def divisions_with_points(months: Iterable[Month]) -> list[Division]:
    """The divisions that a season's standings are kept for, in their usual order."""
    stages = {one.stage for month in months for one in month}
    return [division for division, stage in STAGE_OF.items() if stage in stages]


def _counted_rounds(months: Sequence[Month], division: str, running: Sequence[Round]) -> list[Round]:
    """In the order that the standings number them by."""
    rounds = rounds_with_points(months, division)
    counted = (one for one in rounds if one.closed_at is not None or one in running)
    return sorted(counted, key=lambda one: (one.race.closes_at, one.pk))


def _spellings(rounds: Sequence[Round], running: Sequence[Round]) -> dict[str, str]:
    """How the racers of each team write its name, the latest of several spellings: what standings add up as one."""
    teams = RoundPoints.objects.filter(round__in=rounds).exclude(team="").order_by("round__race__closes_at", "-rank")
    now = [row.team for one in running for row in reversed(standings.points_as_they_stand(one)) if row.team]
    return {standings.team_key(team): " ".join(team.split()) for team in (*teams.values_list("team", flat=True), *now)}


SHOWN = F("mu") - 3.0 * F("sigma")


def season_ratings(season: Season, limit: int | None = None) -> Sequence[DuelRating]:
    """The ratings of a season, the highest first, each with its ``place`` (equal ratings share one). One query."""
    return list(_placed().filter(season=season)[:limit])


def racer_ratings(racer: Racer) -> Sequence[DuelRating]:
    """The racer's rating in each season that they drove duels in, with their ``place``, the latest season first."""
    seasons = DuelRating.objects.filter(racer=racer).values("season")
    placed = _placed().filter(season__in=seasons).select_related("season").order_by("-season__starts_on", "season")
    return [one for one in placed if one.racer_id == racer.pk]


def _placed() -> QuerySet[DuelRating]:
    place = Window(Rank(), partition_by=[F("season")], order_by=SHOWN.desc())
    rated = DuelRating.objects.select_related("racer").annotate(level=SHOWN, place=place)
    return rated.order_by("-level", "racer__alias")
