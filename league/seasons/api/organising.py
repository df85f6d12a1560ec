"""API operations of admins on seasons, the rules of their stages and their rounds."""

from collections.abc import Callable
from typing import Any, TypedDict

from django.contrib.admin.models import ADDITION, CHANGE, DELETION
from django.db import transaction
from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from rest_framework import serializers
from rest_framework.exceptions import PermissionDenied
from rest_framework.request import Request

from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE
from core.api.bodies import Body
from core.api.operations import operation
from core.api.views import APIView
from league.models import Round, Season, Stage, StageRules
from league.seasons.selectors import MonthRace, month_races, seasons_listed
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


class SentSeasonCopy(TypedDict, total=False):
    months: int | None
    name: str
    slug: str


class SeasonsWrite(APIView):
    """Making seasons; joined to the list of them in :mod:`league.seasons.api.seasons`."""

    token_scope = ORGANISE

    @operation(
        "create_season",
        "Make a season, for admins",
        find=requires("league.add_season"),
        body=NewSeasonSerializer,
        answer=SeasonDetailSerializer,
        status=201,
    )
    def post(self, request: Request, _none: None, sent: dict[str, Any]) -> Season:
        season = seasons.create_season(**sent)
        log(racer_of(request), season, ADDITION, "Made through the API")
        return season_shown(season.slug)


class SeasonWrite(APIView):
    """Changing a season; joined to reading it."""

    token_scope = ORGANISE

    @operation(
        "edit_season",
        "Change a season, for admins",
        find=requires("league.change_season", find=season_shown),
        body=SeasonChangeSerializer,
        answer=SeasonDetailSerializer,
        description="What official results were worked out from is fixed from the first official round on.",
    )
    def patch(self, request: Request, season: Season, sent: dict[str, Any]) -> Season:
        season = seasons.edit_season(season=season, **sent)
        log(racer_of(request), season, CHANGE, "Changed through the API")
        return season_shown(season.slug)

    @operation(
        "delete_season",
        "Delete a season and its races, for admins",
        find=requires("league.delete_season", find=season_shown),
        description="As long as no race of it has opened or has entries.",
    )
    def delete(self, request: Request, season: Season) -> None:
        with transaction.atomic():
            log(racer_of(request), season, DELETION, "Deleted through the API")
            seasons.delete_season(season=season, now=timezone.now())


class SeasonCopyView(APIView):
    token_scope = ORGANISE

    @operation(
        "copy_season",
        "Copy a season to later months, for admins",
        find=requires("league.add_season", find=season_shown),
        body=SeasonCopySerializer,
        answer=SeasonDetailSerializer,
        status=201,
        description="Settings, rules and races, without entries. The first copy that begins after the season continues "
        "it: its divisions are carried over. Races that would be over are left out.",
    )
    def post(self, request: Request, season: Season, sent: SentSeasonCopy) -> Season:
        copied = copy_season(season=season, now=timezone.now(), **sent)
        log(racer_of(request), copied.season, ADDITION, f"Copied from {season.slug} through the API")
        return season_shown(copied.season.slug)


class RoundView(APIView):
    token_scope = ORGANISE

    @operation(
        "delete_round",
        "Delete a round and its race, for admins",
        find=requires("league.change_season", "races.delete_race", find=round_at),
        description="As long as the race has neither opened nor entries.",
    )
    def delete(self, request: Request, round_: Round) -> None:
        race = round_.race.slug
        seasons.delete_round(round=round_, now=timezone.now())
        log(racer_of(request), round_.season, CHANGE, f"Deleted the race {race} through the API")


class StageRulesView(APIView):
    token_scope = ORGANISE

    @operation(
        "edit_stage_rules",
        "Say how races of a stage are ranked and limited, for admins",
        find=requires("league.change_season", find=stage_at),
        body=StageChangeSerializer,
        answer=StageRulesSerializer,
        description="From now on: races that are made already stay as they are.",
    )
    def patch(self, request: Request, found: tuple[Season, str], sent: dict[str, object]) -> StageRules:
        season, stage = found
        rules = seasons.set_stage_rules(season=season, stage=stage, **sent)
        log(racer_of(request), season, CHANGE, f"Rules of {rules.stage} changed through the API")
        return rules


class RoundsWrite(APIView):
    """Scheduling rounds; joined to the list of them."""

    token_scope = ORGANISE

    @operation(
        "create_round",
        "Make a league race and the round of the season that it is, for admins",
        find=requires("league.change_season", "races.add_race", find=season_shown),
        body=NewRoundSerializer,
        answer=RoundSerializer,
        status=201,
        description="The race is changed and cancelled like any other, at its own address.",
    )
    def post(self, request: Request, season: Season, sent: dict[str, Any]) -> MonthRace:
        now = timezone.now()
        made = seasons.schedule_round(season=season, now=now, **sent)
        log(racer_of(request), made.race, ADDITION, f"Round {made.number} of {season.name}, made through the API")
        return month_races(months_of(season), now)[made.pk]
