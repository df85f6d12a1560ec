"""Attempts that a racer sees, and how many are left. Each predicate has its queryset twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from django.db.models import Exists, OuterRef, Prefetch, Q, QuerySet

from accounts.models import GroupMember, Racer, Viewer
from evaluation.models import Evaluation

from ..grading.members import Unit, can_teach_group, is_student, taught_by, unit_of
from ..grading.services import deadline_of
from ..marking.lateness import local_day
from ..models import Assignment, Attempt, AttemptRun, SubmissionGroupMember


@dataclass(frozen=True)
class Left:
    """What a student may still hand in. ``in_all``, ``today``: attempts left, None without a limit; ``due_at``,
    ``last_at``: their own deadline; ``refusal``: the reason code of why nothing is accepted now, or ``""``."""

    used: int
    in_all: int | None
    today: int | None
    due_at: datetime
    last_at: datetime | None
    refusal: str = ""

    @property
    def attempts(self) -> int | None:
        """The lower of both limits; None without any."""
        return min((one for one in (self.in_all, self.today) if one is not None), default=None)


def left_of(assignment: Assignment, racer: Racer, now: datetime) -> Left:
    """What the student, or their submission group, may still hand in."""
    return left_of_unit(assignment, unit_of(assignment, racer), now)


def left_of_unit(assignment: Assignment, unit: Unit, now: datetime) -> Left:
    due_at, last_at = deadline_of(assignment, unit)
    counted = unit.attempts(assignment).filter(refunded_at=None)
    day, next_day = local_day(now, assignment.time_zone)
    used = counted.count()
    in_all = today = None
    if assignment.attempts_in_all is not None:
        in_all = max(0, assignment.attempts_in_all - used)
    if assignment.attempts_a_day is not None:
        of_day = counted.filter(accepted_at__gte=day, accepted_at__lt=next_day).count()
        today = max(0, assignment.attempts_a_day - of_day)
    refusal = ""
    if now < assignment.opens_at:
        refusal = "attempt_not_open_yet"
    elif now > (last_at or due_at):
        refusal = "attempt_too_late"
    elif in_all == 0:
        refusal = "attempts_used_up"
    elif today == 0:
        refusal = "attempts_of_day_used_up"
    return Left(used, in_all, today, due_at, last_at, refusal)


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


def attempts_of(assignment: Assignment, racer: Racer) -> QuerySet[Attempt]:
    """The attempts of a student or their submission group, the newest first, with their runs."""
    return with_runs(unit_of(assignment, racer).attempts(assignment))


def with_runs(attempts: QuerySet[Attempt]) -> QuerySet[Attempt]:
    """With their runs, evaluations and tracks, in four queries."""
    runs = AttemptRun.objects.select_related("evaluation", "part_track__track", "part_track__part")
    related = ("racer", "submission_group", "model", "refunded_by")
    return attempts.select_related(*related).prefetch_related(Prefetch("runs", runs))


def latest_of(attempts: Sequence[Attempt]) -> Attempt | None:
    """The attempt that was accepted last and not given back."""
    return max(
        (one for one in attempts if one.refunded_at is None), key=lambda one: (one.accepted_at, one.pk), default=None
    )


# The audience of runs of attempts besides their owners, registered with races.entries.selectors.visibility:


def sees_run(viewer: Racer, evaluation: Evaluation) -> bool:
    """Whether the run belongs to an attempt that the racer sees. Twin of :func:`runs_seen`."""
    run = AttemptRun.objects.filter(evaluation=evaluation).select_related("attempt__assignment__group").first()
    return run is not None and can_see_attempt(viewer, run.attempt)


def runs_seen(viewer: Racer) -> Q:
    """Twin of :func:`sees_run`."""
    runs = AttemptRun.objects.filter(evaluation=OuterRef("pk"))
    return Q(Exists(runs.filter(seen_by(viewer, "attempt__"))))
