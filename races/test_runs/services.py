"""A racer's own runs: start, repeat and delete them, and process their ends."""

import logging
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from django.db import transaction

from accounts.models import Racer
from accounts.quotas import limit_of, used_by
from core.database.locks import hold
from evaluation.garage.quotas import STORAGE
from evaluation.models import Evaluation, Result, TrainedModel
from evaluation.running.queue.order import OWN
from evaluation.running.queue.services import queue_evaluation
from evaluation.running.race_setup import check_rivals
from evaluation.running.results import delete_evaluation
from evaluation.selectors import can_see_model
from paddock.errors import UserFault
from paddock.rules.race import OWN_RULES
from tracks.models import Track

from ..entries.eligibility import check_eligible
from ..entries.selectors.visibility import can_see_race
from ..entries.services.submissions import submit_model
from ..entries.terms import check_terms
from ..entries.time_checks import require_open
from ..models import OwnEvaluation, Race
from ..models.sensors import require_offered
from ..quotas import OWN_RUNS_A_DAY, OWN_RUNS_AT_ONCE
from .rules import own_rules, rules_as_in
from .selectors import fault_of_better

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
    """Queue a run of the racer's own, behind the runs of races.

    Either on a ``track`` with ``options``, any of :data:`paddock.rules.race.OWN_RULES`, against ``rivals`` or without;
    or as in a ``race``, whose track and rules it takes. ``submit_if_better``: the car is sent to that race if the run
    beats the racer's result there.

    Raises UserFault ``own_model_gone``, ``own_rival_gone``, ``own_race_gone`` for what the racer may not use or see
    (any more), ``own_as_in_race`` for options beside a race, ``own_without_race`` for a submission without one,
    ``own_runs_at_once``, ``own_runs_a_day``, ``storage_full``; what :func:`races.test_runs.rules.own_rules` and
    :func:`races.test_runs.rules.rules_as_in` raise; with ``submit_if_better`` the race's faults for the car today.
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
        track, rules = race.track, rules_as_in(race)
        if submit_if_better:
            _check_race(owner, model, race, now)
    else:
        if submit_if_better:
            raise UserFault("own_without_race")
        if track is None:
            raise UserFault("own_needs_track")
        rules = own_rules(track, options, rivals=len(rivals))
        check_rivals(rules.rules, len(rivals))
    hold(owner)
    _refuse_full_quota(owner, now)
    OwnEvaluation.objects.filter(owner=owner, deleted_at__isnull=False, asked_at__lte=now - KEPT_DELETED).delete()
    evaluation = queue_evaluation(
        owner=owner, model=model, track=track, rules=rules.rules, rivals=rivals, priority=OWN, checked=True, now=now
    )
    return OwnEvaluation.objects.create(
        owner=owner,
        evaluation=evaluation,
        race=race,
        submit_if_better=submit_if_better,
        asked_at=now,
        **rules.ranked,
    )


def drive_own_again(*, own: OwnEvaluation, now: datetime) -> OwnEvaluation:
    """Queue a run like this one: of the same cars by the same rules, or by the current rules of its race. Raises
    UserFault as :func:`drive_own`."""
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
    """The options of a run's request, as :func:`drive_own` takes them."""
    values = own.rules.to_dict()
    options = {name: value for name, value in values.items() if name in OWN_RULES} | own.ranked
    return options | {"boxes": [dict(box) for box in values["boxes"]]}


@transaction.atomic
def delete_own(*, own: OwnEvaluation, now: datetime) -> None:
    """Delete a finished run of one's own with its result, videos and files. Submissions to races stay. Raises
    UserFault("own_under_way") for one that waits or drives."""
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
    """Send the car of a run that has just finished to its race, if requested and better than the racer's result there;
    else record the reason. In the transaction that ends the run: exactly once, also after a kill."""
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
            except UserFault as fault:  # within the savepoint: the race's record of a refusal stays
                row.update(submit_reason_code=fault.code, submit_reason_params=fault.params)
            else:
                row.update(submission=submission)
    except Exception:  # the run stands all the same: its racer reads that we failed, and can send the car by hand
        logger.exception("The car of run %s cannot be submitted.", evaluation.public_id)
        row.update(submit_reason_code="own_submit_failed", submit_reason_params={})


def _check_race(owner: Racer, model: TrainedModel, race: Race, now: datetime) -> None:
    """Raise the fault of a race that would refuse the car today; the submission itself checks again."""
    require_open(race, now)
    if model.owner_id != owner.pk:
        raise UserFault("model_not_yours")
    require_offered(model.sensors, race.sensors)
    check_eligible(race, owner, now)
    check_terms(race, owner)


def _refuse_full_quota(owner: Racer, now: datetime) -> None:
    refusals = {OWN_RUNS_AT_ONCE: "own_runs_at_once", OWN_RUNS_A_DAY: "own_runs_a_day", STORAGE: "storage_full"}
    for quota, code in refusals.items():
        limit = limit_of(owner, quota.name)
        if used_by(owner, quota.name, now) >= limit:
            raise UserFault(code, **{"limit_mb" if quota is STORAGE else "limit": limit})
