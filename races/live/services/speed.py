"""Racers' commands of their car's speed, before their runs and during the show.

Runs are computed ahead, so a command during the show computes the run again, sealed as before, with one more command.
It takes effect at a set moment, :func:`effect_ms`. Both runs are identical to the bit until then, so the new run
replaces the old one without a jump. If it is late or differs, the command expires with a reason and the old run stays.

While one is computed, only the newest waiting command of each car is kept; in a duel one command is computed at a time.
Whether a run was adopted becomes known at the moment of its effect, and its computing time is never published: either
would reveal how long the car still drives.
"""

import logging
from datetime import datetime, timedelta

from django.db import transaction

from accounts.models import Racer
from evaluation.models import Evaluation, Result, State
from evaluation.running.queue.order import URGENT
from evaluation.running.queue.services import discard_sealed, queue_evaluation
from paddock.errors import UserFault
from paddock.rules.race import RaceRules
from paddock.rules.speed import MODEL_SPEED, MODES, MOST_COMMANDS, VALUES, SpeedCommand

from ...models import LiveEvent, LiveRacer, LiveSlot, LiveState, SlotState
from ..selectors import speed as commands
from ..streaming.pose_chunks import CHUNK_MS, chunks_of
from .event_action import publish_change
from .roll_call import drop_computed, entry_in, open_to_racers
from .sealing import prepare_after_commit

logger = logging.getLogger(__name__)
BETWEEN = timedelta(seconds=2)  # two commands for a car
LEAST_LEAD_MS = 3_000
LEAD_SHARE = 20  # of the time of an attempt, for computing it: 180 s take 9 s


