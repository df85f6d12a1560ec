"""The API of live events for organisers, racers and spectators."""

from typing import Annotated, Any, TypedDict

from django.http import Http404
from django.shortcuts import get_object_or_404
from django.utils import timezone
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiParameter
from rest_framework import serializers
from rest_framework.request import Request

from accounts.request_racer import racer_of
from accounts.scopes import ORGANISE, RACE
from core.api.bodies import Body
from core.api.documents import serializer_of
from core.api.fields import ZonedDateTimeField
from core.api.operations import operation
from core.api.views import APIView, PrivateView
from evaluation.selectors import models_of
from paddock.errors import UserFault
from paddock.rules.speed import MODES

from ..models import LiveEvent, LiveOrder, LiveRacer, LiveSlot, Race
from ..models.live import LEAST_ATTEMPT_MS, MOST_ATTEMPT_MS, MOST_ROUNDS
from ..rules.live_start import MOST_SEED
from ..web.api import organised_race, visible_race, watched_race
from .actions import ACTS, act
from .document import LiveEventDocument, live_document, milliseconds
from .selectors.events import LIVE_RELATED, console_rows, live_events_visible_to, played
from .selectors.speed import SpeedDocument, live_racers_commanded_by, speed_document
from .services import change_live, check_in, choose_model, command_now, command_start, name_deputy, plan_live
from .services.planning import MOST_GAP_S
from .services.roll_call import entry_in
from .streaming.pose_chunks import ChunkDocument

LiveEventSerializer = serializer_of(LiveEventDocument)


class PosesDocument(TypedDict):
    """What of a run has been played."""

    slot: int
    starts_at: int | None
    now: int
    chunks: Annotated[list[ChunkDocument], "Those after the one that you name, a minute of them at most."]
    over: Annotated[bool, "Whether the last of these is the last there is."]


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
    racer = serializers.CharField(source="slot.driver_names")
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
    """The console's data."""

    version = serializers.IntegerField()
    auto_run = serializers.BooleanField()
    order = ConsoleSlotSerializer(many=True)
    log = LiveLogSerializer(many=True, help_text="The latest first, a hundred at most.")


def live_event(request: Request, slug: str) -> LiveEvent:
    """The live event of the race at ``slug``. Raises Http404."""
    race = visible_race(request, slug)
    return get_object_or_404(live_events_visible_to(request.user), race=race)


def organised_event(request: Request, slug: str) -> LiveEvent:
    """The live event of a race that the reader organises. Raises as :func:`organised_race`."""
    return get_object_or_404(live_events_visible_to(request.user), race=organised_race(request, slug))


def entered_event(request: Request, slug: str) -> LiveEvent:
    """The live event of a race that the reader is in. Raises Http404, UserFault("live_not_in")."""
    event = live_event(request, slug)
    entry_in(event, racer_of(request))
    return event


def watched_live_event(request: Request, slug: str) -> LiveEvent:
    """The same, with a spectators' link too: to read. Raises Http404."""
    return get_object_or_404(LiveEvent.objects.select_related(*LIVE_RELATED), race=watched_race(request, slug))


def poses_document(slot: LiveSlot, after: int) -> PosesDocument:
    """What of a run has been played by now, after chunk ``after``."""
    now = timezone.now()
    chunks, over = played(slot, now, after=after)
    starts_at = None if slot.starts_at is None else milliseconds(slot.starts_at)
    return {"slot": slot.pk, "starts_at": starts_at, "now": milliseconds(now), "chunks": chunks, "over": over}


class LiveView(APIView):
    """The live event of a race."""

    token_scope = ORGANISE

    @operation(
        "read_live",
        "The live event of a race",
        find=watched_live_event,
        answer=LiveEventSerializer,
        description=(
            "What runs, who is next, how it stands. A run's results appear only after it was played. Of a race by "
            "invitation a spectators' token in the header `X-Paddock-Spectator` opens this and the poses."
        ),
    )
    def get(self, request: Request, event: LiveEvent) -> LiveEventDocument:
        return live_document(event, timezone.now())

    @operation(
        "plan_live",
        "Plan a live event of a race that you organise",
        find=organised_race,
        body=LivePlanSerializer,
        answer=LiveEventSerializer,
        status=201,
    )
    def post(self, request: Request, race: Race, plan: dict) -> LiveEventDocument:
        now = timezone.now()
        return live_document(plan_live(race=race, by=racer_of(request), now=now, **plan), now)

    @operation(
        "change_live",
        "Change the plan of a live event that has not begun",
        find=organised_event,
        body=LivePlanSerializer,
        partial=True,
        answer=LiveEventSerializer,
    )
    def patch(self, request: Request, event: LiveEvent, plan: dict) -> LiveEventDocument:
        now = timezone.now()
        change_live(event=event, by=racer_of(request), seen=None, now=now, **plan)
        return live_document(event, now)


