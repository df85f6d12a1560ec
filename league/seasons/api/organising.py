"""API operations of admins on seasons, the rules of their stages and their rounds."""

from collections.abc import Callable
from typing import Any

from django.contrib.admin.models import ADDITION, CHANGE, DELETION
from django.db import transaction
from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema
from rest_framework import serializers, status
from rest_framework.exceptions import PermissionDenied
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE
from core.api.bodies import Body, read_as
from core.api.finding import finds
from core.api.views import APIView
from league.models import Round, Season, Stage
from league.seasons.selectors import month_races, seasons_listed
from league.seasons.services import seasons
from league.seasons.services.succession import MOST_MONTHS, copy_season
from league.standings.selectors.months import months_of
from paddock.rules.race import STAGE
from races.models import Division
from races.pages.api.races import NewRaceSerializer
from races.rules.serializers import with_rules
from races.web.audit_log import log

from .serializers import RoundSerializer, SeasonDetailSerializer, StageRulesSerializer

# The model checks these in whole; here they are only read.
_POINTS = serializers.IntegerField(min_value=0, max_value=10_000)


class SeasonChangeSerializer(Body):
    """What may be changed of a season."""

    name = serializers.CharField(max_length=64, required=False)
    starts_on = serializers.DateField(required=False)
    ends_on = serializers.DateField(required=False, help_text="The last day.")
    promotion_percent = serializers.DecimalField(max_digits=4, decimal_places=1, required=False)
    finale_size = serializers.IntegerField(min_value=1, max_value=1000, required=False)
    championship_places = serializers.IntegerField(min_value=1, max_value=1000, required=False)
    points = serializers.ListField(child=_POINTS, min_length=1, max_length=200, required=False)
    drop_worst = serializers.IntegerField(min_value=0, max_value=1000, required=False)
    steward_hours = serializers.IntegerField(min_value=0, max_value=24 * 60, required=False)
    prizes = serializers.CharField(allow_blank=True, max_length=4000, required=False)
    continues = serializers.BooleanField(
        required=False, help_text="Whether the season that follows is drafted 60 days ahead."
    )
    edition = serializers.CharField(
        max_length=64,
        required=False,
        help_text="As the season was read: the change is refused if somebody else has changed it since.",
    )


class NewSeasonSerializer(SeasonChangeSerializer):
    """A season. What is left out has the default that a read season shows."""

    slug = serializers.SlugField(max_length=50, help_text="In its address; stays.")
    name = serializers.CharField(max_length=64)
    starts_on = serializers.DateField()
    ends_on = serializers.DateField(help_text="The last day.")
    edition = None  # type: ignore[assignment]  # so a field of the base is left out


class SeasonCopySerializer(Body):
    """When the copy of a season is, and what it is called."""

    months = serializers.IntegerField(
        min_value=1,
        max_value=MOST_MONTHS,
        required=False,
        allow_null=True,
        help_text="Calendar months later; left out: a year, or more where the seasons would overlap.",
    )
    name = serializers.CharField(max_length=64, required=False, help_text="Left out: with the later year.")
    slug = serializers.SlugField(max_length=50, required=False, help_text="Left out: with the later year.")


class StageChangeSerializer(with_rules(Body, STAGE, asked=True)):  # type: ignore[misc]
    """Rules of a stage; what is left out stays as it is."""


class NewRoundSerializer(NewRaceSerializer):
    """A league race and the round that it is. Rules left out are those of the season's stage."""

    number = serializers.IntegerField(min_value=1, max_value=1000, help_text="Of the round; its races share it.")
    month = serializers.CharField(max_length=64, allow_blank=True, required=False, help_text="The round's name.")
    stage = serializers.ChoiceField(Stage.choices)
    slug = serializers.SlugField(max_length=64, required=False, help_text="In the race's address.")
    division = serializers.ChoiceField(Division.choices, required=False, help_text="The stage's if left out.")
    visibility = None  # type: ignore[assignment]  # so a field of the base is left out


def season_shown(slug: str) -> Season:
    """A season with all that its serializer shows; 404 where there is none."""
    return get_object_or_404(seasons_listed().prefetch_related("stage_rules"), slug=slug)


def round_at(slug: str, race: str) -> Round:
    """A round of a season by the slug of its race. Raises Http404."""
    return get_object_or_404(Round.objects.select_related("season", "race"), season__slug=slug, race__slug=race)


def stage_at(slug: str, stage: str) -> tuple[Season, str]:
    """A season and one of its stages. Raises Http404."""
    season = season_shown(slug)
    if stage not in Stage.values:
        raise Http404
    return season, stage


def requires(*permissions: str, find: Callable[..., Any] = lambda: None) -> Callable[..., Any]:
    """A lookup by ``find`` for admins with all these permissions. It raises PermissionDenied for everybody else."""

    def found(request: Request, **named: str) -> Any:
        thing = find(**named)
        if not (request.user.is_staff and request.user.has_perms(permissions)):
            raise PermissionDenied()
        return thing

    return found