def effect_ms(event: LiveEvent, played_ms: int) -> int:
    """When a command takes effect that is given ``played_ms`` after the start: 3 s and a twentieth of an attempt's time
    later, on the next whole second. Nothing of the run itself is in it."""
    due = max(0, played_ms) + LEAST_LEAD_MS + event.attempt_ms // LEAD_SHARE
    return -(-due // 1000) * 1000


@transaction.atomic
def command_start(
    *, event: LiveEvent, racer: LiveRacer, by: Racer, mode: str, value: float, now: datetime
) -> LiveRacer:
    """Set the start speed of the racer's uncalled runs, and compute again those that were computed with another. Raises
    UserFault as :func:`_open`, ``live_speed_called`` while a run of theirs is called."""
    event, racer = _open(event, racer, by, now)
    command = _command(mode, value, by)
    if commands.slots_of_racer(racer).filter(state=SlotState.CALLED).exists():
        raise UserFault("live_speed_called")
    racer.speed = None if mode == MODEL_SPEED else command
    racer.speed_at = now
    racer.save(update_fields=["speed", "speed_at"])
    drop_computed(racer, but=None, now=now)
    prepare_after_commit(event, now)
    _publish(event, now)
    return racer


@transaction.atomic
def command_now(*, event: LiveEvent, racer: LiveRacer, by: Racer, mode: str, value: float, now: datetime) -> LiveSlot:
    """Command the car on track. Returns its slot, with the command in ``speed_next``, or in ``speed_wish`` while
    another is computed. Raises UserFault as :func:`_open`, ``live_speed_not_driving``, ``live_speed_full`` after 200
    commands."""
    event, racer = _open(event, racer, by, now)
    driven = commands.slot_driven_by(racer)
    if driven is None or driven[0].starts_at is None or driven[0].ends_at is None or driven[0].ends_at <= now:
        raise UserFault("live_speed_not_driving")
    slot, car = driven
    command: commands.WaitingCommand = {**_command(mode, value, by), "car": car}
    if len(slot.speed_log or []) + (slot.speed_next is not None) >= MOST_COMMANDS:
        raise UserFault("live_speed_full", most=MOST_COMMANDS)
    LiveSlot.objects.filter(pk=slot.pk, speed_reason=commands.late_for(car)).update(speed_reason=None)
    if slot.speed_next is None:
        _compute(event, slot, command, now)
    else:
        # of each car the last one that waits wins, in the place of the one before
        slot.speed_wish = [
            *(one for one in commands.wishes_of(slot.speed_wish) if commands.car_of(one) != car),
            command,
        ]
        slot.save(update_fields=["speed_wish"])
    LiveRacer.objects.filter(pk=racer.pk).update(speed_at=now)
    _publish(event, now)
    return slot


@transaction.atomic
def name_deputy(*, event: LiveEvent, racer: Racer, alias: str, now: datetime) -> LiveRacer:
    """Name a deputy with command of the car's speed; an empty ``alias`` removes the deputy. Raises UserFault
    ``live_over``, ``live_speed_off``, ``live_not_in``, ``live_deputy_unknown``, ``live_deputy_self``."""
    event = _lock(event)
    entry = entry_in(event, racer)
    deputy = None
    if alias:
        deputy = Racer.objects.filter(alias__iexact=alias, is_active=True).first()
        if deputy is None:
            raise UserFault("live_deputy_unknown", alias=alias[:64])
        if deputy.pk == racer.pk:
            raise UserFault("live_deputy_self")
    mine, _ = LiveRacer.objects.update_or_create(event=event, entry=entry, defaults={"deputy": deputy})
    _publish(event, now)
    return mine


@transaction.atomic
def settle_speed(*, event: LiveEvent, now: datetime) -> int:
    """Do what has become due with commands in this event: a new run takes the place of the old, or expires; what waited
    is computed; what belongs to a run that is not played any more is thrown away. Returns how many things."""
    waiting = LiveSlot.objects.filter(event=event, speed_next__isnull=False)
    if not waiting.exists():
        return 0
    event = LiveEvent.objects.select_for_update(of=("self",)).select_related("race__track").get(pk=event.pk)
    done = 0
    for slot in waiting.select_related("racer__entry__racer").order_by("pk"):
        done += _settle(event, slot, now)
    return done


def forget_speed(slot: LiveSlot, now: datetime) -> None:
    """Throw away the run with a command that was not adopted, and what waited. The caller holds the event."""
    run = None if slot.speed_run_id is None else Evaluation.with_sealed.get(pk=slot.speed_run_id)
    slot.speed_next = slot.speed_run = slot.speed_wish = None
    LiveSlot.objects.filter(pk=slot.pk).update(speed_next=None, speed_run=None, speed_wish=None)
    if run is not None:
        discard_sealed(evaluation=run, now=now)


def _settle(event: LiveEvent, slot: LiveSlot, now: datetime) -> int:
    if slot.state != SlotState.RUNNING or slot.starts_at is None:
        forget_speed(slot, now)
        return 1
    run = None  # once it was adopted
    if slot.speed_run_id is not None:
        run = Evaluation.with_sealed.filter(pk=slot.speed_run_id).first()
    at_ms = slot.speed_next["at_ms"]
    due = now >= slot.starts_at + timedelta(milliseconds=at_ms)
    adopted = slot.speed_next.get("adopted", False)
    if not adopted and not due and now >= slot.starts_at and run is not None and run.is_final:
        if _fits(slot, run, at_ms):
            _adopt(slot, run, now)
            return 1
        return 0  # it expires at its moment, as one that is late does
    if not due:
        return 0
    car, wishes = commands.car_of(slot.speed_next), commands.wishes_of(slot.speed_wish)
    forget_speed(slot, now)
    LiveSlot.objects.filter(pk=slot.pk).update(speed_reason=None if adopted else commands.late_for(car))
    slot.refresh_from_db()
    if wishes and slot.ends_at is not None and now < slot.ends_at:
        slot.speed_wish = wishes[1:] or None
        _compute(event, slot, wishes[0], now)
    _publish(event, now)
    return 1


def _fits(slot: LiveSlot, run: Evaluation, at_ms: int) -> bool:
    """Whether a run is identical to the bit to the played one until the command takes effect."""
    if run.state != State.FINISHED:
        return False
    old = Result.with_sealed.filter(evaluation=slot.evaluation_id).first()
    new = Result.with_sealed.filter(evaluation=run).first()
    if old is None or new is None:
        return False
    until = at_ms // CHUNK_MS
    same = chunks_of(old)[:until] == chunks_of(new)[:until]
    if not same:
        logger.error("The run of slot %s with one command more differs before that command: it is not shown.", slot.pk)
    return same


def _adopt(slot: LiveSlot, run: Evaluation, now: datetime) -> None:
    """Play the new run from now on. Until its effect the command is shown as coming, whatever its outcome."""
    assert slot.starts_at is not None and slot.evaluation_id is not None, "it is on track"
    old = Evaluation.with_sealed.get(pk=slot.evaluation_id)
    lasts_ms = Result.with_sealed.values_list("simulated_ms", flat=True).get(evaluation=run)
    LiveSlot.objects.filter(pk=slot.pk).update(
        evaluation=run,
        ends_at=slot.starts_at + timedelta(milliseconds=lasts_ms),
        speed_log=[*(slot.speed_log or []), slot.speed_next],
        speed_next={**slot.speed_next, "adopted": True},
        speed_run=None,
    )
    discard_sealed(evaluation=old, now=now)


def _compute(event: LiveEvent, slot: LiveSlot, command: commands.WaitingCommand, now: datetime) -> None:
    """Queue the run with one command more. The caller holds the event."""
    assert slot.starts_at is not None
    assert slot.evaluation_id is not None
    played = (now - slot.starts_at) // timedelta(milliseconds=1)
    coming = commands.stored(effect_ms(event, played), command, commands.car_of(command))
    old = Evaluation.with_sealed.select_related("owner", "model__owner", "track").get(pk=slot.evaluation_id)
    rivals = old.rivals.select_related("model__owner", "model__network").order_by("number")
    run = queue_evaluation(
        owner=old.owner,
        model=old.model,
        track=old.track,
        rules=commands.rules_with(RaceRules.from_dict(old.spec["rules"]), [*(slot.speed_log or []), coming]),
        rivals=[rival.model for rival in rivals],
        priority=URGENT,
        checked=True,  # it was when the run was first computed, and it is on track
        sealed=True,
        now=now,
    )
    slot.speed_next, slot.speed_run = coming, run
    slot.save(update_fields=["speed_next", "speed_run", "speed_wish"])


def _lock(event: LiveEvent) -> LiveEvent:
    locked = open_to_racers(event)
    if not locked.speed_control:
        raise UserFault("live_speed_off")
    return locked


def _open(event: LiveEvent, racer: LiveRacer, by: Racer, now: datetime) -> tuple[LiveEvent, LiveRacer]:
    """The event, locked, and its racer. Raises UserFault ``live_over``, ``live_speed_off``, ``live_speed_not_yours``,
    ``live_speed_often`` within two seconds of the last."""
    event = _lock(event)
    fresh = LiveRacer.objects.select_related("entry__racer").get(pk=racer.pk, event=event)
    if not commands.commands_speed(by, fresh):
        raise UserFault("live_speed_not_yours")
    if fresh.speed_at is not None and now < fresh.speed_at + BETWEEN:
        raise UserFault("live_speed_often", seconds=BETWEEN.seconds, wait_s=BETWEEN.seconds)
    return event, fresh


def _command(mode: str, value: float, by: Racer) -> commands.SpeedStartDocument:
    """A command without its moment. Raises UserFault ``live_speed_mode``, ``live_speed_value``."""
    if mode not in MODES:
        raise UserFault("live_speed_mode", known=", ".join(MODES))
    if mode == MODEL_SPEED:
        value = 0.0
    least, most = VALUES[mode]
    try:
        SpeedCommand(0, mode, value)
    except ValueError as error:
        raise UserFault("live_speed_value", least=f"{least:g}", most=f"{most:g}") from error
    return {"mode": mode, "value": value, "by": by.alias}


def _publish(event: LiveEvent, now: datetime) -> None:
    if event.state != LiveState.PLANNED:
        publish_change(event, now)
