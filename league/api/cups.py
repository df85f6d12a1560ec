"""Cups of the day: the list, one of them, and the car that starts by itself."""

from __future__ import annotations

from typing import Any

from django.db.models import QuerySet
from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema, extend_schema_field, extend_schema_view
from rest_framework import generics, serializers, status
from rest_framework.permissions import AllowAny, IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import RACE
from accounts.who import racer_of
from core.bodies import Body, read_as, refuse_fields
from evaluation.selectors import models_of
from league.models import Cup, CupStarter
from league.selectors.cups import cups_listed, division_places, stage_of, starter_of
from league.services.cups import start_always, start_no_more
from league.views.cups import cup_of

STAGES = ("upcoming", "qualifying", "knock_out", "over", "cancelled")


class CupSerializer(serializers.Serializer):
    """A day's cup."""

    day = serializers.DateField()
    stage = serializers.SerializerMethodField()
    race = serializers.CharField(source="race.slug", help_text="Its qualifying.")
    track = serializers.CharField(source="race.track.slug")
    direction = serializers.CharField(source="race.direction")
    opens_at = serializers.DateTimeField(source="race.opens_at")
    closes_at = serializers.DateTimeField(source="race.closes_at", help_text="The qualifying.")
    racers = serializers.IntegerField(help_text="Who has a place in it; 0 before it is over.")

    @extend_schema_field(serializers.ChoiceField(STAGES))
    def get_stage(self, cup: Cup) -> str:
        return stage_of(cup, timezone.now())


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

    divisions = serializers.SerializerMethodField()

    @extend_schema_field(CupDivisionSerializer(many=True))
    def get_divisions(self, cup: Cup) -> Any:
        found = division_places(cup)
        rows = [
            {"number": number, "race": None if race is None else race.slug, "places": places}
            for number, race, places in found
        ]
        return CupDivisionSerializer(rows, many=True).data


class StarterSerializer(serializers.Serializer):
    """The car that starts in every cup."""

    model = serializers.CharField(source="model.public_id")
    name = serializers.CharField(source="model.name")
    since = serializers.DateTimeField()


class StarterBody(Body):
    """Which car is to start."""

    model = serializers.CharField(max_length=12, help_text="A model of yours: its public id.")


@extend_schema_view(
    get=extend_schema(
        operation_id="list_cups",
        summary="Cups of the day, the latest first",
        responses=CupSerializer,
        tags=["cups"],
    )
)
class CupsView(generics.ListAPIView):
    """All cups."""

    permission_classes = [AllowAny]
    serializer_class = CupSerializer

    def get_queryset(self) -> QuerySet[Cup]:
        return cups_listed()


class CupView(APIView):
    """One day's cup."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="read_cup", summary="A day's cup and who won it", responses=CupDetailSerializer, tags=["cups"]
    )
    def get(self, request: Request, day: str) -> Response:
        return Response(CupDetailSerializer(cup_of(day)).data)


class CupStarterView(APIView):
    """The car of mine that starts in every cup by itself."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="read_cup_starter",
        summary="The car of mine that starts in every cup",
        responses={200: StarterSerializer},
        tags=["cups"],
    )
    def get(self, request: Request) -> Response:
        return Response(StarterSerializer(self._starter(request)).data)

    @extend_schema(
        operation_id="choose_cup_starter",
        summary="Let a car start in every cup from the next one on",
        request=StarterBody,
        responses={200: StarterSerializer},
        tags=["cups"],
    )
    def put(self, request: Request) -> Response:
        racer = racer_of(request)
        sent = read_as(StarterBody, request.data)
        model = get_object_or_404(models_of(racer), public_id=sent["model"])
        return Response(StarterSerializer(start_always(racer=racer, model=model, now=timezone.now())).data)

    @extend_schema(
        operation_id="drop_cup_starter",
        summary="Let no car of mine start in cups by itself",
        request=None,
        responses={204: None},
        tags=["cups"],
    )
    def delete(self, request: Request) -> Response:
        refuse_fields(request)
        start_no_more(racer=racer_of(request))
        return Response(status=status.HTTP_204_NO_CONTENT)

    def _starter(self, request: Request) -> CupStarter:
        starter = starter_of(racer_of(request))
        if starter is None:
            raise Http404
        return starter
