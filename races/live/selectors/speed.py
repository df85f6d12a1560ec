"""Speed commands in a live event: the right to give them, the stored log, and the commands that may be shown."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Annotated, Any, TypedDict

from django.db.models import Q, QuerySet

from accounts.models import Viewer
from paddock.rules.race import RaceRules
from paddock.rules.speed import MODES, SpeedCommand

from ...models import HEAT_CARS, Duel, LiveEvent, LiveRacer, LiveSlot, SlotState
from .events import live_events_visible_to

LATE = "live_speed_late"


class SpeedCommandDocument(TypedDict):
    """A speed command of a car."""

    at_ms: Annotated[int, "From when on, in ms of the run."]
    mode: Annotated[str, MODES]
    value: Annotated[float, "A factor, m/s, per cent, or m/s more or less, by mode."]
    by: str


class StoredCommand(SpeedCommandDocument, total=False):
    """A command in a slot's log. ``car``: its number in a duel; ``adopted``: the run with it is being played."""

    car: int
    adopted: bool


class SpeedStartDocument(TypedDict):
    """A command that is not timed yet."""

    mode: Annotated[str, MODES]
    value: float
    by: str


class WaitingCommand(SpeedStartDocument, total=False):
    """A command to be computed after the present one."""

    car: int


class SpeedDocument(TypedDict):
    """The commands for a car. A coming command has the time of its effect; its outcome is public only then."""

    racer: str
    deputy: str | None
    start: Annotated[SpeedStartDocument | None, "How their runs begin; null: as the model wants."]
    driving: Annotated[bool, "Whether the car counts down or is on track."]
    played_ms: int | None
    log: Annotated[list[SpeedCommandDocument], "What has taken effect in the run that is on track."]
    coming: SpeedCommandDocument | None
    wished: Annotated[SpeedStartDocument | None, "What is commanded once that is over; the last wins."]
    reason: Annotated[str, "Why the last one expired."]


def late_for(car: int) -> str:
    """What a slot has as ``speed_reason`` where the last command for this car expired."""
    return f"{LATE} {car}" if car else LATE


def commands_speed(racer: Viewer, mine: LiveRacer) -> bool:
    """Whether a racer may command the car's speed: its own racer, and the deputy while able to see the event;
    organisers and staff may not. Keep in step with :func:`live_racers_commanded_by`."""
    if racer is None or not racer.is_authenticated:
        return False
    if racer.pk not in (mine.entry.racer_id, mine.deputy_id) or mine.entry.withdrawn_at is not None:
        return False
    return live_events_visible_to(racer).filter(pk=mine.event_id).exists()


def live_racers_commanded_by(racer: Viewer) -> QuerySet[LiveRacer]:
    """All participants whose car's speed this racer may command. Keep in step with :func:`commands_speed`."""
    racers = LiveRacer.objects.select_related("entry__racer", "deputy", "event__race")
    if racer is None or not racer.is_authenticated:
        return racers.none()
    events = live_events_visible_to(racer).order_by().values("pk")
    mine = Q(entry__racer_id=racer.pk) | Q(deputy_id=racer.pk)
    return racers.filter(mine, event__in=events, entry__withdrawn_at=None).order_by("pk")


def slots_of_racer(racer: LiveRacer) -> QuerySet[LiveSlot]:
    """Their attempts, or the heats that they are in."""
    heats = Duel.objects.filter(cars__entry=racer.entry_id)
    return LiveSlot.objects.filter(Q(racer=racer) | Q(duel__in=heats), event=racer.event_id)


def slot_driven_by(racer: LiveRacer) -> tuple[LiveSlot, int] | None:
    """The slot on track or counting down in which the racer drives, and their car's number in it."""
    running = slots_of_racer(racer).filter(state=SlotState.RUNNING).select_related("racer__entry", "duel")
    slot = running.prefetch_related(HEAT_CARS).first()
    if slot is None:
        return None
    numbers = [entry.pk for entry in slot.starting]
    return (slot, numbers.index(racer.entry_id)) if racer.entry_id in numbers else None


def played_ms(slot: LiveSlot, now: datetime) -> int:
    """How much of a run has passed, in milliseconds: negative while it counts down."""
    return -1 if slot.starts_at is None else (now - slot.starts_at) // timedelta(milliseconds=1)


def present_speed(slot: LiveSlot, now: datetime, car: int = 0) -> SpeedCommandDocument | None:
    """The command that a car on track drives by now; None while it drives as its model wants."""
    if slot.state != SlotState.RUNNING:
        return None
    past = commanded(slot.speed_log, played_ms(slot, now), car)
    return past[-1] if past and past[-1]["mode"] != "model_speed" else None


def speed_document(event: LiveEvent, mine: LiveRacer, now: datetime) -> SpeedDocument:
    """A car's start speed and, of its run on track, past and coming commands, for racers with its command. It does not
    reveal whether a coming command was computed before its moment."""
    driven = slot_driven_by(mine)
    found: SpeedDocument = {
        "racer": mine.entry.racer.alias,
        "deputy": None if mine.deputy is None else mine.deputy.alias,
        "start": mine.speed,
        "driving": driven is not None,
        "played_ms": None,
        "log": [],
        "coming": None,
        "wished": None,
        "reason": "",
    }
    if driven is None or event.is_over:
        return found
    slot, car = driven
    passed = played_ms(slot, now)
    found["played_ms"], found["log"] = max(0, passed), commanded(slot.speed_log, passed, car)
    if slot.speed_next is not None and car_of(slot.speed_next) == car:
        found["coming"] = public_command(slot.speed_next)
    for wish in wishes_of(slot.speed_wish):
        if car_of(wish) == car:
            found["wished"] = {"mode": wish["mode"], "value": wish["value"], "by": wish["by"]}
    found["reason"] = LATE if slot.speed_reason == late_for(car) else ""
    return found


def rules_with(rules: RaceRules, log: list[StoredCommand] | None) -> RaceRules:
    """A run's rules with its log of commands."""
    commands = tuple(SpeedCommand(one["at_ms"], one["mode"], one["value"], car_of(one)) for one in log or ())
    return replace(rules, speed_commands=commands)


def start_log(event: LiveEvent, racers: Sequence[LiveRacer | None]) -> list[StoredCommand] | None:
    """The log that a run begins with; ``racers``: those of its cars, by their numbers."""
    if not event.speed_control:
        return None
    begin = [(number, racer.speed) for number, racer in enumerate(racers) if racer is not None and racer.speed]
    return [stored(0, speed, number) for number, speed in begin] or None


def stored(at_ms: int, command: SpeedStartDocument, car: int) -> StoredCommand:
    """A command as a log has it."""
    return {"at_ms": at_ms, "mode": command["mode"], "value": command["value"], "by": command["by"], "car": car}


def commanded(log: list[StoredCommand] | None, played_ms: int, car: int = 0) -> list[SpeedCommandDocument]:
    """The commands of a log for a car that have taken effect ``played_ms`` after the start. The others are of the
    future."""
    return [public_command(one) for one in log or () if car_of(one) == car and one["at_ms"] <= played_ms]


def public_command(one: StoredCommand) -> SpeedCommandDocument:
    """A stored command without the number of its car."""
    return {"at_ms": one["at_ms"], "mode": one["mode"], "value": one["value"], "by": one["by"]}


def car_of(command: StoredCommand | WaitingCommand) -> int:
    """The number of the car that is commanded."""
    return int(command.get("car", 0))


def wishes_of(written: Any) -> list[WaitingCommand]:
    """The waiting commands, the newest of each car, oldest first."""
    return list(written or ())