class LiveActsView(PrivateView):
    """What organisers do."""

    token_scope = ORGANISE

    @operation(
        "read_live_console",
        "The console of a live event that you organise",
        find=organised_event,
        answer=ConsoleSerializer,
        description="The running order with what may be done to each place, what is computed ahead, and the log.",
    )
    def get(self, request: Request, event: LiveEvent) -> Any:
        log = event.log.select_related("by").order_by("-pk")[:100]
        rows = console_rows(event, timezone.now())
        return {"version": event.version, "auto_run": event.auto_run, "order": rows, "log": log}

    @operation(
        "act_live",
        "Do something in a live event that you organise",
        find=organised_event,
        body=LiveActSerializer,
        answer=LiveEventSerializer,
        description=(
            "`begin`, `call`, `launch`, `skip`, `hold`, `release`, `remove`, `again`, `move` (`up`, `down`), `add`, "
            "`pause`, `resume`, `end`, `cancel`, `message`, `winner`, `podium`, `open` and `close` (the choosing of "
            "models), `auto`, `manual`, `undo`. Refused with `live_changed` when somebody did something since the "
            "version that you name."
        ),
    )
    def post(self, request: Request, event: LiveEvent, sent: dict) -> LiveEventDocument:
        action, seen = sent.pop("action"), sent.pop("version")
        act(event, action, by=racer_of(request), seen=seen, now=timezone.now(), **sent)
        return live_document(event, timezone.now())


class LiveMineView(PrivateView):
    """A racer's own part in a live event."""

    token_scope = RACE

    @operation(
        "take_part_live",
        "Choose your model for a live event, or answer its roll call",
        find=entered_event,
        body=LiveMineSerializer,
        answer=LiveEventSerializer,
    )
    def post(self, request: Request, event: LiveEvent, sent: dict) -> LiveEventDocument:
        racer, now = racer_of(request), timezone.now()
        if public_id := sent.get("model"):
            model = models_of(racer).filter(public_id=public_id).first()
            if model is None:
                raise UserFault("model_not_yours")
            choose_model(event=event, racer=racer, model=model, now=now)
        if sent.get("here"):
            check_in(event=event, racer=racer, now=now)
        return live_document(event, now)


class LivePosesView(APIView):
    """The poses of the run on track."""

    @operation(
        "read_live_poses",
        "What of a live run has been played by now",
        find=watched_live_event,
        answer=serializer_of(PosesDocument),
        description="In chunks of half a second, each once it has wholly passed. Nothing before the start.",
        parameters=[
            OpenApiParameter("slot", OpenApiTypes.INT, required=True, description="Of the running order."),
            OpenApiParameter("after", OpenApiTypes.INT, description="The last chunk that you have; -1 for none."),
        ],
    )
    def get(self, request: Request, event: LiveEvent) -> PosesDocument:
        slot = slot_in(event, request.query_params.get("slot", ""))
        return poses_document(slot, after_in(request.query_params.get("after", "")))


def slot_in(event: LiveEvent, written: str) -> LiveSlot:
    """The slot that a query names. Raises Http404."""
    if not (written.isdecimal() and len(written) < 12):
        raise Http404
    return get_object_or_404(LiveSlot, event=event, pk=int(written))


def after_in(written: str) -> int:
    """The chunk that a query names; -1 for none."""
    return int(written) if written.isdecimal() and len(written) < 9 else -1


SpeedSerializer = serializer_of(SpeedDocument)


class SpeedAskedSerializer(Body):
    """A command."""

    racer = serializers.CharField(required=False, max_length=64, help_text="Whose car, for their deputy.")
    when = serializers.ChoiceField(["start", "now"], help_text="start: of the next runs; now: of the one on track.")
    mode = serializers.ChoiceField(MODES)
    value = serializers.FloatField(required=False, default=0.0)


class DeputySerializer(Body):
    """The deputy, a second racer with command of the car's speed."""

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


def commanded_event(request: Request, slug: str) -> LiveEvent:
    """A live event in which the caller commands a car, as its racer or a deputy. Raises Http404,
    UserFault("live_speed_not_yours")."""
    event = live_event(request, slug)
    if not live_racers_commanded_by(request.user).filter(event=event).exists():
        raise UserFault("live_speed_not_yours")
    return event


def read_car(request: Request, slug: str) -> tuple[LiveEvent, LiveRacer]:
    """The event, and the racer of ``?racer=``, whose car the caller commands. Raises as :func:`commanded_racer`."""
    event = live_event(request, slug)
    return event, commanded_racer(event, request, request.query_params.get("racer", ""))


class LiveSpeedView(PrivateView):
    """The speed of a car."""

    token_scope = RACE

    @operation(
        "read_live_speed",
        "What you command of a car's speed",
        find=read_car,
        answer=SpeedSerializer,
        parameters=[OpenApiParameter("racer", str, description="Whose car, for their deputy.")],
    )
    def get(self, request: Request, found: tuple[LiveEvent, LiveRacer]) -> SpeedDocument:
        return speed_document(*found, timezone.now())

    @operation(
        "command_live_speed",
        "Command a car's speed",
        find=commanded_event,
        body=SpeedAskedSerializer,
        answer=SpeedSerializer,
        description="Of a run on track it takes effect at the moment that `coming` names, or expires there.",
    )
    def post(self, request: Request, event: LiveEvent, asked: dict) -> SpeedDocument:
        now, by = timezone.now(), racer_of(request)
        mine = commanded_racer(event, request, asked.get("racer", ""))
        command = command_start if asked["when"] == "start" else command_now
        command(event=event, racer=mine, by=by, mode=asked["mode"], value=asked["value"], now=now)
        mine.refresh_from_db()
        return speed_document(event, mine, now)

    @operation(
        "name_live_deputy",
        "Let somebody else command your car's speed as well, or nobody",
        find=entered_event,
        body=DeputySerializer,
        answer=SpeedSerializer,
    )
    def patch(self, request: Request, event: LiveEvent, asked: dict) -> SpeedDocument:
        now = timezone.now()
        mine = name_deputy(event=event, racer=racer_of(request), alias=asked["deputy"], now=now)
        return speed_document(event, mine, now)
