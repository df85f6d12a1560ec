"""API operations that read seasons: settings, rules, rounds, standings and a racer's season."""

from typing import Any

from django.db.models import QuerySet
from django.http import Http404
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, extend_schema, extend_schema_view
from rest_framework import serializers
from rest_framework.permissions import IsAuthenticatedOrReadOnly
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.profile.regions import all_regions
from core.api.views import APIView, ListAPIView
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


@extend_schema_view(
    get=extend_schema(
        operation_id="list_seasons",
        summary="Seasons",
        description="The latest first.",
    )
)
class SeasonsView(SeasonsWrite, ListAPIView):
    permission_classes = [IsAuthenticatedOrReadOnly]
    serializer_class = SeasonSerializer

    def get_queryset(self) -> QuerySet[Season]:
        return seasons_listed()


class SeasonView(SeasonWrite):
    permission_classes = [IsAuthenticatedOrReadOnly]

    @extend_schema(
        operation_id="read_season",
        summary="A season, its settings and its rules",
        responses=SeasonDetailSerializer,
    )
    def get(self, request: Request, slug: str) -> Response:
        return Response(SeasonDetailSerializer(season_shown(slug)).data)


@extend_schema_view(
    get=extend_schema(
        operation_id="list_rounds",
        summary="The rounds of a season",
        description="Month by month, each race with its state and its leader or winner.",
        parameters=[OpenApiParameter("stage", enum=Stage.values)],
    )
)
class RoundsView(RoundsWrite, ListAPIView):
    permission_classes = [IsAuthenticatedOrReadOnly]
    serializer_class = RoundSerializer

    def get_queryset(self) -> list[MonthRace]:  # type: ignore[override]  # pages are cut from a list as well
        wanted = _choice(self.request, "stage", Stage.values)
        races = month_races(shared_months(self.kwargs["slug"]), timezone.now())
        return [one for one in races.values() if wanted in ("", one.round.stage)]


@extend_schema_view(
    get=extend_schema(
        operation_id="list_standings",
        summary="The standings of a season",
        description="After its official rounds; of racers unless `of` names another kind.",
        parameters=[
            OpenApiParameter("division", enum=DIVISIONS, description="The first that has points if left out."),
            OpenApiParameter("of", enum=STANDINGS_OF),
            OpenApiParameter("region", description="Of racers: those of one region among each other, by its name."),
        ],
    )
)
class StandingsView(ListAPIView):
    serializer_class = StandingSerializer

    def get_queryset(self) -> list[StandingsLine]:  # type: ignore[override]  # as above
        of = _choice(self.request, "of", STANDINGS_OF) or RACERS
        wanted = _choice(self.request, "division", DIVISIONS)
        season = shared_season(self.kwargs["slug"])
        months = shared_months(season.slug)
        kept = divisions_with_points(months) or [Division.OPEN]
        region = _choice(self.request, "region", all_regions())
        table = standings_table(season, wanted or kept[0], of, months, region=region)
        lines = standings_lines(table, wanted or kept[0], of)
        return [{**line, "rounds": [cell for cell in line["rounds"] if cell is not None]} for line in lines]


class RacerSeasonView(APIView):
    @extend_schema(
        operation_id="read_racer_season",
        summary="A racer's season",
        description="Every round that they are in, in the order of closing.",
        responses=RacerSeasonSerializer,
    )
    def get(self, request: Request, slug: str, alias: str) -> Response:
        season, racer = shared_season(slug), racer_shown(alias)
        if racer is None:
            raise Http404
        rows, where = racer_season(season, racer), standpoint_of(season, racer)
        promoted, place = where.promoted_in, where.championship
        data = {
            "season": season.slug,
            "racer": racer.alias,
            "division": where.division,
            "promoted_in": None if promoted is None else promoted.race.slug,
            "qualified_in": None if place is None else place.round.race.slug,
            "standings": where.lines,
            "rounds": rows,
        }
        return Response(RacerSeasonSerializer(data).data)


def _choice(request: Request, name: str, known: Any) -> str:
    """The value of a query parameter, "" where there is none. Raises ValidationError for one that is not known."""
    wanted = request.query_params.get(name, "")
    if wanted:
        field = serializers.ChoiceField(choices=list(known))
        try:
            return field.run_validation(wanted)
        except serializers.ValidationError as refused:
            raise serializers.ValidationError({name: refused.detail}) from None
    return ""
