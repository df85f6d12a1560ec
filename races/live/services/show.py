"""The show: begin, launch and reveal runs, pause, resume and end."""

from datetime import datetime, timedelta

from django.core.cache import cache
from django.db import IntegrityError, transaction
from django.db.models import F

from accounts.models import Racer
from core.events import record
from evaluation.models import Evaluation, Result, State
from evaluation.running.queue.services import unseal_evaluation
from paddock.errors import UserFault

from ...duels.services import draw_duels
from ...entries.services.locks import lock_entry
from ...events import LIVE_SHOWN, of_race
from ...models import (
    COUNTDOWN,
    REVEALED_AFTER,
    Entry,
    LiveEvent,
    LiveOrder,
    LiveRacer,
    LiveReaction,
    LiveSlot,
    LiveState,
    Opponents,
    ReactionKind,
    SlotState,
    Submission,
)
from ...models.live import TO_COME, UNDER_WAY
from ..selectors.events import duels_are_open, live_standings, takes_reactions
from .event_action import acting
from .roll_call import LACKS_CAR, require_stayed, take_roll
from .sealing import arrange_heats, hand_heat_over, next_slots, prepare_after_commit
from .speed import forget_speed

_NO_PLACE = 2**31 - 1


def begin_live(*, event: LiveEvent, by: Racer | None, seen: int | None, now: datetime) -> LiveEvent:
    """Begin an event, before its time if its organisers like: the running order is written, the first runs computed.
    Raises UserFault as ``acting``, ``live_nobody``; for duels as :func:`races.duels.services.draw_duels`."""
    with acting(event, "begin", by=by, seen=seen, now=now, states=(LiveState.PLANNED,)) as act:
        racers = in_order(act.event, take_roll(act.event))
        if not racers:
            raise UserFault("live_nobody")
        slots: list[LiveSlot] = []
        if act.event.race.opponents == Opponents.MODELS:
            draw_duels(race=act.event.race, now=now)
            arrange_heats(act.event, now)
            if not LiveSlot.objects.filter(event=act.event).exists():
                raise UserFault("live_nobody")
            racers, rounds = [], 0
        else:
            rounds = act.event.rounds
        for round_ in range(1, rounds + 1):
            for racer in racers:
                absent = act.event.roll_call and racer.here_at is None
                slots.append(
                    LiveSlot(
                        event=act.event,
                        racer=racer,
                        round=round_,
                        position=len(slots) + 1,
                        state=SlotState.HELD if absent else SlotState.WAITING,
                        reason_code="live_absent" if absent else "",
                    )
                )
        LiveSlot.objects.bulk_create(slots)
        act.event.state, act.event.begun_at = LiveState.RUNNING, now
        act.details["racers"] = LiveRacer.objects.filter(event=act.event).count()
        act.final = True
        prepare_after_commit(act.event, now)
    return event


def in_order(event: LiveEvent, racers: list[LiveRacer]) -> list[LiveRacer]:
    """Racers (as they entered) in the order of the event, those without a qualifying result first."""
    if event.order == LiveOrder.AS_ENTERED:
        return racers
    slowest_first = sorted(racers, key=lambda racer: -(racer.qualified_rank or _NO_PLACE))
    return slowest_first if event.order == LiveOrder.SLOWEST_FIRST else slowest_first[::-1]


def launch(
    *, event: LiveEvent, by: Racer | None, seen: int | None, now: datetime, slot: LiveSlot | int | None = None
) -> LiveSlot:
    """Start the countdown of a computed run: that of ``slot``, or the next one.

    It plays from ``starts_at`` on, ten seconds from now, for everybody at the same instant. Raises UserFault as
    ``acting``, ``live_busy`` while a run is played, ``live_nothing_next``, ``live_slot_state``, ``live_not_ready``
    while it is being computed, ``live_no_model``, ``live_car_queued``, ``live_left`` for a racer who left the race.
    """
    with acting(event, "launch", by=by, seen=seen, now=now, states=(LiveState.RUNNING,)) as act:
        if LiveSlot.objects.filter(event=act.event, state=SlotState.RUNNING).exists():
            raise UserFault("live_busy")
        if slot is None:
            coming = next_slots(act.event)
            if not coming:
                raise UserFault("live_nothing_next")
            slot = coming[0]
        found = act.slot(slot)
        if found.state not in TO_COME:
            raise UserFault("live_slot_state", state=found.get_state_display())
        require_stayed(found)
        lasts_ms = ready_ms(found)
        LiveSlot.objects.filter(event=act.event, state=SlotState.CALLED).exclude(pk=found.pk).update(
            state=SlotState.WAITING
        )
        found.state, found.starts_at = SlotState.RUNNING, now + COUNTDOWN
        found.ends_at = found.starts_at + timedelta(milliseconds=lasts_ms)
        found.reason_code = ""
        found.save(update_fields=["state", "starts_at", "ends_at", "reason_code"])
        act.event.clock_at = None
        prepare_after_commit(act.event, now)
    return found


