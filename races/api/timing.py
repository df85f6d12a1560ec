"""Races of real cars: sessions and laps, sensors, timekeepers."""

from __future__ import annotations

from datetime import datetime
from typing import Any
from uuid import UUID

from django.http import Http404
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
from core.forms import explain
from paddock.errors import UserFault

from ..measured import counted_ms, is_complete
from ..models import CrossingVerdict, LapNote, MeasuredLap, Race, Source, TimedSession, TimingSensor
from ..models.timing import MOST_LAPS
from ..selectors.timing import can_keep_time, guests_of, sensors_of, sessions_of, timekeepers_of, who_may_be_timed
from ..services import timing
from ..services.timing.laps import MOST_FAULTS
from .lookup import organised_race, visible_race

MOST_SESSIONS = 200  # in one request
_DAY_MS = 86_400_000


class SentLapSerializer(Body):
    """One lap as it was measured."""

    id = serializers.UUIDField(help_text="Given where the lap was measured; the same lap has the same id for ever.")
    number = serializers.IntegerField(min_value=1, max_value=MOST_LAPS)
    time_ms = serializers.IntegerField(
        min_value=0, max_value=400 * _DAY_MS, help_text="By a monotonic clock, without penalties."
    )
    wall_ms = serializers.IntegerField(
        required=False,
        allow_null=True,
        min_value=-400 * _DAY_MS,
        max_value=400 * _DAY_MS,
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
    started_at = serializers.DateTimeField(help_text="By the clock of the device, which `sent_at` sets right.")
    ended = serializers.BooleanField(default=False)
    discarded = serializers.BooleanField(default=False)
    sensor = serializers.IntegerField(required=False, allow_null=True, default=None, help_text="Which one measures.")
    laps = SentLapSerializer(many=True, required=False, default=list)


class CarryOverSerializer(Body):
    """What a device has timed, perhaps for a day without a network."""

    sent_at = serializers.DateTimeField(help_text="Now, by the clock of the device.")
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


class MayBeTimedSerializer(serializers.Serializer):
    """Somebody in the race."""

    racer = serializers.CharField(source="racer.alias")
    name = serializers.CharField(source="shown_name")
    sessions = serializers.IntegerField(source="submission_count")
    model = serializers.CharField(source="model.name", default=None, allow_null=True)


class GuestSerializer(serializers.Serializer):
    """A guest of the race."""

    id = serializers.UUIDField()
    name = serializers.CharField()
    racer = serializers.SerializerMethodField(help_text="Who has taken the laps over; null for nobody yet.")

    def get_racer(self, guest: Any) -> str | None:
        alias: str | None = guest.entry.racer.alias if guest.linked_at else None
        return alias


class SensorSerializer(serializers.Serializer):
    """A sensor at the finish line."""

    number = serializers.IntegerField(source="pk")
    name = serializers.CharField()
    hint = serializers.CharField(help_text="How its token begins.")
    made_at = serializers.DateTimeField()
    seen_at = serializers.DateTimeField(allow_null=True)
    revoked_at = serializers.DateTimeField(allow_null=True)


class TimingSerializer(serializers.Serializer):
    """All that a timekeeper's device needs."""

    now = serializers.DateTimeField()
    racers = MayBeTimedSerializer(many=True)
    guests = GuestSerializer(many=True)
    sensors = SensorSerializer(many=True)


class NewSensorSerializer(Body):
    """What it is called."""

    name = serializers.CharField(max_length=64)


class MadeSensorSerializer(SensorSerializer):
    """A new sensor with its token."""

    token = serializers.CharField(help_text="Shown this once.")


class TimekeeperSerializer(serializers.Serializer):
    """Who may take times besides the organiser."""

    racer = serializers.CharField(source="racer.alias")
    named_at = serializers.DateTimeField()


class NameTimekeeperSerializer(Body):
    """Whom to name."""

    racer = serializers.CharField(max_length=64)


class CorrectionSerializer(Body):
    """What is right, and why. What is left out stays."""

    reason = serializers.CharField(max_length=255, allow_blank=True)
    time_ms = serializers.IntegerField(required=False, min_value=0, max_value=400 * _DAY_MS)
    off_tracks = serializers.IntegerField(required=False, min_value=0, max_value=10**6)
    resets = serializers.IntegerField(required=False, min_value=0, max_value=10**6)
    valid = serializers.BooleanField(required=False)


class LapFileSerializer(Body):
    """A CSV file as text."""

    csv = serializers.CharField(max_length=1_000_000, trim_whitespace=False, allow_blank=True)


class TakenLapsSerializer(serializers.Serializer):
    """How many."""

    laps = serializers.IntegerField()


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


def _uuid(text: str) -> UUID:
    """Raises Http404 for what is none."""
    try:
        return UUID(text)
    except ValueError:
        raise Http404 from None


def timed_race(request: Request, slug: str) -> Race:
    """The race at ``slug``, in which the reader may take times. Raises Http404, UserFault("race_not_physical" |
    "timing_not_yours")."""
    race = visible_race(request, slug)
    if not race.physical:
        raise UserFault("race_not_physical")
    if not can_keep_time(racer_of(request), race):
        raise UserFault("timing_not_yours")
    return race


class TimingView(APIView):
    """What a timekeeper needs."""

    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="read_timing",
        summary="Who may be timed, for timekeepers",
        responses=TimingSerializer,
        tags=["timing"],
    )
    def get(self, request: Request, slug: str) -> Response:
        race = timed_race(request, slug)
        found = {
            "now": timezone.now(),
            "racers": who_may_be_timed(race).filter(guest_name=""),
            "guests": guests_of(race),
            "sensors": sensors_of(race).filter(revoked_at=None),
        }
        return Response(TimingSerializer(found).data)


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
        session = get_object_or_404(sessions_of(race), pk=_uuid(id))
        return Response(TimedSessionSerializer(session, context={"race": race}).data)


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
        lap = get_object_or_404(laps, pk=_uuid(id))
        sent = read_as(CorrectionSerializer, request.data)
        made = timing.correct_lap(lap=lap, by=racer_of(request), now=timezone.now(), **sent)
        return Response(MeasuredLapSerializer(made.lap, context={"race": race}).data)


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


