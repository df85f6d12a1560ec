"""Sending a car to a race."""

from datetime import datetime

from django.db import transaction
from django.db.models import F
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from evaluation.models import State, TrainedModel
from evaluation.running.queue.services import queue_evaluation
from evaluation.selectors import can_use_model
from paddock.errors import UserFault

from ...models import Draw, Entry, Race, Submission
from ...models.sensors import require_offered
from ...rules.layout import race_rules
from ..eligibility import check_eligible
from ..engines import is_over, keeps_engine, site_engine
from ..terms import accept_terms
from ..time_checks import require_open
from .cars import note_refused, take_place
from .entries import enter_race
from .locks import lock_entry, use_up_one

HOUSE_PRIORITY = -10  # nobody waits for a house car
ACTIVE = (State.QUEUED, State.RUNNING)


def submit_model(
    *, race: Race, racer: Racer, model: TrainedModel, now: datetime, terms: int | None = None
) -> Submission:
    """Queue a run of the model for a race, entering the racer if necessary.

    It counts when it was sent before the race closed, however long it waits. ``terms``: the version of the race's terms
    that the racer accepts. Raises UserFault("race_not_open_yet" | "race_closed" | "race_cancelled" |
    "entry_withdrawn" | "model_not_yours" | "sensors_not_offered" | "car_already_submitted" | "car_of_another" |
    "submission_running" | "submissions_used_up" | "race_is_physical"), and as
    :func:`~races.entries.services.entries.enter_race` does.
    """
    try:
        return _submit(race, racer, model, now, terms)
    except UserFault as fault:
        if fault.code == "car_of_another":
            note_refused(race=race, racer=racer, network=model.network, now=now)
        raise


@transaction.atomic
def _submit(race: Race, racer: Racer, model: TrainedModel, now: datetime, terms: int | None) -> Submission:
    entry = Entry.objects.filter(race=race, racer=racer).first()
    _require_takes_cars(race, entry, now)
    if not can_use_model(racer, model):
        raise UserFault("model_not_yours")
    entry = entry or enter_race(race=race, racer=racer, now=now, terms=terms)
    check_eligible(race, racer, now)
    entry = lock_entry(entry.pk)
    race = entry.race
    # under the locks: two tabs are one after the other here, and an organiser cannot change the rules in between
    _require_takes_cars(race, entry, now)
    accept_terms(entry, race, accepted=terms, now=now)
    require_offered(model.sensors, race.sensors)
    _refuse_same_car(entry, model)
    take_place(entry=entry, race=race, network=model.network)
    _refuse_second_car(entry)
    use_up_one(entry, "submissions_used_up")
    return _queue(entry, race, model, submitted_at=now, now=now)


@audited("run.repeated", _("Run repeated"), target="submission")
@transaction.atomic
def repeat_submission(*, submission: Submission, now: datetime) -> Submission:
    """Repeat a failed or stopped run, for an admin: also after the race has closed.

    The new submission keeps the time of the old one, which becomes void, so ties stay as they were. Raises
    UserFault("submission_not_failed" | "model_not_yours" | "car_already_submitted" | "submission_running" |
    "car_of_another"), "duels_drawn" when the result could not change anything any more, and "race_engine_gone" when the
    race is over and was driven with another engine than the site's.
    """
    entry = lock_entry(submission.entry_id)
    race = entry.race
    if Draw.objects.filter(race=race).exists():
        raise UserFault("duels_drawn")
    if is_over(race, now) and not keeps_engine(race):
        raise UserFault("race_engine_gone", engine=race.engine, site=site_engine())
    old = Submission.objects.select_related("evaluation__model").get(pk=submission.pk)
    if old.is_live or old.evaluation.state not in (State.FAILED, State.STOPPED):
        raise UserFault("submission_not_failed")
    Submission.objects.filter(pk=old.pk).update(is_void=True, refunded=True)
    if old.refunded:
        Entry.objects.filter(pk=entry.pk).update(submission_count=F("submission_count") + 1)
    Entry.objects.filter(pk=entry.pk).update(last_number=F("last_number") + 1)
    _refuse_same_car(entry, old.evaluation.model)
    take_place(entry=entry, race=race, network=old.evaluation.model.network)
    _refuse_second_car(entry)
    return _queue(entry, race, old.evaluation.model, submitted_at=old.submitted_at, now=now)


def _require_takes_cars(race: Race, entry: Entry | None, now: datetime) -> None:
    require_open(race, now)
    if race.physical:
        raise UserFault("race_is_physical")
    if entry is not None and entry.is_withdrawn:
        raise UserFault("entry_removed" if entry.removed_at else "entry_withdrawn")


def _refuse_same_car(entry: Entry, model: TrainedModel) -> None:
    same = Submission.objects.filter(entry=entry, network_id=model.network_id, is_void=False)
    earlier = same.values_list("evaluation__public_id", flat=True).first()
    if earlier is not None:
        raise UserFault("car_already_submitted", evaluation=earlier)


def _refuse_second_car(entry: Entry) -> None:
    unfinished = Submission.objects.filter(entry=entry, evaluation__state__in=ACTIVE)
    active = unfinished.values_list("evaluation__public_id", flat=True).first()
    if active is not None:
        raise UserFault("submission_running", evaluation=active)


def _queue(entry: Entry, race: Race, model: TrainedModel, *, submitted_at: datetime, now: datetime) -> Submission:
    entry.refresh_from_db(fields=["submission_count", "last_number"])
    racer = model.owner
    evaluation = queue_evaluation(
        owner=racer,
        model=model,
        track=race.track,
        rules=race_rules(race),
        priority=HOUSE_PRIORITY if racer.is_house else 0,
        closes_at=None if racer.is_house else race.closes_at,
        now=now,
    )
    return Submission.objects.create(
        entry=entry,
        number=entry.last_number,
        evaluation=evaluation,
        network_id=model.network_id,
        submitted_at=submitted_at,
    )