def interrupt(*, event: LiveEvent, slot: LiveSlot, now: datetime) -> LiveSlot:
    """The site was away while a run was shown: show it again from its start, the same run. In an event that runs by
    itself its countdown begins at once; otherwise the slot is held as ``live_interrupted`` until an organiser releases
    it. Raises UserFault as ``acting``, ``live_slot_state``."""
    with acting(event, "interrupt", by=None, seen=None, now=now, states=UNDER_WAY) as act:
        found = act.slot(slot)
        if found.state != SlotState.RUNNING or found.starts_at is None or found.ends_at is None:
            raise UserFault("live_slot_state", state=found.get_state_display())
        forget_speed(found, now)
        found.interrupted_at, found.reason_code = now, "live_interrupted"
        if act.event.auto_run and act.event.state == LiveState.RUNNING:
            lasts = found.ends_at - found.starts_at
            found.starts_at = now + COUNTDOWN
            found.ends_at = found.starts_at + lasts
        else:
            found.state, found.starts_at, found.ends_at = SlotState.HELD, None, None
        found.save(update_fields=["state", "starts_at", "ends_at", "reason_code", "interrupted_at"])
        act.event.clock_at = None
        act.final = True
    return found


def ready_ms(slot: LiveSlot) -> int:
    """How long a computed run plays, in milliseconds; 0 for a car that failed. Raises UserFault."""
    evaluation = slot.evaluation
    if evaluation is None:
        raise UserFault(slot.reason_code if slot.reason_code in LACKS_CAR else "live_not_ready")
    if not evaluation.is_final or evaluation.state == State.STOPPED or evaluation.is_platform_fault:
        raise UserFault("live_not_ready")  # such an end is not the car's fault: the run is computed again
    if evaluation.state != State.FINISHED:
        return 0
    return Result.with_sealed.values_list("simulated_ms", flat=True).get(evaluation=evaluation)


@transaction.atomic
def reveal(*, slot: LiveSlot, now: datetime) -> bool:
    """Let a run that has been played to its end be a result of its race, once. False when that is not due, or done. Its
    submission is written (or its heat decided), the run unsealed, the standing and ``race.result`` with it: all or
    nothing."""
    event = LiveEvent.objects.select_for_update(of=("self",)).select_related("race").get(pk=slot.event_id)
    due = LiveSlot.objects.filter(pk=slot.pk, state=SlotState.RUNNING, ends_at__lte=now - REVEALED_AFTER)
    if not due.update(state=SlotState.DONE, done_at=now):
        return False
    slot = LiveSlot.objects.select_related("racer__entry__racer", "duel").get(pk=slot.pk)
    forget_speed(slot, now)
    assert slot.evaluation_id is not None
    evaluation = (
        Evaluation.with_sealed.select_for_update(of=("self",)).select_related("model").get(pk=slot.evaluation_id)
    )
    assert slot.starts_at is not None, "it was launched"
    submission = None
    if slot.racer is None:
        hand_heat_over(slot, evaluation)
    else:
        submission = _submit(slot.racer.entry, evaluation, slot.starts_at)
    reason = evaluation.reason_code if evaluation.state != State.FINISHED else ""
    LiveSlot.objects.filter(pk=slot.pk).update(submission=submission, reason_code=reason)
    LiveEvent.objects.filter(pk=event.pk).update(last_at=now)
    unseal_evaluation(evaluation=evaluation, now=now)
    record(LIVE_SHOWN, at=now, **of_race(event.race), once=evaluation.public_id)
    prepare_after_commit(event, now)
    return True


def _submit(entry: Entry, evaluation: Evaluation, at: datetime) -> Submission:
    entry = lock_entry(entry.pk)
    Entry.objects.filter(pk=entry.pk).update(last_number=F("last_number") + 1)
    entry.refresh_from_db(fields=["last_number"])
    return Submission.objects.create(
        entry=entry,
        number=entry.last_number,
        evaluation=evaluation,
        network_id=evaluation.model.network_id,
        submitted_at=at,
        is_live=True,
    )


