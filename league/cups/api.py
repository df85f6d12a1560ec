"""API operations on cups of the day, and on the car that starts automatically."""

from django.db.models import QuerySet
from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema, extend_schema_view
from rest_framework import serializers, status
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import RACE
from core.api.bodies import Body, read_as, refuse_fields
from core.api.fields import ComputedField
from core.api.views import APIView, ListAPIView
from evaluation.selectors import models_of
from league.cups.selectors import cups_listed, division_places, stage_of, starter_of
from league.cups.services import start_always, start_no_more
from league.cups.views import cup_of
from league.models import Cup

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


@extend_schema_view(get=extend_schema(operation_id="list_cups", summary="Cups of the day, the latest first"))
class CupsView(ListAPIView):
    serializer_class = CupSerializer

    def get_queryset(self) -> QuerySet[Cup]:
        return cups_listed()


class CupView(APIView):
    @extend_schema(operation_id="read_cup", summary="A day's cup and its winners", responses=CupDetailSerializer)
    def get(self, request: Request, day: str) -> Response:
        return Response(CupDetailSerializer(cup_of(day)).data)


class CupStarterView(APIView):
    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="read_cup_starter",
        summary="The car of mine that starts in every cup",
        responses={200: StarterSerializer},
    )
    def get(self, request: Request) -> Response:
        starter = starter_of(racer_of(request))
        if starter is None:
            raise Http404
        return Response(StarterSerializer(starter).data)

    @extend_schema(
        operation_id="choose_cup_starter",
        summary="Let a car start in every cup from the next one on",
        request=StarterBody,
        responses={200: StarterSerializer},
    )
    def put(self, request: Request) -> Response:
        racer = racer_of(request)
        sent = read_as(StarterBody, request.data)
        model = get_object_or_404(models_of(racer), public_id=sent["model"])
        return Response(StarterSerializer(start_always(racer=racer, model=model, now=timezone.now())).data)

    @extend_schema(operation_id="drop_cup_starter", summary="Let no car of mine start in cups by itself")
    def delete(self, request: Request) -> Response:
        refuse_fields(request)
        start_no_more(racer=racer_of(request))
        return Response(status=status.HTTP_204_NO_CONTENT)
