"""Sessions: what devices carry over, and what was timed."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.utils import extend_schema
from rest_framework import serializers
from rest_framework.permissions import AllowAny, IsAuthenticated
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import ORGANISE
from accounts.who import racer_of
from core.api.fields import ZonedDateTimeField
from core.bodies import Body, read_as
from core.forms import explain
from paddock.errors import UserFault

from ...models import LapNote, Race, Source, TimedSession
from ...models.timing import MOST_LAPS
from ...selectors.timing import sessions_of
from ...services import timing
from ...services.timing.laps import MOST_FAULTS
from ..lookup import visible_race
from .common import DAY_MS, timed_race, uuid_or_404
from .laps import MeasuredLapSerializer

MOST_SESSIONS = 200  # in one request


class SentLapSerializer(Body):
    """One lap as it was measured."""

    id = serializers.UUIDField(help_text="Given where the lap was measured; the same lap has the same id for ever.")
    number = serializers.IntegerField(min_value=1, max_value=MOST_LAPS)
    time_ms = serializers.IntegerField(
        min_value=0, max_value=400 * DAY_MS, help_text="By a monotonic clock, without penalties."
    )
    wall_ms = serializers.IntegerField(
        required=False,
        allow_null=True,
        min_value=-400 * DAY_MS,
        max_value=400 * DAY_MS,
        help_text="The same by the wall clock: where the two differ, a clock stood or jumped, and the lap is refused.",
    )
    off_tracks = serializers.IntegerField(min_value=0, max_value=MOST_FAULTS, default=0)
    resets = serializers.IntegerField(min_value=0, max_value=MOST_FAULTS, default=0)
    valid = serializers.BooleanField(default=True)
    note = serializers.ChoiceField(LapNote.choices, default="", allow_blank=True)


class SentGuestSerializer(Body):
    """Somebody without an account."""

    id = serializers.UUIDField(help_text="Given where the name was typed.")
    name = serializers.CharField(max_length=64)


class SentSessionSerializer(Body):
    """One racer's turn on the track, of `racer` or of `guest`."""

    id = serializers.UUIDField(help_text="Given where times are taken, so that sending it again changes nothing.")
    revision = serializers.IntegerField(
        min_value=1, max_value=2_000_000_000, help_text="Grows with every change; an older one changes nothing."
    )
    racer = serializers.CharField(required=False, allow_blank=True, default="", max_length=64, help_text="Alias.")
    guest = SentGuestSerializer(required=False, allow_null=True, default=None)
    car = serializers.CharField(required=False, allow_blank=True, default="", max_length=64)
    started_at = ZonedDateTimeField(help_text="By the clock of the device, which `sent_at` sets right.")
    ended = serializers.BooleanField(default=False)
    discarded = serializers.BooleanField(default=False)
    sensor = serializers.IntegerField(required=False, allow_null=True, default=None, help_text="Which one measures.")
    laps = SentLapSerializer(many=True, required=False, default=list)


class CarryOverSerializer(Body):
    """What a device has timed, perhaps for a day without a network."""

    sent_at = ZonedDateTimeField(help_text="Now, by the clock of the device.")
    sessions = SentSessionSerializer(many=True, allow_empty=False, max_length=MOST_SESSIONS)  # type: ignore[call-arg]


class OutcomeSerializer(serializers.Serializer):
    """What became of a session that was sent: taken, or refused with a reason while the others are taken."""

    id = serializers.UUIDField()
    revision = serializers.IntegerField(allow_null=True, help_text="The newest that is known here; null for none.")
    code = serializers.CharField(allow_blank=True, help_text="Why it was refused; empty if it was taken.")
    message = serializers.CharField(allow_blank=True)


class OutcomesSerializer(serializers.Serializer):
    """One for each session that was sent, in their order."""

    results = OutcomeSerializer(many=True)


class TimedSessionSerializer(serializers.Serializer):
    """A session of a race of real cars."""

    id = serializers.UUIDField()
    revision = serializers.IntegerField()
    racer = serializers.CharField(source="entry.shown_name")
    number = serializers.IntegerField()
    timed = serializers.ChoiceField(Source.choices, source="source")
    sensor = serializers.IntegerField(source="sensor_id", allow_null=True)
    car = serializers.CharField(allow_blank=True)
    model = serializers.CharField(source="model.name", default=None, allow_null=True)
    started_at = serializers.DateTimeField()
    ended_at = serializers.DateTimeField(allow_null=True)
    laps = MeasuredLapSerializer(source="laps.all", many=True)


class TimedSessionsSerializer(serializers.Serializer):
    """All sessions of a race, the latest first."""

    results = TimedSessionSerializer(many=True)


class SessionsView(APIView):
    """Sessions of a race of real cars."""

    token_scope = ORGANISE
    throttle_scope = "timing"

    def get_permissions(self) -> list[Any]:
        return [IsAuthenticated() if self.request.method == "POST" else AllowAny()]

    @extend_schema(
        operation_id="list_timed_sessions",
        summary="What was timed in a race of real cars",
        responses=TimedSessionsSerializer,
        tags=["timing"],
    )
    def get(self, request: Request, slug: str) -> Response:
        race = visible_race(request, slug)
        rows = sessions_of(race)[:1000]
        return Response(TimedSessionsSerializer({"results": rows}, context={"race": race}).data)

    @extend_schema(
        operation_id="carry_over_sessions",
        summary="Carry over what was timed, for timekeepers",
        description="Each session is taken whole or refused with a reason, whatever becomes of the others. Sending one "
        "again never counts twice. Laps driven while the race was open are taken until 48 hours after it has closed.",
        request=CarryOverSerializer,
        responses=OutcomesSerializer,
        tags=["timing"],
    )
    def post(self, request: Request, slug: str) -> Response:
        race, now = timed_race(request, slug), timezone.now()
        sent = read_as(CarryOverSerializer, request.data)
        results = [_carry(race, request, one, sent["sent_at"], now) for one in sent["sessions"]]
        return Response(OutcomesSerializer({"results": results}).data)


class SessionView(APIView):
    """One session."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="read_timed_session",
        summary="A session of a race of real cars",
        responses=TimedSessionSerializer,
        tags=["timing"],
    )
    def get(self, request: Request, slug: str, id: str) -> Response:
        race = visible_race(request, slug)
        session = get_object_or_404(sessions_of(race), pk=uuid_or_404(id))
        return Response(TimedSessionSerializer(session, context={"race": race}).data)


def _carry(race: Race, request: Request, one: dict[str, Any], sent_at: datetime, now: datetime) -> dict[str, Any]:
    """Take one session; a refusal is an outcome like another."""
    guest = one["guest"]
    sent = timing.SentSession(
        id=one["id"],
        revision=one["revision"],
        started_at=now - (sent_at - one["started_at"]),
        laps=[timing.SentLap(**lap) for lap in one["laps"]],
        racer=one["racer"],
        guest=(guest["id"], guest["name"]) if guest else None,
        car=one["car"],
        ended=one["ended"],
        discarded=one["discarded"],
        sensor=one["sensor"],
    )
    outcome: dict[str, Any] = {"id": sent.id, "revision": sent.revision, "code": "", "message": ""}
    try:
        session: TimedSession | None = timing.carry_over(race=race, by=racer_of(request), sent=sent, now=now)
    except UserFault as fault:
        known = TimedSession.objects.filter(race=race, pk=sent.id).values_list("revision", flat=True).first()
        return outcome | {"revision": known, "code": fault.code, "message": explain(fault)}
    return outcome | {"revision": session.revision if session else sent.revision}
