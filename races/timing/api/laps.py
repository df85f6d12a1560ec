"""The API of sessions and laps: what a device needs and uploads, crossings, corrections, and laps from a file."""

from datetime import datetime
from typing import Annotated, Any, TypedDict
from uuid import UUID

from django.shortcuts import get_object_or_404
from django.utils import timezone
from rest_framework import serializers
from rest_framework.authentication import get_authorization_header
from rest_framework.permissions import AllowAny
from rest_framework.request import Request
from rest_framework.response import Response

from accounts.request_racer import racer_of
from accounts.scopes import ANY, ORGANISE
from core.api.bodies import Body
from core.api.documents import serializer_of
from core.api.fields import ZonedDateTimeField
from core.api.operations import operation
from core.api.views import APIView, PrivateView
from core.forms import explain
from paddock.errors import UserFault

from ...boards.counted_laps import counted_time
from ...models import CrossingVerdict, LapNote, MeasuredLap, Race, Source, TimedSession, TimingSensor
from ...models.timing import MOST_LAPS
from ...web.api import organised_race, visible_race
from .. import services as timing
from ..selectors import guests_of, sensors_of, sessions_of, timeable_entries
from ..services.checks import MOST_FAULTS
from .setup import DAY_MS, GuestSerializer, OrganisersView, SensorSerializer, timed_race, uuid_or_404

MOST_SESSIONS = 200  # in one request


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
        return counted_time(self.context["race"], lap)


class CorrectionSerializer(Body):
    """The corrected values and the reason; omitted values stay."""

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


class MayBeTimedSerializer(serializers.Serializer):
    """A racer in the race."""

    racer = serializers.CharField(source="racer.alias")
    name = serializers.CharField(source="shown_name")
    sessions = serializers.IntegerField(source="submission_count")
    model = serializers.CharField(source="model.name", default=None, allow_null=True)


class TimingSerializer(serializers.Serializer):
    """All that a timekeeper's device needs."""

    now = serializers.DateTimeField()
    racers = MayBeTimedSerializer(many=True)
    guests = GuestSerializer(many=True)
    sensors = SensorSerializer(many=True)


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
    """A driver without an account."""

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


class OutcomeDocument(TypedDict):
    """What became of a session that was sent: taken, or refused with a reason while the others are taken."""

    id: UUID
    revision: Annotated[int | None, "The newest that is known here; null for none."]
    code: Annotated[str, "Why it was refused; empty if it was taken."]
    message: str


class OutcomesSerializer(serializers.Serializer):
    """One for each session that was sent, in their order."""

    results = serializer_of(OutcomeDocument)(many=True)


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
    """The verdict on a crossing."""

    verdict = serializers.ChoiceField(CrossingVerdict.choices)
    again = serializers.BooleanField(help_text="It had come before.")
    lap = serializers.IntegerField(source="lap.number", default=None, allow_null=True)
    time_ms = serializers.IntegerField(source="lap.time_ms", default=None, allow_null=True)


def organised_lap(request: Request, slug: str, id: str) -> MeasuredLap:
    """A lap of a race that the caller organises. Raises as :func:`organised_race`."""
    laps = MeasuredLap.objects.select_related("session__entry", "session__race")
    return get_object_or_404(laps, session__race=organised_race(request, slug), pk=uuid_or_404(id))


def sending_sensor(request: Request) -> TimingSensor:
    """The sensor whose token the request has. Raises UserFault("sensor_token" | "sensor_revoked")."""
    word, _, token = get_authorization_header(request).partition(b" ")
    shown = token.strip() if word.lower() in (b"bearer", b"token") else b""
    return timing.sensor_with(shown.decode("ascii", "replace"))


class TimingView(PrivateView):
    """What a timekeeper needs."""

    tag = "timing"

    @operation("read_timing", "Who may be timed, for timekeepers", find=timed_race, answer=TimingSerializer)
    def get(self, request: Request, race: Race) -> Any:
        return {
            "now": timezone.now(),
            "racers": timeable_entries(race).filter(guest_name=""),
            "guests": guests_of(race),
            "sensors": sensors_of(race).filter(revoked_at=None),
        }


