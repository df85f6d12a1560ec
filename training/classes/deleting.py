"""Deleting a class in one act: accounts, cars, runs, trainings, races, files.

Learners race in races of their class alone and share no models, so that nothing of anybody else hangs on theirs.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from functools import partial

from django.core.files.storage import default_storage
from django.db import transaction
from django.db.models import Q

from accounts.classes import can_lead_class, can_teach
from accounts.models import Classroom, Racer
from core.storage_faults import storage_at_work
from evaluation.models import Evaluation, Result, RivalResult, TrainedModel
from paddock.errors import PlatformFault, UserFault
from races.models import Duel, DuelCompetitor, LiveSlot, OwnEvaluation, Race, Redrive, Submission
from races.services import recompute_race

from ..models import TrainingJob
from ..quotas import files_of

logger = logging.getLogger(__name__)


@transaction.atomic
def delete_class(*, classroom: Classroom, by: Racer) -> int:
    """Delete a class with all that its learners have left. How many accounts. Networks that nobody has any more go with
    the next purge, within a day. Whatever drives or trains at that moment ends without a result.

    Raises UserFault("class_not_yours").
    """
    if not can_lead_class(by, classroom):
        raise UserFault("class_not_yours")
    learners = list(classroom.learners.values_list("racer", flat=True))
    races = list(Race.objects.filter(group=classroom.group_id).values_list("pk", flat=True))
    _delete_left(learners, races)
    group = classroom.group
    Racer.objects.filter(pk__in=learners).delete()
    classroom.delete()
    group.delete()
    return len(learners)


@transaction.atomic
def remove_learner(*, classroom: Classroom, by: Racer, racer: Racer) -> None:
    """Take a learner out of a class: the account goes with all that it has left, and boards of the class close up.

    Raises UserFault("class_not_yours"), and "class_learner_in_duels" where a drawn duel holds their car: the results of
    others hang on it.
    """
    if not can_teach(by, classroom) or not classroom.learners.filter(racer=racer).exists():
        raise UserFault("class_not_yours")
    drawn = DuelCompetitor.objects.filter(entry__racer=racer).select_related("entry__race").first()
    if drawn is not None:
        raise UserFault("class_learner_in_duels", racer=racer.alias, race=drawn.entry.race.name)
    raced = list(Race.objects.filter(entries__racer=racer))
    _delete_left([racer.pk], [])
    LiveSlot.objects.filter(racer__entry__racer=racer).delete()
    Racer.objects.filter(pk=racer.pk).delete()
    for race in raced:
        recompute_race(race=race)


def _delete_left(learners: list[int], races: list[int]) -> None:
    """What these racers have left, and these races; the files after the commit."""
    duels = Duel.objects.filter(race__in=races)
    submissions = Submission.objects.filter(Q(entry__race__in=races) | Q(entry__racer__in=learners))
    runs = set(duels.exclude(evaluation=None).values_list("evaluation", flat=True))
    runs |= set(submissions.filter(entry__racer__in=learners).values_list("evaluation", flat=True))
    runs |= set(Evaluation.with_sealed.filter(owner__in=learners).values_list("pk", flat=True))
    files = _files(runs)
    for job in TrainingJob.objects.filter(owner__in=learners):
        files += files_of(job)
    Redrive.objects.filter(Q(submission__in=submissions) | Q(evaluation__in=runs) | Q(replaced__in=runs)).delete()
    _delete_live(races, runs)
    duels.delete()
    TrainingJob.objects.filter(owner__in=learners).delete()
    OwnEvaluation.objects.filter(owner__in=learners).delete()
    submissions.delete()
    Evaluation.with_sealed.filter(pk__in=runs).delete()
    Race.objects.filter(pk__in=races).delete()
    TrainedModel.objects.filter(owner__in=learners).delete()
    transaction.on_commit(partial(_delete_files, files))


def _delete_live(races: Iterable[int], runs: Iterable[int]) -> None:
    shown = Q(evaluation__in=runs) | Q(speed_run__in=runs) | Q(submission__entry__race__in=races)
    LiveSlot.objects.filter(shown).delete()


def _files(runs: Iterable[int]) -> list[str]:
    runs = list(runs)
    names = [*Result.with_sealed.filter(evaluation__in=runs).values_list("trace", flat=True)]
    names += Result.with_sealed.filter(evaluation__in=runs).values_list("bots", flat=True)
    names += RivalResult.objects.filter(result__evaluation__in=runs).values_list("trace", flat=True)
    return [name for name in names if name]


def _delete_files(names: Iterable[str]) -> None:
    for name in names:
        try:
            with storage_at_work():
                default_storage.delete(name)
        except PlatformFault as fault:
            logger.warning("A file of a deleted class stays: %s: %s", name, fault)