class SeasonsWrite(APIView):
    """Making seasons; joined to the list of them in :mod:`league.seasons.api.seasons`."""

    token_scope = ORGANISE

    @extend_schema(
        operation_id="create_season",
        summary="Make a season, for admins",
        request=NewSeasonSerializer,
        responses={201: SeasonDetailSerializer},
    )
    @finds(requires("league.add_season"))
    def post(self, request: Request, _none: None) -> Response:
        season = seasons.create_season(**read_as(NewSeasonSerializer, request.data))
        log(racer_of(request), season, ADDITION, "Made through the API")
        return Response(SeasonDetailSerializer(season_shown(season.slug)).data, status=status.HTTP_201_CREATED)


class SeasonWrite(APIView):
    """Changing a season; joined to reading it."""

    token_scope = ORGANISE

    @extend_schema(
        operation_id="edit_season",
        summary="Change a season, for admins",
        description="What official results were worked out from is fixed from the first official round on.",
        request=SeasonChangeSerializer,
        responses=SeasonDetailSerializer,
    )
    @finds(requires("league.change_season", find=season_shown))
    def patch(self, request: Request, season: Season) -> Response:
        season = seasons.edit_season(season=season, **read_as(SeasonChangeSerializer, request.data))
        log(racer_of(request), season, CHANGE, "Changed through the API")
        return Response(SeasonDetailSerializer(season_shown(season.slug)).data)

    @extend_schema(
        operation_id="delete_season",
        summary="Delete a season and its races, for admins",
        description="As long as no race of it has opened or has entries.",
    )
    @finds(requires("league.delete_season", find=season_shown), fields=False)
    def delete(self, request: Request, season: Season) -> Response:
        with transaction.atomic():
            log(racer_of(request), season, DELETION, "Deleted through the API")
            seasons.delete_season(season=season, now=timezone.now())
        return Response(status=status.HTTP_204_NO_CONTENT)


class SeasonCopyView(APIView):
    token_scope = ORGANISE

    @extend_schema(
        operation_id="copy_season",
        summary="Copy a season to later months, for admins",
        description="Settings, rules and races, without entries. The first copy that begins after the season continues "
        "it: its divisions are carried over. Races that would be over are left out.",
        request=SeasonCopySerializer,
        responses={201: SeasonDetailSerializer},
    )
    @finds(requires("league.add_season", find=season_shown))
    def post(self, request: Request, season: Season) -> Response:
        copied = copy_season(season=season, now=timezone.now(), **read_as(SeasonCopySerializer, request.data))
        log(racer_of(request), copied.season, ADDITION, f"Copied from {season.slug} through the API")
        shown = season_shown(copied.season.slug)
        return Response(SeasonDetailSerializer(shown).data, status=status.HTTP_201_CREATED)


class RoundView(APIView):
    token_scope = ORGANISE

    @extend_schema(
        operation_id="delete_round",
        summary="Delete a round and its race, for admins",
        description="As long as the race has neither opened nor entries.",
    )
    @finds(requires("league.change_season", "races.delete_race", find=round_at), fields=False)
    def delete(self, request: Request, round_: Round) -> Response:
        race = round_.race.slug
        seasons.delete_round(round=round_, now=timezone.now())
        log(racer_of(request), round_.season, CHANGE, f"Deleted the race {race} through the API")
        return Response(status=status.HTTP_204_NO_CONTENT)


class StageRulesView(APIView):
    token_scope = ORGANISE

    @extend_schema(
        operation_id="edit_stage_rules",
        summary="Say how races of a stage are ranked and limited, for admins",
        description="From now on: races that are made already stay as they are.",
        request=StageChangeSerializer,
        responses=StageRulesSerializer,
    )
    @finds(requires("league.change_season", find=stage_at))
    def patch(self, request: Request, found: tuple[Season, str]) -> Response:
        season, stage = found
        rules = seasons.set_stage_rules(season=season, stage=stage, **read_as(StageChangeSerializer, request.data))
        log(racer_of(request), season, CHANGE, f"Rules of {rules.stage} changed through the API")
        return Response(StageRulesSerializer(rules).data)


class RoundsWrite(APIView):
    """Scheduling rounds; joined to the list of them."""

    token_scope = ORGANISE

    @extend_schema(
        operation_id="create_round",
        summary="Make a league race and the round of the season that it is, for admins",
        description="The race is changed and cancelled like any other, at its own address.",
        request=NewRoundSerializer,
        responses={201: RoundSerializer},
    )
    @finds(requires("league.change_season", "races.add_race", find=season_shown))
    def post(self, request: Request, season: Season) -> Response:
        now = timezone.now()
        made = seasons.schedule_round(season=season, now=now, **read_as(NewRoundSerializer, request.data))
        log(racer_of(request), made.race, ADDITION, f"Round {made.number} of {season.name}, made through the API")
        shown = month_races(months_of(season), now)[made.pk]
        return Response(RoundSerializer(shown).data, status=status.HTTP_201_CREATED)
