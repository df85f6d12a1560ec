"""A racer's own runs: asked for, driven again, deleted; and what the end of one does."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from django.db import transaction

from accounts.quotas import limit_of, used_by
from core.locks import hold
from evaluation.models import Evaluation, Result, TrainedModel
from evaluation.queue_order import OWN
from evaluation.quotas import STORAGE
from evaluation.rivals import check_rivals
from evaluation.selectors import can_see_model
from evaluation.services import delete_evaluation, queue_evaluation
from paddock.errors import UserFault
from paddock.rules.race import OWN_RULES

from ..eligibility import check_eligible
from ..models import OwnEvaluation, Race
from ..own_rules import own_rules, rules_as_in
from ..quotas import OWN_RUNS_A_DAY, OWN_RUNS_AT_ONCE
from ..selectors.own import fault_of_better
from ..selectors.terms import check_terms
from ..selectors.visibility import can_see_race
from ..sensors import not_offered
from .gates import require_open
from .submissions import submit_model

if TYPE_CHECKING:
    from accounts.models import Racer
    from tracks.models import Track

logger = logging.getLogger(__name__)
KEPT_DELETED = timedelta(days=1)


@transaction.atomic
def drive_own(
    *,
    owner: Racer,
    model: TrainedModel,
    track: Track | None = None,
    race: Race | None = None,
    rivals: Sequence[TrainedModel] = (),
    submit_if_better: bool = False,
    now: datetime,
    **options: Any,
) -> OwnEvaluation:
    """Queue a run of the racer's own, behind what races wait for.

    Either on a ``track`` with ``options``, any of :data:`paddock.rules.race.OWN_RULES`, against ``rivals`` or without;
    or as in a ``race``, whose track and rules it takes. ``submit_if_better``: the car is sent to that race if the run
    turns out better than what the racer has there.

    Raises UserFault ``own_model_gone``, ``own_rival_gone``, ``own_race_gone`` for what the racer may not use or see
    (any more), ``own_as_in_race`` for options beside a race, ``own_without_race`` for a submission without one,
    ``own_runs_at_once``, ``own_runs_a_day``, ``storage_full``; what :func:`races.own_rules.own_rules` and
    :func:`races.own_rules.rules_as_in` raise; with ``submit_if_better`` what the race says of the car today.
    """
    if not can_see_model(owner, model):
        raise UserFault("own_model_gone")
    for number, rival in enumerate(rivals, 1):
        if not can_see_model(owner, rival):
            raise UserFault("own_rival_gone", number=number)
    if race is not None:
        if track is not None or rivals or options:
            raise UserFault("own_as_in_race")
        if not can_see_race(owner, race):
            raise UserFault("own_race_gone")
        track, told = race.track, rules_as_in(race)
        if submit_if_better:
            _check_race(owner, model, race, now)
    else:
        if submit_if_better:
            raise UserFault("own_without_race")
        if track is None:
            raise UserFault("own_needs_track")
        told = own_rules(track, options, rivals=len(rivals))
        check_rivals(told.rules, len(rivals))
    hold(owner)
    _refuse_full_quota(owner, now)
    _forget_deleted(owner, now)
    evaluation = queue_evaluation(
        owner=owner, model=model, track=track, rules=told.rules, rivals=rivals, priority=OWN, checked=True, now=now
    )
    return OwnEvaluation.objects.create(
        owner=owner,
        evaluation=evaluation,
        race=race,
        submit_if_better=submit_if_better,
        asked_at=now,
        **told.ranked,
    )


def drive_own_again(*, own: OwnEvaluation, now: datetime) -> OwnEvaluation:
    """Queue a run like this one: of the same cars by the same rules, or by what its race's rules are now.

    Raises UserFault as :func:`drive_own`.
    """
    evaluation = own.evaluation
    assert evaluation is not None, "what was deleted is not found"
    if own.race is not None:
        return drive_own(
            owner=own.owner, model=evaluation.model, race=own.race, submit_if_better=own.submit_if_better, now=now
        )
    rivals = [rival.model for rival in evaluation.rivals.select_related("model__owner").order_by("number")]
    return drive_own(
        owner=own.owner, model=evaluation.model, track=evaluation.track, rivals=rivals, now=now, **options_of(own)
    )


def options_of(own: OwnEvaluation) -> dict[str, Any]:
    """The options that a run was asked for with, as :func:`drive_own` takes them."""
    told = own.rules.to_dict()
    options = {name: value for name, value in told.items() if name in OWN_RULES} | own.ranked
    return options | {"boxes": [dict(box) for box in told["boxes"]]}


@transaction.atomic
def delete_own(*, own: OwnEvaluation, now: datetime) -> None:
    """Delete a run of one's own that is over, with its result, videos and files. What was sent to a race stays.

    Raises UserFault("own_under_way") for one that waits or drives.
    """
    assert own.evaluation is not None, "what was deleted is not found"
    evaluation = Evaluation.objects.select_for_update().filter(pk=own.evaluation.pk).first()
    if evaluation is None:  # by another tab
        return
    if not evaluation.is_final:
        raise UserFault("own_under_way")
    OwnEvaluation.objects.filter(pk=own.pk).update(evaluation=None, deleted_at=now)
    if evaluation.is_platform_fault:  # it never counted
        OwnEvaluation.objects.filter(pk=own.pk).delete()
    delete_evaluation(evaluation=evaluation)


@transaction.atomic
def record_ended_own(*, evaluation: Evaluation, result: Result | None, now: datetime) -> None:
    """Send the car of a run that has just finished to its race, if that was wished for and the run is better than what
    the racer has there; else note why not. In the transaction that ends the run: once, whatever is killed and when."""
    if result is None:
        return
    wished = OwnEvaluation.objects.filter(evaluation=evaluation, submit_if_better=True, submission=None)
    wished = wished.exclude(race=None)
    if not wished.exists():  # as good as every run: to put the whole query together is a sixth of what a result costs
        return
    own = wished.select_related("race__track", "owner", "evaluation__model").get()
    assert own.race is not None, "those without one were left out"
    row = OwnEvaluation.objects.filter(pk=own.pk)
    try:
        with transaction.atomic():
            try:
                if fault := fault_of_better(own, result):
                    raise fault
                submission = submit_model(race=own.race, racer=own.owner, model=evaluation.model, now=now)
            except UserFault as fault:  # within the savepoint: what the race notes of a refusal stays
                row.update(submit_reason_code=fault.code, submit_reason_params=fault.params)
            else:
                row.update(submission=submission)
    except Exception:  # the run stands all the same: its racer reads that we failed, and can send the car by hand
        logger.exception("The car of run %s cannot be submitted.", evaluation.public_id)
        row.update(submit_reason_code="own_submit_failed", submit_reason_params={})


def _check_race(owner: Racer, model: TrainedModel, race: Race, now: datetime) -> None:
    """Whether the race would take the car today; whatever else may have changed when it is sent is said then."""
    require_open(race, now)
    if model.owner_id != owner.pk:
        raise UserFault("model_not_yours")
    missing = not_offered(model.sensors, race.sensors)
    if missing:
        raise UserFault("sensors_not_offered", needed=", ".join(missing), offered=", ".join(race.sensors))
    check_eligible(race, owner, now)
    check_terms(race, owner)


def _refuse_full_quota(owner: Racer, now: datetime) -> None:
    limit = limit_of(owner, OWN_RUNS_AT_ONCE.name)
    if used_by(owner, OWN_RUNS_AT_ONCE.name, now) >= limit:
        raise UserFault("own_runs_at_once", limit=limit)
    limit = limit_of(owner, OWN_RUNS_A_DAY.name)
    if used_by(owner, OWN_RUNS_A_DAY.name, now) >= limit:
        raise UserFault("own_runs_a_day", limit=limit)
    limit_mb = limit_of(owner, STORAGE.name)
    if used_by(owner, STORAGE.name, now) >= limit_mb:
        raise UserFault("storage_full", limit_mb=limit_mb)


def _forget_deleted(owner: Racer, now: datetime) -> None:
    OwnEvaluation.objects.filter(owner=owner, deleted_at__isnull=False, asked_at__lte=now - KEPT_DELETED).delete()