def pause_live(*, event: LiveEvent, by: Racer, seen: int | None, now: datetime) -> LiveEvent:
    """Launch nothing more until the event goes on; a run that is on track drives to its end."""
    with acting(event, "pause", by=by, seen=seen, now=now, states=(LiveState.RUNNING,)) as act:
        act.event.state = LiveState.PAUSED
    return event


def resume_live(*, event: LiveEvent, by: Racer, seen: int | None, now: datetime) -> LiveEvent:
    """Go on after a pause."""
    with acting(event, "resume", by=by, seen=seen, now=now, states=(LiveState.PAUSED,)) as act:
        act.event.state = LiveState.RUNNING
    return event


def end_live(*, event: LiveEvent, by: Racer | None, seen: int | None, now: datetime) -> LiveEvent:
    """End the event: the leader wins unless a winner was declared, and runs never shown are discarded once the end can
    no longer be undone. Raises UserFault as ``acting``, ``live_busy`` while a run is played."""
    with acting(event, "end", by=by, seen=seen, now=now, states=UNDER_WAY) as act:
        if LiveSlot.objects.filter(event=act.event, state=SlotState.RUNNING).exists():
            raise UserFault("live_busy")
        if act.event.winner_id is None and not duels_are_open(act.event.race):
            first = next((row for row in live_standings(act.event) if row.rank == 1), None)
            act.event.winner_id = None if first is None else first.racer.entry_id
        act.event.state, act.event.ended_at = LiveState.ENDED, now
        act.event.podium_at = act.event.podium_at or now
    return event


def set_message(*, event: LiveEvent, message: str, by: Racer, seen: int | None, now: datetime) -> LiveEvent:
    """Show everybody a line of text; an empty one takes it away. Raises UserFault as ``acting``, ``live_message``."""
    message = " ".join(message.split())
    most = LiveEvent._meta.get_field("message").max_length or 0
    if len(message) > most:
        raise UserFault("live_message", most=most)
    with acting(event, "message", by=by, seen=seen, now=now) as act:
        act.event.message = message
        act.details["message"] = message
    return event


def crown(*, event: LiveEvent, entry: Entry, by: Racer, seen: int | None, now: datetime) -> LiveEvent:
    """Declare the winner. Raises UserFault as ``acting``, ``live_not_in`` for racers who do not take part."""
    with acting(event, "winner", by=by, seen=seen, now=now, states=(*UNDER_WAY, LiveState.ENDED)) as act:
        if not LiveRacer.objects.filter(event=act.event, entry=entry, entry__withdrawn_at=None).exists():
            raise UserFault("live_not_in")
        act.event.winner = entry
        act.details["racer"] = entry.racer.alias
    return event


def show_podium(*, event: LiveEvent, by: Racer, seen: int | None, now: datetime) -> LiveEvent:
    """Show the podium to everybody. Raises UserFault as ``acting``."""
    with acting(event, "podium", by=by, seen=seen, now=now, states=(*UNDER_WAY, LiveState.ENDED)) as act:
        act.event.podium_at = now
    return event


WINDOW_S = 10
MOST_IN_A_WINDOW = 8
MOST_OF_AN_ADDRESS = 240  # a school behind one address


def react(*, event: LiveEvent, kind: str, session: str, address: str, now: datetime) -> None:
    """Count a reaction of the spectator with this session key, at this network address. Raises UserFault
    ``live_reaction_unknown``, ``live_reactions_closed`` before the lobby and after the show,
    ``live_reactions_too_many``."""
    if kind not in ReactionKind.values:
        raise UserFault("live_reaction_unknown", known=", ".join(ReactionKind.values))
    if not takes_reactions(event, now):
        raise UserFault("live_reactions_closed")
    window = int(now.timestamp()) // WINDOW_S
    for sender, most in ((f"s:{session}", MOST_IN_A_WINDOW), (f"a:{address}", MOST_OF_AN_ADDRESS)):
        if _counted(f"live-react:{event.pk}:{sender}:{window}") > most:
            raise UserFault("live_reactions_too_many")
    rows = LiveReaction.objects.filter(event=event, kind=kind)
    if rows.update(count=F("count") + 1):
        return
    try:
        with transaction.atomic():
            LiveReaction.objects.create(event=event, kind=kind, count=1)
    except IntegrityError:  # somebody else was the first
        rows.update(count=F("count") + 1)


def _counted(key: str) -> int:
    cache.add(key, 0, 2 * WINDOW_S)
    try:
        return cache.incr(key)
    except ValueError:  # it ran out in between
        return 1
