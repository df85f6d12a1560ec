"""Live events: planned, run by their organisers, driven in by racers, watched by everybody."""

from __future__ import annotations

from typing import Any

from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiParameter, extend_schema
from rest_framework import serializers
from rest_framework.permissions import AllowAny, IsAuthenticated, IsAuthenticatedOrReadOnly
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from accounts.scopes import ORGANISE, RACE
from accounts.who import racer_of
from core.api.fields import ZonedDateTimeField
from core.bodies import Body, read_as
from evaluation.selectors import models_of
from paddock.errors import UserFault
from paddock.rules.speed import MODES

from ..live_acts import ACTS, act
from ..live_document import live_document
from ..live_rules import MOST_SEED
from ..models import LiveEvent, LiveOrder, LiveSlot
from ..models.live import LEAST_ATTEMPT_MS, MOST_ATTEMPT_MS, MOST_ROUNDS
from ..selectors.live import console_rows, live_events_visible_to, played
from ..services.live import change_live, choose_model, plan_live, say_here
from ..services.live.planning import MOST_GAP_S
from .lookup import organised_race, visible_race, watched_race


class SpeedCommandSerializer(serializers.Serializer):
    """What was commanded of a car's speed."""

    at_ms = serializers.IntegerField(help_text="From when on, in ms of the run.")
    mode = serializers.ChoiceField(MODES)
    value = serializers.FloatField(help_text="A factor, m/s, per cent, or m/s more or less, as the mode says.")
    by = serializers.CharField()


class LiveRacerSerializer(serializers.Serializer):
    """A racer of the event."""

    racer = serializers.CharField()
    country = serializers.CharField(allow_blank=True)
    qualified_rank = serializers.IntegerField(allow_null=True, help_text="Place in the race when the event began.")


class LiveLobbyRacerSerializer(LiveRacerSerializer):
    """A racer in the lobby."""

    here = serializers.BooleanField(help_text="Whether they answered the roll call.")


class LiveCarSerializer(serializers.Serializer):
    """A car of a run."""

    number = serializers.IntegerField()
    racer = serializers.CharField()
    country = serializers.CharField(allow_blank=True)
    speed = SpeedCommandSerializer(allow_null=True, help_text="The command that it drives by now.")


class LiveSlotSerializer(LiveRacerSerializer):
    """A place in the running order."""

    slot = serializers.IntegerField(help_text="Its number, for acts and poses.")
    round = serializers.IntegerField()
    attempt = serializers.IntegerField(help_text="More than 1 for a run that was run again.")
    state = serializers.CharField(help_text="waiting, called, countdown, on_track, done, skipped, held or removed.")
    starts_at = serializers.IntegerField(allow_null=True, help_text="When it starts or started, in ms since 1970.")
    evaluation = serializers.CharField(allow_null=True, help_text="The public_id of its run, once it was shown.")
    reason = serializers.CharField(allow_blank=True, help_text="A reason code, such as why it is held.")
    speed = SpeedCommandSerializer(allow_null=True, help_text="That of its first car.")
    heat = serializers.IntegerField(allow_null=True, help_text="The number of the duel in its round; null without.")
    cars = LiveCarSerializer(many=True, help_text="Who drives, by the numbers that the cars of its poses have.")


class LiveStandingSerializer(LiveRacerSerializer):
    """How a racer stands by the runs that were shown."""

    rank = serializers.IntegerField(allow_null=True)
    attempts = serializers.IntegerField()
    score_ms = serializers.IntegerField(allow_null=True)
    gap_ms = serializers.IntegerField(allow_null=True, help_text="To the leader's score.")
    best_lap_ms = serializers.IntegerField(allow_null=True)
    complete_laps = serializers.IntegerField(allow_null=True)
    sectors = serializers.ListField(child=serializers.IntegerField(), help_text="Of the best lap, in ms.")
    points = serializers.IntegerField(allow_null=True, help_text="In duels; in a bracket how many ties were won.")


