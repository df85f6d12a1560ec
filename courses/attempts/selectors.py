"""Attempts that a racer sees, and whether more are accepted. Each predicate has its queryset twin."""

from __future__ import annotations

from datetime import datetime

from django.db.models import Exists, OuterRef, Prefetch, Q, QuerySet

from accounts.models import GroupMember, Racer, Viewer
from core.times import stored
from evaluation.models import Evaluation
from paddock.errors import UserFault

from ..grading.members import Unit, can_teach_group, is_student, taught_by
from ..grading.services import deadline_of
from ..marking.lateness import local_day
from ..models import Assignment, Attempt, AttemptRun, SubmissionGroupMember


def refusal_of(assignment: Assignment, unit: Unit, now: datetime) -> UserFault | None:
    """Why nothing is accepted now of a student or a submission group; None if something is."""
    due_at, last_at = deadline_of(assignment, unit)
    if now < assignment.opens_at:
        return UserFault("attempt_not_open_yet", opens=stored(assignment.opens_at))
    if now > (last_at or due_at):
        return UserFault("attempt_too_late")
    counted = unit.attempts(assignment).filter(refunded_at=None)
    day, next_day = local_day(now, assignment.time_zone)
    of_day = counted.filter(accepted_at__gte=day, accepted_at__lt=next_day)
    for code, limit, attempts in (
        ("attempts_used_up", assignment.attempts_in_all, counted),
        ("attempts_of_day_used_up", assignment.attempts_a_day, of_day),
    ):
        if limit is not None and attempts.count() >= limit:
            return UserFault(code, limit=limit)
    return None


def can_see_attempt(viewer: Viewer, attempt: Attempt) -> bool:
    """Teachers of the group, and its students their own and their submission group's. Twin of
    :func:`attempts_visible_to`."""
    if not isinstance(viewer, Racer):
        return False
    assignment = attempt.assignment
    if can_teach_group(viewer, assignment.group):
        return True
    if attempt.is_reference or assignment.published_at is None or not is_student(viewer, assignment.group_id):
        return False
    if attempt.submission_group_id is None:
        return attempt.racer_id == viewer.pk
    return SubmissionGroupMember.objects.filter(group=attempt.submission_group_id, racer=viewer.pk).exists()


def attempts_visible_to(viewer: Viewer) -> QuerySet[Attempt]:
    """Twin of :func:`can_see_attempt`."""
    found = Attempt.objects.select_related("assignment__group", "racer", "submission_group")
    return found.filter(seen_by(viewer, "")) if isinstance(viewer, Racer) else found.none()


def seen_by(viewer: Racer, way: str) -> Q:
    """Rows whose attempt, which ``way`` leads to, the racer sees."""
    groups = GroupMember.objects.filter(racer=viewer.pk, confirmed_at__isnull=False).values("group")
    together = SubmissionGroupMember.objects.filter(racer=viewer.pk).values("group")
    own = Q(**{f"{way}racer": viewer.pk, f"{way}submission_group": None})
    mine = Q(
        **{
            f"{way}is_reference": False,
            f"{way}assignment__published_at__isnull": False,
            f"{way}assignment__group__in": groups,
        }
    )
    return mine & (own | Q(**{f"{way}submission_group__in": together})) | taught_by(viewer, f"{way}assignment__group")


def with_runs(attempts: QuerySet[Attempt]) -> QuerySet[Attempt]:
    """With their runs, evaluations and tracks, in four queries."""
    runs = AttemptRun.objects.select_related("evaluation", "part_track__track", "part_track__part")
    related = ("racer", "submission_group", "model", "refunded_by")
    return attempts.select_related(*related).prefetch_related(Prefetch("runs", runs))


# The audience of runs of attempts besides their owners, registered with races.entries.selectors.visibility:


def sees_run(viewer: Racer, evaluation: Evaluation) -> bool:
    """Whether the run belongs to an attempt that the racer sees. Twin of :func:`runs_seen`."""
    run = AttemptRun.objects.filter(evaluation=evaluation).select_related("attempt__assignment__group").first()
    return run is not None and can_see_attempt(viewer, run.attempt)


def runs_seen(viewer: Racer) -> Q:
    """Twin of :func:`sees_run`."""
    runs = AttemptRun.objects.filter(evaluation=OuterRef("pk"))
    return Q(Exists(runs.filter(seen_by(viewer, "attempt__"))))
