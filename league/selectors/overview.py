"""Seasons as their pages show them: what is on, who stands where, whose the fields are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from django.db.models import Count, Exists, OuterRef, Q, QuerySet
from django.utils import timezone

from accounts.groups.selectors import groups_visible_to
from accounts.models import Racer, RacerGroup
from races.models import Division, Race, RaceState
from races.selectors import BoardRow, podiums

from ..models import ChampionshipPlace, FinalePlace, Membership, Round, RoundPoints, Season, Stage
from ..rules import RacerStanding, RoundRank
from .outcomes import outcome_of
from .seasons import Month
from .standings import (
    country_standings,
    group_standings,
    lines_as_they_stand,
    points_as_they_stand,
    region_standings,
    season_standings,
    standings_of,
    standings_within,
    team_key,
    team_standings,
)

RACERS, COUNTRIES, REGIONS, TEAMS = "racers", "countries", "regions", "teams"
STANDINGS_OF = (RACERS, COUNTRIES, REGIONS, TEAMS)
# The stage whose rounds give the points of a division.
STAGE_OF = {Division.PRO: Stage.PRO, Division.OPEN: Stage.OPEN, Division.ALL: Stage.SINGLE}


@dataclass(frozen=True)
class MonthRace:
    """One race of a season: its state at the moment of asking, and who leads or has won it (None: nobody yet)."""

    round: Round
    state: RaceState
    leader: BoardRow | None

    @property
    def race(self) -> Race:
        return self.round.race


@dataclass(frozen=True)
class StandingsRow:
    """One line of standings for a page. ``name``: of a racer, country (code), region or team.

    ``cells``: for each round of the table in its order the result and whether it is dropped; None where none is.
    """

    place: int
    name: str
    racer: Racer | None
    points: int
    cells: list[tuple[RoundRank, bool] | None]


@dataclass(frozen=True)
class StandingsTable:
    """Standings with a column for each round that counts. ``rounds``: in their order, the latest last.

    ``is_provisional``: whether rounds that are not official yet count as they stand.
    """

    rounds: list[Round]
    rows: list[StandingsRow]
    is_provisional: bool = False


@dataclass(frozen=True)
class QualifiedField:
    """Whose a finale or the championship is. ``places``: place and racer; ``official``: or as it stands now."""

    round: Round | None
    places: list[tuple[int, Racer]]
    official: bool


@dataclass(frozen=True)
class MonthFields:
    """The field of a month's finale, and who qualifies in it."""

    month: Month
    finale: QualifiedField
    qualified: QualifiedField

    def is_over(self) -> bool:
        """Whether nothing of it will change: the finale, or the pro race without one, is official or cancelled."""
        last = self.qualified.round or self.finale.round
        return last is not None and (last.closed_at is not None or last.race.cancelled_at is not None)

    def has_begun(self, now: datetime) -> bool:
        """Whether the race that its field comes from has opened."""
        first = self.finale.round or self.qualified.round
        return first is not None and first.race.state_at(now) in (RaceState.OPEN, RaceState.CLOSED)


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
    """The season of this day; between seasons the next one, after all of them the last one.

    Of several that run, one with an open race comes first, then one with a race still to come, then the latest begun.
    """
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
    """The races of these months by the id of their round, with who leads or has won: two queries."""
    rounds = [one for month in months for one in month]
    leaders = podiums([one.race for one in rounds], size=1)
    return {one.pk: MonthRace(one, one.race.state_at(now), next(iter(leaders[one.race_id]), None)) for one in rounds}


