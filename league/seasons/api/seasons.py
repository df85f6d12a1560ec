"""API operations that read seasons: settings, rules, rounds, standings and a racer's season."""

from django.db.models import QuerySet
from django.http import Http404
from django.utils import timezone
from rest_framework import serializers
from rest_framework.request import Request

from accounts.profile.regions import all_regions
from core.api.fields import ChoiceField
from core.api.operations import operation
from core.api.views import APIView
from league.models import Season, Stage
from league.racers.selectors import racer_shown
from league.seasons.selectors import MonthRace, month_races, racer_season, seasons_listed, standpoint_of
from league.standings.exports import StandingsLine, standings_lines
from league.standings.selectors.months import shared_months, shared_season
from league.standings.selectors.standings import RACERS, STANDINGS_OF
from league.standings.selectors.tables import divisions_with_points, standings_table
from races.models import Division

from .organising import RoundsWrite, SeasonsWrite, SeasonWrite, season_shown
from .serializers import (
    DIVISIONS,
    RacerSeasonSerializer,
    RoundSerializer,
    SeasonDetailSerializer,
    SeasonSerializer,
    StandingSerializer,
)


class RoundsFilter(serializers.Serializer):
    """Which rounds to list."""

    stage = serializers.ChoiceField(Stage.values, required=False)


class StandingsFilter(serializers.Serializer):
    """Which standings."""

    division = serializers.ChoiceField(DIVISIONS, required=False, help_text="The first that has points if left out.")
    of = serializers.ChoiceField(STANDINGS_OF, default=RACERS)
    region = ChoiceField(
        lambda: list(all_regions()),
        required=False,
        help_text="Of racers: those of one region among each other, by its name.",
    )


class SeasonsView(SeasonsWrite):
    @operation("list_seasons", "Seasons", answer=SeasonSerializer, paged=True, description="The latest first.")
    def get(self, request: Request) -> QuerySet[Season]:
        return seasons_listed()


class SeasonView(SeasonWrite):
    @operation("read_season", "A season, its settings and its rules", answer=SeasonDetailSerializer)
    def get(self, request: Request, slug: str) -> Season:
        return season_shown(slug)


class RoundsView(RoundsWrite):
    @operation(
        "list_rounds",
        "The rounds of a season",
        query=RoundsFilter,
        answer=RoundSerializer,
        paged=True,
        description="Month by month, each race with its state and its leader or winner.",
    )
    def get(self, request: Request, slug: str, asked: dict[str, str]) -> list[MonthRace]:
        races = month_races(shared_months(slug), timezone.now())
        return [one for one in races.values() if asked.get("stage") in (None, one.round.stage)]


class StandingsView(APIView):
    @operation(
        "list_standings",
        "The standings of a season",
        query=StandingsFilter,
        answer=StandingSerializer,
        paged=True,
        description="After its official rounds; of racers unless `of` names another kind.",
    )
    def get(self, request: Request, slug: str, asked: dict[str, str]) -> list[StandingsLine]:
        season = shared_season(slug)
        months = shared_months(season.slug)
        division = asked.get("division") or (divisions_with_points(months) or [Division.OPEN])[0]
        table = standings_table(season, division, asked["of"], months, region=asked.get("region", ""))
        lines = standings_lines(table, division, asked["of"])
        return [{**line, "rounds": [cell for cell in line["rounds"] if cell is not None]} for line in lines]


class RacerSeasonView(APIView):
    @operation(
        "read_racer_season",
        "A racer's season",
        answer=RacerSeasonSerializer,
        description="Every round that they are in, in the order of closing.",
    )
    def get(self, request: Request, slug: str, alias: str) -> dict[str, object]:
        season, racer = shared_season(slug), racer_shown(alias)
        if racer is None:
            raise Http404
        rows, where = racer_season(season, racer), standpoint_of(season, racer)
        promoted, place = where.promoted_in, where.championship
        return {
            "season": season.slug,
            "racer": racer.alias,
            "division": where.division,
            "promoted_in": None if promoted is None else promoted.race.slug,
            "qualified_in": None if place is None else place.round.race.slug,
            "standings": where.lines,
            "rounds": rows,
        }
