"""Participants of a live event, their models and check-ins."""

from datetime import datetime

from django.db import transaction
from django.db.models import F, Max, QuerySet

from accounts.models import Racer
from evaluation.models import FINAL_STATES, Evaluation, TrainedModel
from evaluation.running.queue.services import discard_sealed
from evaluation.selectors import can_use_model
from paddock.errors import UserFault

from ...boards.selectors.board import ranks_of
from ...entries.services.cars import take_place
from ...entries.services.locks import lock_entry
from ...models import (
    Entry,
    LiveEvent,
    LiveRacer,
    LiveSlot,
    LiveState,
    Opponents,
    Race,
    SlotState,
    Submission,
)
from ...models.live import TO_COME, UNDER_WAY
from ...models.sensors import require_offered
from ..selectors.speed import slots_of_racer
from .event_action import acting, publish_change

# Why a slot waits for a car; the clock releases it once there is one.
LACKS_CAR = ("live_no_model", "live_car_queued")
STILL_TO_DRIVE = (*TO_COME, SlotState.HELD, SlotState.SKIPPED)


@transaction.atomic
def choose_model(*, event: LiveEvent, racer: Racer, model: TrainedModel, now: datetime) -> LiveRacer:
    """Choose what to drive with in a live event: one model, another as long as models are chosen. What was computed
    ahead with the one before is thrown away.

    Raises UserFault ``live_over``, ``live_submissions_closed``, ``live_called`` once the racer's next run is called,
    ``live_not_in``, ``model_not_yours``, ``sensors_not_offered``, ``car_of_another``.
    """
    event = open_to_racers(event)
    if not event.submissions_open:
        raise UserFault("live_submissions_closed")
    if not can_use_model(racer, model):
        raise UserFault("model_not_yours")
    entry = entry_in(event, racer)
    mine = LiveRacer.objects.filter(event=event, entry=entry).first()
    if mine is not None and slots_of_racer(mine).filter(state__in=(SlotState.CALLED, SlotState.RUNNING)).exists():
        raise UserFault("live_called")
    require_offered(model.sensors, event.race.sensors)
    if mine is not None:
        drop_computed(mine, but=model, now=now)
    entry = lock_entry(entry.pk)
    take_place(entry=entry, race=entry.race, network=model.network)
    mine, _ = LiveRacer.objects.update_or_create(event=event, entry=entry, defaults={"model": model})
    publish_change(event, now)
    return mine


@transaction.atomic
def check_in(*, event: LiveEvent, racer: Racer, now: datetime) -> LiveRacer:
    """Answer the roll call, from the opening of the lobby on. Once is enough. Raises UserFault ``live_over``,
    ``live_lobby_closed``, ``live_not_in``."""
    event = open_to_racers(event)
    if event.state == LiveState.PLANNED and not event.in_lobby(now):
        raise UserFault("live_lobby_closed")
    mine, _ = LiveRacer.objects.get_or_create(event=event, entry=entry_in(event, racer))
    if mine.here_at is None:
        mine.here_at = now
        mine.save(update_fields=["here_at"])
        publish_change(event, now)
    return mine


def add_late(*, event: LiveEvent, entry: Entry, by: Racer, seen: int | None, now: datetime) -> LiveRacer:
    """Add a late racer at the end of each remaining round. Raises UserFault as ``acting``, ``live_not_in`` for racers
    outside the race, ``live_already_in``, ``live_drawn`` in duels."""
    with acting(event, "add", by=by, seen=seen, now=now, states=UNDER_WAY) as act:
        if act.event.race.opponents == Opponents.MODELS:
            raise UserFault("live_drawn")
        found = racers_of(act.event.race).filter(pk=entry.pk).first()
        if found is None:
            raise UserFault("live_not_in")
        racer, _ = LiveRacer.objects.get_or_create(event=act.event, entry=found)
        if LiveSlot.objects.filter(racer=racer).exclude(state=SlotState.REMOVED).exists():
            raise UserFault("live_already_in")
        act.details["racer"] = found.racer.alias
        note_qualifying([racer])
        attempts = LiveSlot.objects.filter(racer=racer).aggregate(most=Max("attempt"))["most"] or 0
        for round_ in range(_round_on(act.event), act.event.rounds + 1):
            last = LiveSlot.objects.filter(event=act.event, round__lte=round_).aggregate(at=Max("position"))["at"] or 0
            LiveSlot.objects.filter(event=act.event, position__gt=last).update(position=F("position") + 1)
            LiveSlot.objects.create(event=act.event, racer=racer, round=round_, attempt=attempts + 1, position=last + 1)
    return racer


