"""The standings of a season: of racers in a division, of countries, of regions and of teams."""

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence

from django.db.models import Q

from accounts.groups.selectors import inside
from accounts.models import RacerGroup
from accounts.models.team import team_key
from accounts.profile.regions import countries_of, region_of
from races.boards.selectors.board import CLASSIFIED, board_entries
from races.models import Division

from ...models import Round, RoundPoints, Season, Stage
from ...models.season import DIVISION_OF, WITH_POINTS
from ..rules import PointsTable, RacerStanding, RoundRank, Standings

RACERS, COUNTRIES, REGIONS, TEAMS = STANDINGS_OF = ("racers", "countries", "regions", "teams")
_HOLDERS: dict[str, Callable[[RoundPoints], Hashable]] = {
    RACERS: lambda row: row.racer_id,
    COUNTRIES: lambda row: row.country,
    REGIONS: lambda row: region_of(row.country),
    TEAMS: lambda row: team_key(row.team),
}


def season_standings(
    season: Season, division: Division | str, of: str = RACERS, running: Sequence[Round] = ()
) -> list[RacerStanding]:
    """The standings of one division after its official rounds, and those ``running`` as they stand.

    ``holder`` of a line: a racer's id, a country's code, a region's name, a team's name in small letters. All but
    racers get the points of all their racers, none dropped. Two queries, and one for each running round.
    """
    rounds = _counted(season, division, running)
    results = _results(rounds, running, _HOLDERS[of])
    if of == RACERS:
        return Standings(season.drop_worst).lines(results, len(rounds))
    by: dict[tuple[Hashable, int], list[RoundRank]] = defaultdict(list)
    for result in results:
        if result.holder:
            by[result.holder, result.round].append(result)
    summed = [
        RoundRank(name, number, min(one.rank for one in own), sum(one.points for one in own))
        for (name, number), own in by.items()
    ]
    return Standings().lines(summed, len(rounds))


def standings_among(
    season: Season, division: Division | str, among: RacerGroup | str, running: Sequence[Round] = ()
) -> list[RacerStanding]:
    """The standings of one division among a group's confirmed members or a region's racers, both as of today, with
    points for the places among each other. Three queries, and one for each round."""
    if isinstance(among, str):
        racers = Q(racer__country__in=countries_of(among))
    else:
        racers = Q(racer__in=inside(among).values("racer"))
    rounds = _counted(season, division, running)
    table = PointsTable(tuple(season.points))
    results = []
    for round_ in Round.objects.filter(pk__in=rounds).select_related("race"):
        order = board_entries(round_.race).filter(racers, CLASSIFIED, is_baseline=False)
        for rank, racer in enumerate(order.values_list("racer_id", flat=True)[: len(table)], start=1):
            results.append(RoundRank(racer, rounds[round_.pk], rank, table.of(rank)))
    return Standings(season.drop_worst).lines([one for one in results if one.points], len(rounds))


def standings_of(seasons: Iterable[Season]) -> dict[int, dict[str, list[RacerStanding]]]:
    """The standings of every division that has points, by season: two queries for all seasons."""
    by_id = {season.pk: season for season in seasons}
    rounds: dict[tuple[int, str], dict[int, int]] = defaultdict(dict)
    official = Round.objects.filter(season__in=by_id, stage__in=WITH_POINTS, closed_at__isnull=False)
    for pk, season, stage in official.order_by("race__closes_at", "pk").values_list("pk", "season", "stage"):
        own = rounds[season, str(DIVISION_OF[Stage(stage)])]
        own[pk] = len(own) + 1
    of = {pk: key for key, own in rounds.items() for pk in own}
    results: dict[tuple[int, str], list[RoundRank]] = defaultdict(list)
    for row in RoundPoints.objects.filter(round__in=of, points__gt=0):
        key = of[row.round_id]
        results[key].append(RoundRank(row.racer_id, rounds[key][row.round_id], row.rank, row.points))
    found: dict[int, dict[str, list[RacerStanding]]] = {pk: {} for pk in by_id}
    for (season, division), points in results.items():
        found[season][division] = Standings(by_id[season].drop_worst).lines(points, len(rounds[season, division]))
    return found


def points_as_they_stand(round_: Round) -> list[RoundPoints]:
    """The points that a round would give if it became official now, as rows that are not saved: one query."""
    table = PointsTable(tuple(round_.season.points))
    ranked = board_entries(round_.race).filter(CLASSIFIED, is_baseline=False)
    first = ranked.values_list("racer_id", "racer__country", "racer__team")[: len(table)]
    return [
        RoundPoints(round=round_, racer_id=racer, rank=rank, points=table.of(rank), country=country, team=team)
        for rank, (racer, country, team) in enumerate(first, start=1)
    ]


def lines_as_they_stand(season: Season, running: Sequence[Round]) -> list[RacerStanding]:
    """The standings of a division of which no round is official, by those that are on: one query for each."""
    results = [
        RoundRank(row.racer_id, number, row.rank, row.points)
        for number, round_ in enumerate(running, start=1)
        for row in points_as_they_stand(round_)
        if row.points
    ]
    return Standings(season.drop_worst).lines(results, len(running))


def _counted(season: Season, division: Division | str, running: Sequence[Round]) -> dict[int, int]:
    """The rounds of a division that give points, official ones and ``running``: their places in time by id."""
    stages = [stage for stage in WITH_POINTS if DIVISION_OF[stage] == division]
    counted = Q(closed_at__isnull=False) | Q(pk__in=[one.pk for one in running])
    rounds = season.rounds.filter(counted, stage__in=stages).order_by("race__closes_at", "pk")
    return {pk: place for place, pk in enumerate(rounds.values_list("pk", flat=True), start=1)}


def _results(
    rounds: dict[int, int], running: Sequence[Round], holder: Callable[[RoundPoints], Hashable]
) -> Iterable[RoundRank]:
    standing = [row for round_ in running for row in points_as_they_stand(round_)]
    for row in (*RoundPoints.objects.filter(round__in=rounds, points__gt=0), *standing):
        if row.round_id in rounds and row.points:
            yield RoundRank(holder(row), rounds[row.round_id], row.rank, row.points)
