"""A racer commands their car's speed in a live event, or lets a deputy do so."""

from __future__ import annotations

from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework import serializers
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import RACE
from accounts.who import racer_of
from core.bodies import Body, read_as
from paddock.errors import UserFault
from paddock.rules.speed import MODES

from ..models import LiveEvent, LiveRacer
from ..selectors.live_speed import live_racers_commanded_by, speed_document
from ..services.live import command_now, command_start, name_deputy
from .live import SpeedCommandSerializer, live_event


class SpeedStartSerializer(serializers.Serializer):
    """A command that is not timed yet."""

    mode = serializers.ChoiceField(MODES)
    value = serializers.FloatField()
    by = serializers.CharField()


class SpeedSerializer(serializers.Serializer):
    """The commands for a car. What comes is told with the moment of its effect; whether it does, then."""

    racer = serializers.CharField()
    deputy = serializers.CharField(allow_null=True)
    start = SpeedStartSerializer(allow_null=True, help_text="How their runs begin; null: as the model wants.")
    driving = serializers.BooleanField(help_text="Whether the car counts down or is on track.")
    played_ms = serializers.IntegerField(allow_null=True)
    log = SpeedCommandSerializer(many=True, help_text="What has taken effect in the run that is on track.")
    coming = SpeedCommandSerializer(allow_null=True)
    wished = SpeedStartSerializer(allow_null=True, help_text="What is commanded once that is over; the last wins.")
    reason = serializers.CharField(allow_blank=True, help_text="Why the last one expired.")


class SpeedAskedSerializer(Body):
    """A command."""

    racer = serializers.CharField(required=False, max_length=64, help_text="Whose car, for their deputy.")
    when = serializers.ChoiceField(["start", "now"], help_text="start: of the next runs; now: of the one on track.")
    mode = serializers.ChoiceField(MODES)
    value = serializers.FloatField(required=False, default=0.0)


class DeputySerializer(Body):
    """Who else commands."""

    deputy = serializers.CharField(allow_blank=True, max_length=64, help_text="An alias; empty takes it back.")


def commanded_racer(event: LiveEvent, request: Request, alias: str) -> LiveRacer:
    """The racer whose car the caller commands: ``alias``, else the caller. Raises UserFault, Http404."""
    racers = live_racers_commanded_by(request.user).filter(event=event)
    if not alias:
        return get_object_or_404(racers, entry__racer=request.user)
    mine = racers.filter(entry__racer__alias__iexact=alias).first()
    if mine is None:
        raise UserFault("live_speed_not_yours")
    return mine


class LiveSpeedView(APIView):
    """The speed of a car."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="read_live_speed",
        summary="What you command of a car's speed",
        parameters=[OpenApiParameter("racer", str, description="Whose car, for their deputy.")],
        responses=SpeedSerializer,
        tags=["races"],
    )
    def get(self, request: Request, slug: str) -> Response:
        event = live_event(request, slug)
        mine = commanded_racer(event, request, request.query_params.get("racer", ""))
        return Response(SpeedSerializer(speed_document(event, mine, timezone.now())).data)

    @extend_schema(
        operation_id="command_live_speed",
        summary="Command a car's speed",
        description="Of a run on track it takes effect at the moment that `coming` names, or expires there.",
        request=SpeedAskedSerializer,
        responses=SpeedSerializer,
        tags=["races"],
    )
    def post(self, request: Request, slug: str) -> Response:
        asked = read_as(SpeedAskedSerializer, request.data)
        event, now, by = live_event(request, slug), timezone.now(), racer_of(request)
        mine = commanded_racer(event, request, asked.get("racer", ""))
        command = command_start if asked["when"] == "start" else command_now
        command(event=event, racer=mine, by=by, mode=asked["mode"], value=asked["value"], now=now)
        mine.refresh_from_db()
        return Response(SpeedSerializer(speed_document(event, mine, now)).data)

    @extend_schema(
        operation_id="name_live_deputy",
        summary="Let somebody else command your car's speed as well, or nobody",
        request=DeputySerializer,
        responses=SpeedSerializer,
        tags=["races"],
    )
    def patch(self, request: Request, slug: str) -> Response:
        asked = read_as(DeputySerializer, request.data)
        event, now = live_event(request, slug), timezone.now()
        mine = name_deputy(event=event, racer=racer_of(request), alias=asked["deputy"], now=now)
        return Response(SpeedSerializer(speed_document(event, mine, now)).data)
