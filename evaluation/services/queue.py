"""Putting an evaluation into the queue and taking it out again."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING

from django.db import transaction

from paddock.errors import UserFault

from ..events import record_end, record_queued
from ..models import Evaluation, EvaluationRival, State, TrainedModel
from ..queue_order import URGENT
from ..rivals import check_rivals
from ..selectors import can_use_model
from ..signals import evaluation_ended
from .jobs import EVALUATIONS
from .turns import hurry_from, insert_in_turn

if TYPE_CHECKING:
    from accounts.models import Racer
    from paddock.rules.race import RaceRules
    from tracks.models import Track


@transaction.atomic
def queue_evaluation(
    *,
    owner: Racer,
    model: TrainedModel,
    track: Track,
    rules: RaceRules,
    rivals: Sequence[TrainedModel] = (),
    priority: int = 0,
    closes_at: datetime | None = None,
    checked: bool = False,
    sealed: bool = False,
    now: datetime,
) -> Evaluation:
    """Freeze what is to be run and put it into the queue; a worker is woken once the transaction is committed.

    ``closes_at``: when the race closes that waits for it; within the last hour it goes before others, whatever its
    ``priority``.

    ``rivals``: models that race along as cars 1, 2 and 3, whoever owns them: that they may meet is the caller's word.
    A run with rivals is made of models that were entered before, so one that left its garage since then still races.
    ``checked``: that the owner may drive this model, be it another's, is the caller's word too. ``sealed``: nobody
    knows of the run until :func:`~evaluation.services.unseal_evaluation`.

    Raises UserFault("model_not_yours") for somebody else's model and, alone on the track, for a deleted one;
    ``rivals_race_type``, ``rivals_with_bots``, ``too_many_rivals``.
    """
    mine = model.owner_id == owner.pk if rivals else can_use_model(owner, model)
    if not (mine or checked):
        raise UserFault("model_not_yours")
    check_rivals(rules, len(rivals))
    urgent_from = None if closes_at is None else hurry_from(closes_at)
    hurries = urgent_from is not None and urgent_from <= now
    evaluation = Evaluation(
        owner=owner,
        model=model,
        track=track,
        spec={"track": track.fingerprint, "look": track.look, "rules": rules.to_dict(), "metadata": model.metadata},
        priority=URGENT if hurries else priority,
        urgent_from=None if hurries else urgent_from,
        queued_at=now,
        sealed=sealed,
    )
    insert_in_turn([evaluation])
    EvaluationRival.objects.bulk_create(
        EvaluationRival(evaluation=evaluation, number=number, model=rival, metadata=rival.metadata)
        for number, rival in enumerate(rivals, 1)
    )
    record_queued(evaluation, now)
    EVALUATIONS.wake()
    return evaluation


@transaction.atomic
def queue_copies(*, evaluations: Sequence[Evaluation], priority: int, now: datetime) -> list[Evaluation]:
    """Queue runs of exactly what these evaluations were specified to be, in their order: frozen track, rules, metadata
    and rivals are taken over as they stand, whatever has become of the models in their owners' garages since."""
    copies = [
        Evaluation(
            owner_id=one.owner_id,
            model_id=one.model_id,
            track_id=one.track_id,
            spec=one.spec,
            priority=priority,
            queued_at=now,
        )
        for one in evaluations
    ]
    if copies:
        insert_in_turn(copies)
    by_source = {one.pk: copy for one, copy in zip(evaluations, copies, strict=True)}
    EvaluationRival.objects.bulk_create(
        EvaluationRival(
            evaluation=by_source[rival.evaluation_id],
            number=rival.number,
            model_id=rival.model_id,
            metadata=rival.metadata,
        )
        for rival in EvaluationRival.objects.filter(evaluation__in=by_source).order_by("evaluation", "number")
    )
    if copies:
        EVALUATIONS.wake(times=min(len(copies), EVALUATIONS.wakes))
    return copies


def queue_again(*, evaluation: Evaluation) -> bool:
    """Put a failed evaluation that belongs to no race back into the queue as if it had never run. False when it is not
    failed any more. What belongs to a race is run again by its submission."""
    return EVALUATIONS.begin_anew(Evaluation.objects.filter(pk=evaluation.pk, state=State.FAILED))


@transaction.atomic
def stop_evaluation(*, evaluation: Evaluation, now: datetime) -> bool:
    """Stop a queued or running evaluation for good. False when it had ended already.

    A worker that is running it finds its lease gone at the next beat, kills the processes and writes nothing.
    """
    under_way = EVALUATIONS.under_way(evaluation.pk)
    stopped = EVALUATIONS.end(under_way, state=State.STOPPED, now=now, reason_code="stopped")
    evaluation.refresh_from_db()
    if stopped:
        record_end(evaluation, None, now)
        evaluation_ended.send(sender=Evaluation, evaluation=evaluation, result=None, now=now)
    return stopped
