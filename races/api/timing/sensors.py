"""Sensors at the finish line, and the crossings that they tell."""

from __future__ import annotations

from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import OpenApiResponse, extend_schema
from rest_framework import serializers, status
from rest_framework.authentication import get_authorization_header
from rest_framework.permissions import AllowAny, IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import ANY, ORGANISE
from accounts.who import racer_of
from core.bodies import Body, read_as, refuse_fields

from ...models import CrossingVerdict, TimingSensor
from ...selectors.timing import sensors_of
from ...services import timing
from ..lookup import organised_race


class SensorSerializer(serializers.Serializer):
    """A sensor at the finish line."""

    number = serializers.IntegerField(source="pk")
    name = serializers.CharField()
    hint = serializers.CharField(help_text="How its token begins.")
    made_at = serializers.DateTimeField()
    seen_at = serializers.DateTimeField(allow_null=True)
    revoked_at = serializers.DateTimeField(allow_null=True)


class NewSensorSerializer(Body):
    """What it is called."""

    name = serializers.CharField(max_length=64)


class MadeSensorSerializer(SensorSerializer):
    """A new sensor with its token."""

    token = serializers.CharField(help_text="Shown this once.")


class CrossingSerializer(Body):
    """A car has crossed the line."""

    number = serializers.IntegerField(
        min_value=0, max_value=2**53, help_text="Counts the crossings; the same number is the same crossing."
    )
    at_ms = serializers.IntegerField(
        required=False,
        allow_null=True,
        min_value=0,
        max_value=2**53,
        help_text="The sensor's own milliseconds, which only grow. Left out: the time of receiving stands.",
    )
    boot = serializers.CharField(
        required=False,
        allow_blank=True,
        default="",
        max_length=32,
        help_text="Another one whenever the sensor starts anew and counts from the beginning.",
    )


class TakenCrossingSerializer(serializers.Serializer):
    """What it was taken for."""

    verdict = serializers.ChoiceField(CrossingVerdict.choices)
    again = serializers.BooleanField(help_text="It had come before.")
    lap = serializers.IntegerField(source="lap.number", default=None, allow_null=True)
    time_ms = serializers.IntegerField(source="lap.time_ms", default=None, allow_null=True)


class SensorsView(APIView):
    """The sensors of a race."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="list_sensors",
        summary="Sensors of a race that you organise",
        responses=SensorSerializer(many=True),
        tags=["timing"],
    )
    def get(self, request: Request, slug: str) -> Response:
        return Response(SensorSerializer(sensors_of(organised_race(request, slug)), many=True).data)

    @extend_schema(
        operation_id="make_sensor",
        summary="Make a sensor and its token",
        request=NewSensorSerializer,
        responses={201: MadeSensorSerializer},
        tags=["timing"],
    )
    def post(self, request: Request, slug: str) -> Response:
        race = organised_race(request, slug)
        sent = read_as(NewSensorSerializer, request.data)
        sensor, text = timing.make_sensor(race=race, by=racer_of(request), now=timezone.now(), **sent)
        sensor.token = text  # type: ignore[attr-defined]
        return Response(MadeSensorSerializer(sensor).data, status=status.HTTP_201_CREATED)


class SensorView(APIView):
    """One sensor."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="revoke_sensor",
        summary="Revoke a sensor's token",
        request=None,
        responses={204: OpenApiResponse(description="Revoked; what it timed stays.")},
        tags=["timing"],
    )
    def delete(self, request: Request, slug: str, number: int) -> Response:
        refuse_fields(request)
        sensor = get_object_or_404(TimingSensor, race=organised_race(request, slug), pk=number)
        timing.revoke_sensor(sensor=sensor, by=racer_of(request), now=timezone.now())
        return Response(status=status.HTTP_204_NO_CONTENT)


class CrossingsView(APIView):
    """Where sensors tell of crossings, with a token of their own."""

    token_scope = ANY  # a sensor's token is none of a racer's
    authentication_classes: list[type] = []
    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="tell_crossing",
        summary="A car has crossed the line, for sensors",
        description="With `Authorization: Bearer <token of the sensor>`. Sending a crossing again changes nothing.",
        request=CrossingSerializer,
        responses=TakenCrossingSerializer,
        auth=[],
        tags=["timing"],
    )
    def post(self, request: Request) -> Response:
        word, _, token = get_authorization_header(request).partition(b" ")
        shown = token.strip() if word.lower() in (b"bearer", b"token") else b""
        sensor = timing.sensor_with(shown.decode("ascii", "replace"))
        sent = read_as(CrossingSerializer, request.data)
        taken = timing.take_crossing(sensor=sensor, now=timezone.now(), **sent)
        return Response(TakenCrossingSerializer(taken).data)
