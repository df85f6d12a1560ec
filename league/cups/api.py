"""API operations on cups of the day, and on the car that starts automatically."""

from django.db.models import QuerySet
from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from rest_framework import serializers
from rest_framework.request import Request

from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.bodies import Body
from core.api.fields import ComputedField
from core.api.operations import operation
from core.api.views import APIView, PrivateView
from evaluation.selectors import models_of
from league.cups.selectors import cups_listed, division_places, stage_of, starter_of
from league.cups.services import start_always, start_no_more
from league.cups.views import cup_of
from league.models import Cup, CupStarter

STAGES = ("upcoming", "qualifying", "knock_out", "over", "cancelled")


class CupSerializer(serializers.Serializer):
    """A day's cup."""

    day = serializers.DateField()
    stage = ComputedField(serializers.ChoiceField(STAGES), lambda cup: stage_of(cup, timezone.now()))
    race = serializers.CharField(source="race.slug", help_text="Its qualifying.")
    track = serializers.CharField(source="race.track.slug")
    direction = serializers.CharField(source="race.direction")
    opens_at = serializers.DateTimeField(source="race.opens_at")
    closes_at = serializers.DateTimeField(source="race.closes_at", help_text="The qualifying.")
    racers = serializers.IntegerField(help_text="Number of racers with a place; 0 before it is over.")


class CupPlaceSerializer(serializers.Serializer):
    """Where a racer ended."""

    place = serializers.IntegerField()
    racer = serializers.CharField(source="racer.alias")
    qualified = serializers.IntegerField(help_text="The place in the qualifying.")


class CupDivisionSerializer(serializers.Serializer):
    """A division of a cup."""

    number = serializers.IntegerField()
    race = serializers.CharField(allow_null=True, help_text="Its knock-out.")
    places = CupPlaceSerializer(many=True, help_text="Empty before the cup is over.")


class CupDetailSerializer(CupSerializer):
    """A day's cup with its divisions."""

    divisions = ComputedField(
        CupDivisionSerializer(many=True),
        lambda cup: [
            {"number": number, "race": None if race is None else race.slug, "places": places}
            for number, race, places in division_places(cup)
        ],
    )


class StarterSerializer(serializers.Serializer):
    """The car that starts in every cup."""

    model = serializers.CharField(source="model.public_id")
    name = serializers.CharField(source="model.name")
    since = serializers.DateTimeField()


class StarterBody(Body):
    """Which car is to start."""

    model = serializers.CharField(max_length=12, help_text="A model of yours: its public id.")


class CupsView(APIView):
    @operation("list_cups", "Cups of the day, the latest first", answer=CupSerializer, paged=True)
    def get(self, request: Request) -> QuerySet[Cup]:
        return cups_listed()


class CupView(APIView):
    @operation("read_cup", "A day's cup and its winners", answer=CupDetailSerializer)
    def get(self, request: Request, day: str) -> Cup:
        return cup_of(day)


class CupStarterView(PrivateView):
    token_scope = RACE

    @operation("read_cup_starter", "The car of mine that starts in every cup", answer=StarterSerializer)
    def get(self, request: Request) -> CupStarter:
        starter = starter_of(racer_of(request))
        if starter is None:
            raise Http404
        return starter

    @operation(
        "choose_cup_starter",
        "Let a car start in every cup from the next one on",
        body=StarterBody,
        answer=StarterSerializer,
    )
    def put(self, request: Request, sent: dict[str, str]) -> CupStarter:
        racer = racer_of(request)
        model = get_object_or_404(models_of(racer), public_id=sent["model"])
        return start_always(racer=racer, model=model, now=timezone.now())

    @operation("drop_cup_starter", "Let no car of mine start in cups by itself")
    def delete(self, request: Request) -> None:
        start_no_more(racer=racer_of(request))