class SessionsView(APIView):
    """Sessions of a race of real cars."""

    tag = "timing"
    token_scope = ORGANISE
    throttle_scope = "timing"

    @operation(
        "list_timed_sessions",
        "What was timed in a race of real cars",
        find=visible_race,
        answer=TimedSessionsSerializer,
    )
    def get(self, request: Request, race: Race) -> Response:
        found = {"results": sessions_of(race)[:1000]}
        return Response(TimedSessionsSerializer(found, context={"race": race}).data)

    @operation(
        "carry_over_sessions",
        "Carry over what was timed, for timekeepers",
        find=timed_race,
        body=CarryOverSerializer,
        answer=OutcomesSerializer,
        description="Each session is taken whole or refused with a reason, whatever becomes of the others. Sending one "
        "again never counts twice. Laps driven while the race was open are taken until 48 hours after it has closed.",
    )
    def post(self, request: Request, race: Race, sent: dict) -> Any:
        now = timezone.now()
        return {"results": [_carry(race, request, one, sent["sent_at"], now) for one in sent["sessions"]]}


class SessionView(APIView):
    """One session."""

    tag = "timing"

    @operation("read_timed_session", "A session of a race of real cars", answer=TimedSessionSerializer)
    def get(self, request: Request, slug: str, id: str) -> Response:
        race = visible_race(request, slug)
        session = get_object_or_404(sessions_of(race), pk=uuid_or_404(id))
        return Response(TimedSessionSerializer(session, context={"race": race}).data)


class LapFileView(OrganisersView):
    """Laps from a file."""

    @operation(
        "take_laps",
        "Take laps from a CSV file, for organisers of the race",
        find=organised_race,
        body=LapFileSerializer,
        answer=TakenLapsSerializer,
        description="All of them or none; `fields.csv` names each line with its reason.",
    )
    def post(self, request: Request, race: Race, sent: dict) -> Any:
        return {"laps": timing.take_file(race=race, by=racer_of(request), text=sent["csv"], now=timezone.now())}


class LapView(OrganisersView):
    """One lap."""

    @operation(
        "correct_lap",
        "Correct a lap of a race that you organise, or invalidate it",
        find=organised_lap,
        body=CorrectionSerializer,
        answer=MeasuredLapSerializer,
        description="What stood stays in the log, with your reason, which everybody reads.",
    )
    def patch(self, request: Request, lap: MeasuredLap, sent: dict) -> Response:
        made = timing.correct_lap(lap=lap, by=racer_of(request), now=timezone.now(), **sent)
        return Response(MeasuredLapSerializer(made.lap, context={"race": lap.session.race}).data)


class CrossingsView(APIView):
    """Crossings, sent by sensors with a sensor token."""

    tag = "timing"
    token_scope = ANY  # a sensor's token is none of a racer's
    authentication_classes: list[type] = []
    permission_classes = [AllowAny]

    @operation(
        "tell_crossing",
        "A car has crossed the line, for sensors",
        find=sending_sensor,
        body=CrossingSerializer,
        answer=TakenCrossingSerializer,
        description="With `Authorization: Bearer <token of the sensor>`. Sending a crossing again changes nothing.",
        auth=[],
    )
    def post(self, request: Request, sensor: TimingSensor, sent: dict) -> Any:
        return timing.take_crossing(sensor=sensor, now=timezone.now(), **sent)


def _carry(race: Race, request: Request, one: dict, sent_at: datetime, now: datetime) -> OutcomeDocument:
    """Take one session; a refusal is an outcome like another."""
    if guest := one["guest"]:
        guest = guest["id"], guest["name"]
    laps = [timing.SentLap(**lap) for lap in one["laps"]]
    started_at = now - (sent_at - one["started_at"])
    sent = timing.SentSession(**one | {"guest": guest, "laps": laps, "started_at": started_at})
    revision: int | None = sent.revision
    try:
        session: TimedSession | None = timing.carry_over(race=race, by=racer_of(request), sent=sent, now=now)
    except UserFault as fault:
        revision = TimedSession.objects.filter(race=race, pk=sent.id).values_list("revision", flat=True).first()
        return {"id": sent.id, "revision": revision, "code": fault.code, "message": explain(fault)}
    return {"id": sent.id, "revision": session.revision if session else revision, "code": "", "message": ""}
