"""The standings of a season: of racers in a division, of countries and of teams."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from ..models import Round, RoundPoints, Season, Stage
from ..models.season import DIVISION_OF, WITH_POINTS
from ..rules import Line, Result, Standings

if TYPE_CHECKING:
    from races.models import Division


def season_standings(season: Season, division: Division | str) -> list[Line]:
    """The standings of one division after its official rounds: lines whose ``who`` is a racer's id.

    Two queries, however many raced: only places with points stand in the table.
    """
    rounds = _official(season, division)
    return Standings(season.drop_worst).lines(_results(rounds, lambda row: row.racer_id), len(rounds))


def standings_of(seasons: Iterable[Season]) -> dict[int, dict[str, list[Line]]]:
    """The standings of every division that has points, by season: two queries for all seasons."""
    seasons = {season.pk: season for season in seasons}
    rounds: dict[tuple[int, str], dict[int, int]] = defaultdict(dict)
    official = Round.objects.filter(season__in=seasons, stage__in=WITH_POINTS, closed_at__isnull=False)
    for pk, season, stage in official.order_by("race__closes_at", "pk").values_list("pk", "season", "stage"):
        own = rounds[season, str(DIVISION_OF[Stage(stage)])]
        own[pk] = len(own) + 1
    of = {pk: key for key, own in rounds.items() for pk in own}
    results: dict[tuple[int, str], list[Result]] = defaultdict(list)
    for row in RoundPoints.objects.filter(round__in=of, points__gt=0):
        key = of[row.round_id]
        results[key].append(Result(row.racer_id, rounds[key][row.round_id], row.rank, row.points))
    found: dict[int, dict[str, list[Line]]] = {pk: {} for pk in seasons}
    for (season, division), own in results.items():
        found[season][division] = Standings(seasons[season].drop_worst).lines(own, len(rounds[season, division]))
    return found


def country_standings(season: Season, division: Division | str) -> list[Line]:
    """The standings of countries (``who``: the two-letter code): the points of all their racers, none dropped."""
    return _summed(season, division, lambda row: row.country)


def team_standings(season: Season, division: Division | str) -> list[Line]:
    """The standings of teams (``who``: the name, in small letters): the points of all their racers, none dropped."""
    return _summed(season, division, lambda row: team_key(row.team))


def team_key(team: str) -> str:
    """What two spellings of one team have in common: neither letter case nor blanks make another team."""
    return " ".join(team.split()).casefold()


def _official(season: Season, division: Division | str) -> dict[int, int]:
    """The official rounds of a division that give points: their places in time by id."""
    stages = [stage for stage in WITH_POINTS if DIVISION_OF[stage] == division]
    rounds = season.rounds.filter(stage__in=stages, closed_at__isnull=False).order_by("race__closes_at", "pk")
    return {pk: place for place, pk in enumerate(rounds.values_list("pk", flat=True), start=1)}


def _results(rounds: dict[int, int], who: Callable[[RoundPoints], int | str]) -> Iterable[Result]:
    for row in RoundPoints.objects.filter(round__in=rounds, points__gt=0):
        yield Result(who(row), rounds[row.round_id], row.rank, row.points)


def _summed(season: Season, division: Division | str, who: Callable[[RoundPoints], str]) -> list[Line]:
    rounds = _official(season, division)
    by: dict[tuple[str, int], list[Result]] = defaultdict(list)
    for result in _results(rounds, who):
        if result.who:
            by[result.who, result.round].append(result)
    summed = [
        Result(name, number, min(one.rank for one in own), sum(one.points for one in own))
        for (name, number), own in by.items()
    ]
    return Standings().lines(summed, len(rounds))
