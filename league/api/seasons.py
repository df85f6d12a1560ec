"""Seasons: their settings and rules, their rounds, their standings, and a racer's way through one."""

from __future__ import annotations

from typing import Any

from django.db.models import QuerySet
from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, extend_schema, extend_schema_view
from rest_framework import generics, serializers
from rest_framework.permissions import AllowAny, IsAuthenticatedOrReadOnly
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.regions import all_regions
from league.models import Season, Stage
from league.selectors import months_of, racer_season
from league.selectors.overview import (
    RACERS,
    STANDINGS_OF,
    MonthRace,
    divisions_with_points,
    month_races,
    seasons_listed,
    standings_table,
    standpoint_of,
)
from league.selectors.racers import racer_shown
from races.models import Division

from .organising import RoundsWrite, SeasonsWrite, SeasonWrite, season_shown
from .season_serializers import (
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
        responses=SeasonSerializer,
        tags=["seasons"],
    )
)
class SeasonsView(SeasonsWrite, generics.ListAPIView):
    """All seasons."""

    permission_classes = [IsAuthenticatedOrReadOnly]
    serializer_class = SeasonSerializer

    def get_queryset(self) -> QuerySet[Season]:
        return seasons_listed()


class SeasonView(SeasonWrite):
    """One season."""

    permission_classes = [IsAuthenticatedOrReadOnly]

    @extend_schema(
        operation_id="read_season",
        summary="A season, its settings and its rules",
        responses=SeasonDetailSerializer,
        tags=["seasons"],
    )
    def get(self, request: Request, slug: str) -> Response:
        return Response(SeasonDetailSerializer(season_shown(slug)).data)


@extend_schema_view(
    get=extend_schema(
        operation_id="list_rounds",
        summary="The rounds of a season",
        description="Month by month, each race with its state and who leads or has won it.",
        parameters=[OpenApiParameter("stage", enum=Stage.values)],
        responses=RoundSerializer,
        tags=["seasons"],
    )
)
class RoundsView(RoundsWrite, generics.ListAPIView):
    """The rounds of a season."""

    permission_classes = [IsAuthenticatedOrReadOnly]
    serializer_class = RoundSerializer

    def get_queryset(self) -> list[MonthRace]:  # type: ignore[override]  # pages are cut from a list as well
        wanted = _choice(self.request, "stage", Stage.values)
        races = month_races(months_of(_season(self.kwargs["slug"])), timezone.now())
        return [one for one in races.values() if wanted in ("", one.round.stage)]


@extend_schema_view(
    get=extend_schema(
        operation_id="list_standings",
        summary="The standings of a season",
        description="After its official rounds; of racers unless `of` says otherwise.",
        parameters=[
            OpenApiParameter("division", enum=DIVISIONS, description="The first that has points if left out."),
            OpenApiParameter("of", enum=STANDINGS_OF),
            OpenApiParameter("region", description="Of racers: those of one region among each other, by its name."),
        ],
        responses=StandingSerializer,
        tags=["seasons"],
    )
)
class StandingsView(generics.ListAPIView):
    """Standings of racers, countries, regions and teams."""

    permission_classes = [AllowAny]
    serializer_class = StandingSerializer

    def get_queryset(self) -> list[dict[str, Any]]:  # type: ignore[override]  # as above
        of = _choice(self.request, "of", STANDINGS_OF) or RACERS
        wanted = _choice(self.request, "division", DIVISIONS)
        season = _season(self.kwargs["slug"])
        months = months_of(season)
        kept = divisions_with_points(months) or [Division.OPEN]
        region = _choice(self.request, "region", all_regions())
        table = standings_table(season, wanted or kept[0], of, months, region=region)
        return [
            {
                "place": row.place,
                "name": row.name,
                "country": "" if row.racer is None else row.racer.country,
                "points": row.points,
                "rounds": [
                    _cell(round_.race.slug, cell[0], cell[1])
                    for round_, cell in zip(table.rounds, row.cells, strict=True)
                    if cell is not None
                ],
            }
            for row in table.rows
        ]


class RacerSeasonView(APIView):
    """A racer's way through a season."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="read_racer_season",
        summary="A racer's season",
        description="Every round that they are in, in the order of closing.",
        responses=RacerSeasonSerializer,
        tags=["seasons"],
    )
    def get(self, request: Request, slug: str, alias: str) -> Response:
        season, racer = _season(slug), racer_shown(alias)
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


def _cell(race: str, result: Any, dropped: bool) -> dict[str, Any]:
    return {"race": race, "rank": result.rank, "points": result.points, "dropped": dropped}


def _season(slug: str) -> Season:
    return get_object_or_404(Season, slug=slug)


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