def standings_table(
    season: Season,
    division: str,
    of: str,
    months: Sequence[Month],
    running: Sequence[Round] = (),
    group: RacerGroup | None = None,
    region: str = "",
) -> StandingsTable:
    """The standings of ``of`` (one of STANDINGS_OF) in a division with every official round, and with those of
    ``running`` as they stand; those of racers of one ``group``, or of one ``region``, among each other.

    Three queries, four for teams; for each of ``running`` one more, two for teams.
    """
    by = {
        RACERS: season_standings,
        COUNTRIES: country_standings,
        REGIONS: region_standings,
        TEAMS: team_standings,
    }[of]
    if group is not None and of == RACERS:
        lines = group_standings(season, division, group, running)
    elif region and of == RACERS:
        lines = standings_within(season, division, region, running)
    else:
        lines = by(season, division, running)
    rounds = _counted_rounds(months, division, running)
    spelled = _spellings(rounds, running) if of == TEAMS else {}
    racers = Racer.objects.in_bulk([line.who for line in lines]) if of == RACERS else {}
    rows = []
    for line in lines:
        results = {result.round: result for result in line.results}
        cells = [
            None if number not in results else (results[number], number in line.dropped)
            for number in range(1, len(rounds) + 1)
        ]
        racer, who = racers.get(line.who), str(line.who)
        name = racer.shown_name if racer else spelled.get(who, who)
        rows.append(StandingsRow(line.place, name, racer, line.points, cells))
    return StandingsTable(rounds, rows, bool(running))


def groups_raced(season: Season, viewer: Any, most: int = 12) -> list[RacerGroup]:
    """The groups that the reader knows of, of which somebody is in a race of the season: one query."""
    racing = {"members__confirmed_at__isnull": False, "members__racer__entries__race__round__season": season}
    return list(groups_visible_to(viewer).filter(**racing).distinct().order_by("-is_listed", "name", "pk")[:most])


@dataclass(frozen=True)
class Leaders:
    """The first of a division's standings. ``is_provisional``: of rounds that are not official, as they stand."""

    division: Division
    rows: list[tuple[RacerStanding, Racer]]
    is_provisional: bool


def leaders_shown(season: Season, size: int, months: Sequence[Month], now: datetime) -> list[Leaders]:
    """The first of the standings of each division, the pro division first: three queries.

    Where nobody has points yet they are of the races that have opened, as these stand: one query for each of them.
    """
    lines = {division: own[:size] for division, own in standings_of([season])[season.pk].items()}
    official = frozenset(lines)
    for division in divisions_with_points(months):
        running = [] if division in official else running_rounds(months, division, now)
        if running:
            lines[division] = lines_as_they_stand(season, running)[:size]
    racers = Racer.objects.in_bulk({line.who for own in lines.values() for line in own})
    return [
        Leaders(name, [(line, racers[line.who]) for line in lines[name]], name not in official)
        for name in (Division.PRO, Division.OPEN, Division.ALL)
        if lines.get(name)
    ]


def running_rounds(months: Iterable[Month], division: str, now: datetime) -> list[Round]:
    """The rounds of a division that give points, whose races have opened and whose results are not official yet."""
    started = (RaceState.OPEN, RaceState.CLOSED)
    return [
        one
        for month in months
        for one in month
        if one.stage == STAGE_OF[Division(division)] and one.closed_at is None and one.race.state_at(now) in started
    ]


def divisions_with_points(months: Iterable[Month]) -> list[Division]:
    """The divisions that a season's standings are kept for, in their usual order."""
    stages = {one.stage for month in months for one in month}
    return [division for division, stage in STAGE_OF.items() if stage in stages]