class LiveTieCarSerializer(serializers.Serializer):
    """A place of a tie."""

    racer = serializers.CharField(allow_null=True, help_text="null while nobody is known.")
    seed = serializers.IntegerField(allow_null=True)
    points = serializers.IntegerField(allow_null=True)
    won = serializers.BooleanField()


class LiveTieSerializer(serializers.Serializer):
    """Two who meet in a bracket."""

    number = serializers.IntegerField()
    bye = serializers.BooleanField(help_text="Nobody else will come: its one car goes on.")
    cars = LiveTieCarSerializer(many=True)


class LiveHeatCarSerializer(serializers.Serializer):
    """A car of a duel."""

    racer = serializers.CharField()
    place = serializers.IntegerField(allow_null=True)
    points = serializers.IntegerField(allow_null=True)


class LiveHeatSerializer(serializers.Serializer):
    """A duel."""

    number = serializers.IntegerField()
    state = serializers.CharField(help_text="waiting until it was shown, then decided or void.")
    cars = LiveHeatCarSerializer(many=True, help_text="In the order at the end once it was shown.")


class LiveRoundSerializer(serializers.Serializer):
    """A round of duels."""

    round = serializers.IntegerField()
    name = serializers.CharField()
    ties = LiveTieSerializer(many=True, help_text="Of a bracket.")
    heats = LiveHeatSerializer(many=True)


class LiveLeaderSerializer(serializers.Serializer):
    """Whose run leads, to be driven beside as a ghost."""

    racer = serializers.CharField()
    slot = serializers.IntegerField(help_text="Its poses are those of this place in the running order.")
    whole = serializers.BooleanField(help_text="Whether the whole run counts, else its best lap.")
    lap = serializers.IntegerField(allow_null=True, help_text="The number of its best lap.")
    sectors = serializers.ListField(child=serializers.IntegerField(), help_text="Of that lap, in ms.")


class LiveEventSerializer(serializers.Serializer):
    """A live event. Times in milliseconds since 1970, by the server's clock."""

    race = serializers.CharField(help_text="The race's address.")
    name = serializers.CharField()
    phase = serializers.CharField(help_text="planned, lobby, running, paused, ended or cancelled.")
    version = serializers.IntegerField(help_text="Counts what organisers did; acts name the one they saw.")
    now = serializers.IntegerField()
    starts_at = serializers.IntegerField()
    time_zone = serializers.CharField()
    lobby_opens_at = serializers.IntegerField()
    behind_ms = serializers.IntegerField(help_text="Play so much behind the clock, and you have what you play.")
    chunk_ms = serializers.IntegerField(help_text="How long a chunk of poses is.")
    rounds = serializers.IntegerField()
    attempt_ms = serializers.IntegerField()
    start_m = serializers.FloatField(help_text="Laps begin and end so many metres after the race's finish line.")
    seed = serializers.IntegerField(help_text="Of the event's runs.")
    speed_control = serializers.BooleanField(help_text="Whether racers set their car's speed.")
    submissions_open = serializers.BooleanField(help_text="Whether racers choose their models.")
    message = serializers.CharField(allow_blank=True, help_text="To spectators.")
    current = LiveSlotSerializer(allow_null=True, help_text="What counts down or is played.")
    next = LiveSlotSerializer(many=True, help_text="The next three.")
    order = LiveSlotSerializer(many=True, help_text="The running order; empty until the event has begun.")
    racers = LiveLobbyRacerSerializer(many=True, help_text="Who is in the lobby, until the event has begun.")
    standings = LiveStandingSerializer(many=True)
    bracket = LiveRoundSerializer(many=True, help_text="The rounds of duels as far as they were shown.")
    winner = serializers.CharField(allow_null=True)
    podium = serializers.ListField(child=serializers.CharField(), help_text="Once it is shown; the winner first.")
    best_sectors = serializers.ListField(
        child=serializers.IntegerField(), help_text="The best time in each sector, in ms, of the runs that were shown."
    )
    own_sectors = serializers.DictField(
        child=serializers.ListField(child=serializers.IntegerField()), help_text="The same of each racer, by alias."
    )
    leader = LiveLeaderSerializer(allow_null=True)
    reactions = serializers.DictField(child=serializers.IntegerField(), help_text="How often each was sent.")


