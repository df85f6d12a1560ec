"""Queues and stops evaluations; unseals or discards those that were computed ahead."""

from collections.abc import Sequence
from datetime import datetime

from django.db import transaction
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from paddock.errors import UserFault
from paddock.rules.race import RaceRules
from tracks.models import Track

from ...models import Evaluation, EvaluationRival, Result, State, TrainedModel
from ...selectors import can_use_model
from ...signals import evaluation_ended
from ..events import record_end, record_queued
from ..race_setup import check_rivals
from ..results import delete_evaluation
from .jobs import EVALUATIONS, tell_end
from .order import URGENT
from .turns import hurry_from, insert_in_turn


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
    """Freeze a run and put it into the queue; a worker is woken once the transaction is committed.

    ``closes_at``: when the race closes; within the last hour the run goes before others. ``rivals``: models that race
    as cars 1, 2 and 3, of any owner; they may have left their garage. ``checked``: the caller has checked that the
    owner may drive this model. ``sealed``: hidden until :func:`unseal_evaluation`. Raises UserFault
    ``model_not_yours``, ``rivals_race_type``, ``rivals_with_bots``, ``too_many_rivals``.
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
    """Queue runs of exactly what these evaluations were specified to be, in their order."""
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
    """Queue a failed evaluation that belongs to no race again. False when it is not failed any more."""
    return EVALUATIONS.begin_anew(Evaluation.objects.filter(pk=evaluation.pk, state=State.FAILED))


@audited("run.stopped", _("Run stopped"), target="evaluation", unless="owner")
@transaction.atomic
def stop_evaluation(*, evaluation: Evaluation, now: datetime) -> bool:
    """Stop a queued or running evaluation for good. False when it had ended. Its worker finds the lease gone at the
    next beat, kills the processes and writes nothing."""
    under_way = EVALUATIONS.under_way(evaluation.pk)
    stopped = EVALUATIONS.end(under_way, state=State.STOPPED, now=now, reason_code="stopped")
    evaluation.refresh_from_db()
    if stopped:
        record_end(evaluation, None, now)
        evaluation_ended.send(sender=Evaluation, evaluation=evaluation, result=None, now=now)
    return stopped


@transaction.atomic
def unseal_evaluation(*, evaluation: Evaluation, now: datetime) -> bool:
    """Publish a sealed run that has ended. False when it was unsealed before. Raises ValueError for one that waits or
    runs."""
    if not evaluation.is_final:
        raise ValueError("a sealed run that has not ended cannot be unsealed")
    if not Evaluation.with_sealed.filter(pk=evaluation.pk, sealed=True).update(sealed=False):
        return False
    evaluation.sealed = False
    tell_end(evaluation.pk, Result.with_sealed.filter(evaluation=evaluation).first(), now)
    return True


@transaction.atomic
def discard_sealed(*, evaluation: Evaluation, now: datetime) -> bool:
    """Delete a sealed run in any state. False when it is not sealed any more. Nothing may refer to it."""
    found = Evaluation.with_sealed.select_for_update().filter(pk=evaluation.pk, sealed=True).first()
    if found is None:
        return False
    stop_evaluation(evaluation=found, now=now)
    delete_evaluation(evaluation=found)
    return True