def fields_of(season: Season, months: Sequence[Month], now: datetime) -> tuple[list[MonthFields], QualifiedField]:
    """The fields of a season's finales, the latest month first, and the field of its championship.

    What is official is read; of races that have opened and are not official it is worked out as it stands. Four
    queries, and at most four more for each race that is open or waits to become official.
    """
    finales: dict[int, list] = {}
    for place in FinalePlace.objects.filter(round__season=season).order_by("place"):
        finales.setdefault(place.round_id, []).append((place.place, place.racer_id))
    qualified: dict[int, list] = {}
    everybody = ChampionshipPlace.objects.filter(season=season).order_by("round__race__closes_at", "place")
    for one in everybody:
        qualified.setdefault(one.round_id, []).append((one.place, one.racer_id))
    found: list[tuple[Month, Any, Any]] = []
    for month in months:
        if month.pro is None and month.finale is None:
            continue
        field_ = _field(month.pro, season, finales, lambda outcome: outcome.finale, now)
        winners = _field(month.finale, season, qualified, lambda outcome: outcome.qualified, now)
        found.append((month, field_, winners))
    ids = {racer for _month, *both in found for _round, places, _official in both for _place, racer in places}
    racers = Racer.objects.in_bulk(ids | {one.racer_id for one in everybody})

    def made(parts: tuple) -> QualifiedField:
        round_, places, official = parts
        return QualifiedField(round_, [(place, racers[racer]) for place, racer in places], official)

    shown = [MonthFields(month, made(field_), made(winners)) for month, field_, winners in reversed(found)]
    final = next((one for month in months for one in month if one.stage == Stage.CHAMPIONSHIP), None)
    total = [(number, racers[one.racer_id]) for number, one in enumerate(everybody, start=1)]
    return shown, QualifiedField(final, total, bool(total))


@dataclass(frozen=True)
class FieldsInTime:
    """The months of a season's finales as one reads them. ``next``: those that are on, the next finale first, or the
    one that comes where none is; ``coming``: after these, in time; ``past``: the latest first."""

    next: list[MonthFields]
    coming: list[MonthFields]
    past: list[MonthFields]


def fields_in_time(months: Iterable[MonthFields], now: datetime) -> FieldsInTime:
    """The months of :func:`fields_of` from the next finale on, and those that are over."""
    months = list(months)
    left = [one for one in reversed(months) if not one.is_over()]
    shown = [one for one in left if one.has_begun(now)] or left[:1]
    coming = [one for one in left if one not in shown]
    return FieldsInTime(shown, coming, [one for one in months if one.is_over()])


def standpoint_of(season: Season, racer: Racer) -> Standpoint:
    """Where a racer stands in a season: four queries."""
    member = Membership.objects.filter(season=season, racer=racer).select_related("promoted_in__race").first()
    place = ChampionshipPlace.objects.filter(season=season, racer=racer).select_related("round__race").first()
    lines = {
        name: line for name, own in standings_of([season])[season.pk].items() for line in own if line.who == racer.pk
    }
    division = Division.OPEN if member is None else Division(member.division)
    return Standpoint(division, None if member is None else member.promoted_in, place, lines)


def _counted_rounds(months: Sequence[Month], division: str, running: Sequence[Round]) -> list[Round]:
    """In the order that the standings number them by."""
    rounds = [
        one
        for month in months
        for one in month
        if one.stage == STAGE_OF[Division(division)] and (one.closed_at is not None or one in running)
    ]
    return sorted(rounds, key=lambda one: (one.race.closes_at, one.pk))


def _spellings(rounds: Sequence[Round], running: Sequence[Round]) -> dict[str, str]:
    """How the racers of each team write its name, the latest of several spellings: what standings add up as one."""
    teams = RoundPoints.objects.filter(round__in=rounds).exclude(team="").order_by("round__race__closes_at", "-rank")
    now = [row.team for one in running for row in reversed(points_as_they_stand(one)) if row.team]
    return {team_key(team): " ".join(team.split()) for team in (*teams.values_list("team", flat=True), *now)}


def _field(round_: Round | None, season: Season, official: dict, chosen: Any, now: datetime) -> tuple:
    if round_ is None:
        return None, [], False
    if round_.closed_at is not None:
        return round_, official.get(round_.pk, []), True
    if round_.race.state_at(now) not in (RaceState.OPEN, RaceState.CLOSED):
        return round_, [], False
    round_.season = season
    return round_, list(enumerate(chosen(outcome_of(round_)), start=1)), False