class LivePlanSerializer(Body):
    """The plan of a live event."""

    starts_at = ZonedDateTimeField(help_text="The lobby opens an hour before.")
    time_zone = serializers.CharField(required=False, max_length=64, help_text="Such as Europe/Berlin.")
    rounds = serializers.IntegerField(required=False, min_value=1, max_value=MOST_ROUNDS)
    attempt_ms = serializers.IntegerField(required=False, min_value=LEAST_ATTEMPT_MS, max_value=MOST_ATTEMPT_MS)
    order = serializers.ChoiceField(LiveOrder.choices, required=False)
    start_m = serializers.FloatField(
        required=False, allow_null=True, min_value=0, help_text="Metres after the finish line; null or left out: drawn."
    )
    seed = serializers.IntegerField(
        required=False, allow_null=True, min_value=0, max_value=MOST_SEED, help_text="null or left out: drawn."
    )
    gap_s = serializers.IntegerField(required=False, min_value=0, max_value=MOST_GAP_S)
    roll_call = serializers.BooleanField(required=False, help_text="Who is not here when it begins is held back.")
    auto_run = serializers.BooleanField(required=False, help_text="It begins in time and goes on by itself.")
    speed_control = serializers.BooleanField(required=False, help_text="Racers set their car's speed.")


class LiveActSerializer(Body):
    """Something that an organiser does."""

    action = serializers.ChoiceField(sorted(ACTS))
    version = serializers.IntegerField(min_value=0, help_text="Of the event, as you saw it.")
    slot = serializers.IntegerField(required=False, min_value=1, help_text="Of the running order.")
    before = serializers.IntegerField(
        required=False, allow_null=True, min_value=1, help_text="For move: before this slot; null: behind all."
    )
    racer = serializers.CharField(required=False, max_length=64, help_text="For add and winner: an alias.")
    message = serializers.CharField(required=False, allow_blank=True, max_length=400, help_text="For message.")


class LiveMineSerializer(Body):
    """A racer's own part."""

    model = serializers.CharField(required=False, max_length=12, help_text="The public_id of a model of yours.")
    here = serializers.BooleanField(required=False, help_text="true answers the roll call.")


class ConsoleSlotSerializer(serializers.Serializer):
    """A place in the running order, as its organisers see it."""

    slot = serializers.IntegerField(source="slot.pk")
    racer = serializers.CharField(source="slot.who")
    round = serializers.IntegerField(source="slot.round")
    attempt = serializers.IntegerField(source="slot.attempt")
    state = serializers.CharField(source="phase")
    sealed = serializers.CharField(
        allow_blank=True, help_text="sealed once its run is computed, computing until then, empty without one."
    )
    may = serializers.SerializerMethodField(help_text="What may be done to it now.")
    reason = serializers.CharField(source="slot.reason_code", allow_blank=True)

    def get_may(self, row: Any) -> list[str]:
        return sorted(row.may)


class LiveLogSerializer(serializers.Serializer):
    """Something that was done."""

    at = serializers.DateTimeField()
    by = serializers.CharField(source="by.alias", default=None, allow_null=True, help_text="null: the clock.")
    action = serializers.CharField()
    told = serializers.DictField(help_text="What of: slot, racer and the like.")
    undone_at = serializers.DateTimeField(allow_null=True)


class ConsoleSerializer(serializers.Serializer):
    """What the console shows besides."""

    version = serializers.IntegerField()
    auto_run = serializers.BooleanField()
    order = ConsoleSlotSerializer(many=True)
    log = LiveLogSerializer(many=True, help_text="The latest first, a hundred at most.")