def racers_of(race: Race) -> QuerySet[Entry]:
    """The entries of a race that may take part in its live event."""
    entries = Entry.objects.filter(race=race, withdrawn_at=None, is_baseline=False)
    return entries.select_related("racer", "best__evaluation__model__owner")


def take_roll(event: LiveEvent) -> list[LiveRacer]:
    """Every racer of the race is in its live event, with how they qualified. The caller holds the event."""
    entries = list(racers_of(event.race).order_by("pk"))
    known = set(LiveRacer.objects.filter(event=event).values_list("entry", flat=True))
    LiveRacer.objects.bulk_create(LiveRacer(event=event, entry=entry) for entry in entries if entry.pk not in known)
    racers = LiveRacer.objects.filter(event=event, entry__in=entries)
    found = list(
        racers.select_related("entry__racer", "entry__race", "model__owner").order_by("entry__entered_at", "entry__pk")
    )
    note_qualifying(found)
    return found


def note_qualifying(racers: list[LiveRacer]) -> None:
    """Write down how they stand in the race now."""
    ranks = ranks_of([racer.entry for racer in racers])
    for racer in racers:
        racer.qualified_rank = ranks[racer.entry_id]
        racer.qualified_ms = racer.entry.score_ms if racer.entry.classified else None
    LiveRacer.objects.bulk_update(racers, ["qualified_rank", "qualified_ms"])


def model_of(racer: LiveRacer) -> TrainedModel | None:
    """The racer's model: the chosen one, else that of the result; None once it has left the garage."""
    best = racer.entry.best
    model = racer.model or (best.evaluation.model if best is not None else None)
    return model if model is not None and can_use_model(racer.entry.racer, model) else None


def lacks_car(racer: LiveRacer) -> str:
    """Why a racer without a model has none: ``live_car_queued`` while a car of theirs waits or drives in the race's
    queue, else ``live_no_model``."""
    on_its_way = Submission.objects.filter(entry=racer.entry_id).exclude(evaluation__state__in=FINAL_STATES)
    return "live_car_queued" if on_its_way.exists() else "live_no_model"


def drop_computed(racer: LiveRacer, *, but: TrainedModel | None, now: datetime) -> None:
    """Discard a racer's computed and not yet launched runs with models other than ``but``. An interrupted run stays:
    spectators saw its beginning."""
    slots = slots_of_racer(racer).filter(evaluation__sealed=True, interrupted_at=None)
    for slot in slots.exclude(state=SlotState.RUNNING).select_related("evaluation"):
        evaluation = slot.evaluation
        if evaluation is not None and (but is None or slot.duel_id is not None or evaluation.model_id != but.pk):
            throw_away(slot, evaluation, now)


def throw_away(slot: LiveSlot, evaluation: Evaluation, now: datetime) -> None:
    """Discard the sealed, never shown run of a slot."""
    LiveSlot.objects.filter(pk=slot.pk).update(evaluation=None, reason_code="")
    discard_sealed(evaluation=evaluation, now=now)


def take_out_left(event: LiveEvent, now: datetime) -> int:
    """Take out of the running order what is still to come of racers who have left the race, and throw away what was
    computed for it. Returns how many places. The caller holds the event. Heats are their draw's to arrange."""
    slots = LiveSlot.objects.filter(event=event, racer__entry__withdrawn_at__isnull=False, state__in=STILL_TO_DRIVE)
    found = list(slots.select_related("evaluation"))
    for slot in found:
        if slot.evaluation is not None:
            throw_away(slot, slot.evaluation, now)
        LiveSlot.objects.filter(pk=slot.pk).update(state=SlotState.REMOVED, reason_code="live_left")
    if found:
        publish_change(event, now)
    return len(found)


def require_stayed(slot: LiveSlot) -> None:
    """Raises UserFault("live_left") where its racer has left the race."""
    if slot.racer is not None and slot.racer.entry.is_withdrawn:
        raise UserFault("live_left")


def open_to_racers(event: LiveEvent) -> LiveEvent:
    """The event, locked. Raises UserFault("live_over")."""
    locked = LiveEvent.objects.select_for_update(of=("self",)).select_related("race__track").get(pk=event.pk)
    if locked.is_over:
        raise UserFault("live_over")
    return locked


def entry_in(event: LiveEvent, racer: Racer) -> Entry:
    """The racer's entry. Raises UserFault("live_not_in")."""
    entry = racers_of(event.race).filter(racer=racer).first()
    if entry is None:
        raise UserFault("live_not_in")
    return entry


def _round_on(event: LiveEvent) -> int:
    """The current round: the first with runs to come, else the last."""
    to_come = (SlotState.WAITING, SlotState.CALLED, SlotState.RUNNING, SlotState.HELD)
    first = LiveSlot.objects.filter(event=event, state__in=to_come).order_by("position").first()
    return event.rounds if first is None else first.round