class TimekeepersView(APIView):
    """Who may take times."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="list_timekeepers",
        summary="Timekeepers of a race that you organise",
        responses=TimekeeperSerializer(many=True),
        tags=["timing"],
    )
    def get(self, request: Request, slug: str) -> Response:
        return Response(TimekeeperSerializer(timekeepers_of(organised_race(request, slug)), many=True).data)

    @extend_schema(
        operation_id="name_timekeeper",
        summary="Name a timekeeper",
        request=NameTimekeeperSerializer,
        responses=TimekeeperSerializer,
        tags=["timing"],
    )
    def post(self, request: Request, slug: str) -> Response:
        race = organised_race(request, slug)
        alias = read_as(NameTimekeeperSerializer, request.data)["racer"]
        named = timing.name_timekeeper(race=race, alias=alias, by=racer_of(request), now=timezone.now())
        return Response(TimekeeperSerializer(named).data)


class TimekeeperView(APIView):
    """One timekeeper."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="dismiss_timekeeper",
        summary="Dismiss a timekeeper",
        request=None,
        responses={204: OpenApiResponse(description="Dismissed; what they timed stays.")},
        tags=["timing"],
    )
    def delete(self, request: Request, slug: str, alias: str) -> Response:
        refuse_fields(request)
        race = organised_race(request, slug)
        named = get_object_or_404(timekeepers_of(race), racer__alias__iexact=alias)
        timing.dismiss_timekeeper(race=race, racer=named.racer, by=racer_of(request))
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
