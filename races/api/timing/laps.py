"""Laps: corrections, and laps from a file."""

from __future__ import annotations

from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema
from rest_framework import serializers
from rest_framework.permissions import IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import ORGANISE
from accounts.who import racer_of
from core.bodies import Body, read_as

from ...measured import counted_ms, is_complete
from ...models import LapNote, MeasuredLap, Race
from ...services import timing
from ..lookup import organised_race
from .common import DAY_MS, uuid_or_404


class MeasuredLapSerializer(serializers.Serializer):
    """A lap that was measured."""

    id = serializers.UUIDField()
    number = serializers.IntegerField()
    time_ms = serializers.IntegerField(help_text="As measured.")
    counted_ms = serializers.SerializerMethodField(help_text="With penalties; null if it does not count.")
    off_tracks = serializers.IntegerField()
    resets = serializers.IntegerField()
    valid = serializers.BooleanField()
    note = serializers.ChoiceField(LapNote.choices, allow_blank=True)
    corrected = serializers.BooleanField()

    def get_counted_ms(self, lap: MeasuredLap) -> int | None:
        race: Race = self.context["race"]
        return counted_ms(race, lap) if is_complete(race, lap) else None


class CorrectionSerializer(Body):
    """What is right, and why. What is left out stays."""

    reason = serializers.CharField(max_length=255, allow_blank=True)
    time_ms = serializers.IntegerField(required=False, min_value=0, max_value=400 * DAY_MS)
    off_tracks = serializers.IntegerField(required=False, min_value=0, max_value=10**6)
    resets = serializers.IntegerField(required=False, min_value=0, max_value=10**6)
    valid = serializers.BooleanField(required=False)


class LapFileSerializer(Body):
    """A CSV file as text."""

    csv = serializers.CharField(max_length=1_000_000, trim_whitespace=False, allow_blank=True)


class TakenLapsSerializer(serializers.Serializer):
    """How many."""

    laps = serializers.IntegerField()


class LapFileView(APIView):
    """Laps from a file."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="take_laps",
        summary="Take laps from a CSV file, for who organises the race",
        description="All of them or none; `fields.csv` names each line with its reason.",
        request=LapFileSerializer,
        responses=TakenLapsSerializer,
        tags=["timing"],
    )
    def post(self, request: Request, slug: str) -> Response:
        race = organised_race(request, slug)
        text = read_as(LapFileSerializer, request.data)["csv"]
        laps = timing.take_file(race=race, by=racer_of(request), text=text, now=timezone.now())
        return Response(TakenLapsSerializer({"laps": laps}).data)


class LapView(APIView):
    """One lap."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="correct_lap",
        summary="Correct a lap of a race that you organise, or invalidate it",
        description="What stood stays in the log, with your reason, which everybody reads.",
        request=CorrectionSerializer,
        responses=MeasuredLapSerializer,
        tags=["timing"],
    )
    def patch(self, request: Request, slug: str, id: str) -> Response:
        race = organised_race(request, slug)
        laps = MeasuredLap.objects.select_related("session__entry", "session__race").filter(session__race=race)
        lap = get_object_or_404(laps, pk=uuid_or_404(id))
        sent = read_as(CorrectionSerializer, request.data)
        made = timing.correct_lap(lap=lap, by=racer_of(request), now=timezone.now(), **sent)
        return Response(MeasuredLapSerializer(made.lap, context={"race": race}).data)
