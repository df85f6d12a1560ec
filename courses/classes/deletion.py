"""Deletes a class with its accounts, cars, runs, trainings, races, assignments and files, or a group's assignments.

Learners race in races of their class alone and share no models, so that nothing of anybody else hangs on theirs.
"""

from django.db import transaction
from django.db.models import Q
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from accounts.class_accounts.services import can_lead_class, can_teach
from accounts.leaving.services import delete_account
from accounts.models import Classroom, Racer, RacerGroup
from core.audit.recording import audited
from evaluation.models import Evaluation, TrainedModel
from evaluation.running.results import files_of_runs
from paddock.errors import UserFault
from races.entries.services.standings import recompute_race
from races.models import Duel, DuelCompetitor, LiveSlot, OwnEvaluation, Race, Redrive, Submission
from training.jobs.services.deletion import delete_stored
from training.models import TrainingJob
from training.quotas import files_of

from ..assignments.services import delete_assignments
from ..grading.members import require_teacher
from ..models import Assignment, Attempt, Mark


@audited("class.deleted", _("Class deleted"), target="classroom")
@transaction.atomic
def delete_class(*, classroom: Classroom, by: Racer, marks_exported: bool = False) -> int:
    """Delete a class with all content of its learners and its assignments; the number of accounts. The next purge
    deletes unused networks. ``marks_exported``: whether the present marks were exported.

    Raises UserFault("class_not_yours" | "marks_not_exported").
    """
    if not can_lead_class(by, classroom):
        raise UserFault("class_not_yours")
    _delete_assignments(classroom.group, marks_exported)
    learners = list(classroom.learners.values_list("racer", flat=True))
    races = list(Race.objects.filter(group=classroom.group_id).values_list("pk", flat=True))
    _delete_left(learners, races)
    group = classroom.group
    Racer.objects.filter(pk__in=learners).delete()
    classroom.delete()
    group.delete()
    return len(learners)


@audited("class.learner_removed", _("Learner removed from a class"), target="classroom")
@transaction.atomic
def remove_learner(*, classroom: Classroom, by: Racer, racer: Racer) -> None:
    """Delete a learner's account with all its content, and rank the boards of the class anew. Where drawn duels or
    attempts of a submission group, and so the results of others, need their car, results stay without the name. Raises
    UserFault("class_not_yours")."""
    if not can_teach(by, classroom) or not classroom.learners.filter(racer=racer).exists():
        raise UserFault("class_not_yours")
    together = Attempt.objects.filter(racer=racer, submission_group__isnull=False)
    if DuelCompetitor.objects.filter(entry__racer=racer).exists() or together.exists():
        delete_account(racer=racer, by=by, now=timezone.now())
        return
    raced = list(Race.objects.filter(entries__racer=racer))
    _delete_left([racer.pk], [])
    LiveSlot.objects.filter(racer__entry__racer=racer).delete()
    Racer.objects.filter(pk=racer.pk).delete()
    for race in raced:
        recompute_race(race=race)


@audited("group.assignments_deleted", _("All assignments of a group deleted"), target="group")
@transaction.atomic
def delete_group_assignments(*, group: RacerGroup, by: Racer, marks_exported: bool = False) -> int:
    """Delete all assignments of a group with attempts, their runs, marks and exceptions; the number. Members keep their
    accounts and cars. Raises UserFault("assignment_not_yours" | "marks_not_exported")."""
    require_teacher(group, by)
    return _delete_assignments(group, marks_exported)


def has_marks(group: RacerGroup) -> bool:
    """Whether marks would be lost with the assignments of a group."""
    return Mark.objects.filter(assignment__group=group, attempt__isnull=False).exists()


def _delete_assignments(group: RacerGroup, marks_exported: bool) -> int:
    if has_marks(group) and not marks_exported:
        raise UserFault("marks_not_exported")
    found = list(Assignment.objects.filter(group=group).values_list("pk", flat=True))
    delete_assignments(found)
    return len(found)


def _delete_left(learners: list[int], races: list[int]) -> None:
    Attempt.objects.filter(racer__in=learners).delete()
    duels = Duel.objects.filter(race__in=races)
    submissions = Submission.objects.filter(Q(entry__race__in=races) | Q(entry__racer__in=learners))
    runs = set(duels.exclude(evaluation=None).values_list("evaluation", flat=True))
    runs |= set(submissions.filter(entry__racer__in=learners).values_list("evaluation", flat=True))
    runs |= set(Evaluation.with_sealed.filter(owner__in=learners).values_list("pk", flat=True))
    files = files_of_runs(runs)
    for job in TrainingJob.objects.filter(owner__in=learners):
        files += files_of(job)
    Redrive.objects.filter(Q(submission__in=submissions) | Q(evaluation__in=runs) | Q(replaced__in=runs)).delete()
    shown = Q(evaluation__in=runs) | Q(speed_run__in=runs) | Q(submission__entry__race__in=races)
    LiveSlot.objects.filter(shown).delete()
    duels.delete()
    TrainingJob.objects.filter(owner__in=learners).delete()
    OwnEvaluation.objects.filter(owner__in=learners).delete()
    submissions.delete()
    Evaluation.with_sealed.filter(pk__in=runs).delete()
    Race.objects.filter(pk__in=races).delete()
    TrainedModel.objects.filter(owner__in=learners).delete()
    transaction.on_commit(lambda: delete_stored(files), robust=True)