class ChunkSerializer(serializers.Serializer):
    """Half a second of a run."""

    n = serializers.IntegerField(help_text="It begins n times chunk_ms after the start.")
    cars = serializers.ListField(
        child=serializers.DictField(),
        help_text="For each its number, and columns of equal length: t (ms), x, y (map), yaw, v, steer, lap, status.",
    )
    bots = serializers.ListField(child=serializers.DictField(), help_text="For each bot x, y and yaw.")
    events = serializers.ListField(
        child=serializers.DictField(), help_text="What happened: t, car, kind (sector, lap, off_track, ...), lap, ms."
    )


class PosesSerializer(serializers.Serializer):
    """What of a run has been played."""

    slot = serializers.IntegerField()
    starts_at = serializers.IntegerField(allow_null=True)
    now = serializers.IntegerField()
    chunks = ChunkSerializer(many=True, help_text="Those after the one that you name, a minute of them at most.")
    over = serializers.BooleanField(help_text="Whether the last of these is the last there is.")


def live_event(request: Request, slug: str) -> LiveEvent:
    """The live event of the race at ``slug``. Raises Http404."""
    race = visible_race(request, slug)
    return get_object_or_404(live_events_visible_to(request.user), race=race)


def watched_live_event(request: Request, slug: str) -> LiveEvent:
    """The same, with a spectators' link too: to read. Raises Http404."""
    events = LiveEvent.objects.select_related("race__track", "race__organiser", "winner__racer")
    return get_object_or_404(events, race=watched_race(request, slug))


def poses_document(slot: LiveSlot, after: int) -> dict[str, Any]:
    """What of a run has been played by now, after chunk ``after``."""
    now = timezone.now()
    chunks, over = played(slot, now, after=after)
    starts_at = None if slot.starts_at is None else round(slot.starts_at.timestamp() * 1000)
    return {
        "slot": slot.pk,
        "starts_at": starts_at,
        "now": round(now.timestamp() * 1000),
        "chunks": chunks,
        "over": over,
    }


class LiveView(APIView):
    """The live event of a race."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticatedOrReadOnly]

    @extend_schema(
        operation_id="read_live",
        summary="The live event of a race",
        description=(
            "What runs, who is next, how it stands. A run's results appear only after it was played. Of a race by "
            "invitation a spectators' token in the header `X-Paddock-Spectator` opens this and the poses."
        ),
        responses=LiveEventSerializer,
        tags=["races"],
    )
    def get(self, request: Request, slug: str) -> Response:
        return self._answer(watched_live_event(request, slug))

    @extend_schema(
        operation_id="plan_live",
        summary="Plan a live event of a race that you organise",
        request=LivePlanSerializer,
        responses={201: LiveEventSerializer},
        tags=["races"],
    )
    def post(self, request: Request, slug: str) -> Response:
        race = organised_race(request, slug)
        plan = read_as(LivePlanSerializer, request.data)
        event = plan_live(race=race, by=racer_of(request), now=timezone.now(), **plan)
        return self._answer(event, status=201)

    @extend_schema(
        operation_id="change_live",
        summary="Change the plan of a live event that has not begun",
        request=LivePlanSerializer,
        responses=LiveEventSerializer,
        tags=["races"],
    )
    def patch(self, request: Request, slug: str) -> Response:
        plan = read_as(LivePlanSerializer, request.data, partial=True)
        organised_race(request, slug)
        event = live_event(request, slug)
        change_live(event=event, by=racer_of(request), seen=None, now=timezone.now(), **plan)
        return self._answer(event)

    def _answer(self, event: LiveEvent, status: int = 200) -> Response:
        return Response(LiveEventSerializer(live_document(event, timezone.now())).data, status=status)


class LiveActsView(APIView):
    """What organisers do."""

    token_scope = ORGANISE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="read_live_console",
        summary="The console of a live event that you organise",
        description="The running order with what may be done to each place, what is computed ahead, and the log.",
        responses=ConsoleSerializer,
        tags=["races"],
    )
    def get(self, request: Request, slug: str) -> Response:
        organised_race(request, slug)
        event = live_event(request, slug)
        log = event.log.select_related("by").order_by("-pk")[:100]
        rows = console_rows(event, timezone.now())
        shown = {"version": event.version, "auto_run": event.auto_run, "order": rows, "log": log}
        return Response(ConsoleSerializer(shown).data)

    @extend_schema(
        operation_id="act_live",
        summary="Do something in a live event that you organise",
        description=(
            "`begin`, `call`, `launch`, `skip`, `hold`, `release`, `remove`, `again`, `move` (`up`, `down`), `add`, "
            "`pause`, `resume`, `end`, `cancel`, `message`, `winner`, `podium`, `open` and `close` (the choosing of "
            "models), `auto`, `manual`, `undo`. Refused with `live_changed` when somebody did something since the "
            "version that you name."
        ),
        request=LiveActSerializer,
        responses=LiveEventSerializer,
        tags=["races"],
    )
    def post(self, request: Request, slug: str) -> Response:
        said = read_as(LiveActSerializer, request.data)
        organised_race(request, slug)
        event = live_event(request, slug)
        act(
            event,
            said["action"],
            by=racer_of(request),
            seen=said["version"],
            now=timezone.now(),
            slot=said.get("slot"),
            before=said.get("before"),
            racer=said.get("racer", ""),
            message=said.get("message", ""),
        )
        return Response(LiveEventSerializer(live_document(event, timezone.now())).data)


class LiveMineView(APIView):
    """A racer's own part in a live event."""

    token_scope = RACE
    permission_classes = [IsAuthenticated]

    @extend_schema(
        operation_id="take_part_live",
        summary="Choose your model for a live event, or answer its roll call",
        request=LiveMineSerializer,
        responses=LiveEventSerializer,
        tags=["races"],
    )
    def post(self, request: Request, slug: str) -> Response:
        asked = read_as(LiveMineSerializer, request.data)
        event, racer, now = live_event(request, slug), racer_of(request), timezone.now()
        if public_id := asked.get("model"):
            model = models_of(racer).filter(public_id=public_id).first()
            if model is None:
                raise UserFault("model_not_yours")
            choose_model(event=event, racer=racer, model=model, now=now)
        if asked.get("here"):
            say_here(event=event, racer=racer, now=now)
        return Response(LiveEventSerializer(live_document(event, now)).data)


class LivePosesView(APIView):
    """What is played."""

    permission_classes = [AllowAny]

    @extend_schema(
        operation_id="read_live_poses",
        summary="What of a live run has been played by now",
        description="In chunks of half a second, each once it has wholly passed. Nothing before the start.",
        parameters=[
            OpenApiParameter("slot", OpenApiTypes.INT, required=True, description="Of the running order."),
            OpenApiParameter("after", OpenApiTypes.INT, description="The last chunk that you have; -1 for none."),
        ],
        responses=PosesSerializer,
        tags=["races"],
    )
    def get(self, request: Request, slug: str) -> Response:
        event = watched_live_event(request, slug)
        slot = slot_in(event, request.query_params.get("slot", ""))
        return Response(PosesSerializer(poses_document(slot, after_in(request.query_params.get("after", "")))).data)


def slot_in(event: LiveEvent, written: str) -> LiveSlot:
    """The slot that a query names. Raises Http404."""
    if not (written.isdecimal() and len(written) < 12):
        raise Http404
    return get_object_or_404(LiveSlot, event=event, pk=int(written))


def after_in(written: str) -> int:
    """The chunk that a query names; -1 for none."""
    return int(written) if written.isdecimal() and len(written) < 9 else -1
