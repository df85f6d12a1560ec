"""What a student has to do: each assignment with its deadline, what passes, and the attempts that are left."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal

from django.db.models import Count, Exists, OuterRef, Q, QuerySet, Sum

from accounts.models import GroupMember, Racer
from core.streams.shared_pieces import shared_value

from ..assignments.selectors import assignments_visible_to
from ..grading.members import taught_by
from ..grading.services import times_with
from ..marking.lateness import local_day
from ..models import Assignment, Attempt, Extension, Mark, SubmissionGroupMember

UPCOMING, OPEN, LATE, CLOSED = "upcoming", "open", "late", "closed"


@dataclass(frozen=True)
class Task:
    """An assignment as its student has it. ``due_at`` and ``last_at``: with an extension; ``left``, ``left_today``:
    attempts, None without a limit."""

    assignment: Assignment
    due_at: datetime
    last_at: datetime | None
    state: str
    mark: Mark | None
    full: Decimal
    parts: int
    used: int
    left: int | None
    left_today: int | None
    is_extended: bool

    @property
    def passed(self) -> int:
        """How many parts pass already."""
        return sum(bool(part["passed"]) for part in self.mark.parts) if self.mark else 0

    @property
    def takes_attempts(self) -> bool:
        return self.state in (OPEN, LATE) and self.left != 0 and self.left_today != 0


def state_of(opens_at: datetime, due_at: datetime, last_at: datetime | None, now: datetime) -> str:
    """Where an assignment stands for a student with these times."""
    if now < opens_at:
        return UPCOMING
    if now <= due_at:
        return OPEN
    return LATE if last_at is not None and now <= last_at else CLOSED


def tasks_of(racer: Racer, assignments: QuerySet[Assignment], now: datetime) -> list[Task]:
    """These assignments for a student, what is due next first and what is over last. Four queries."""
    found = list(
        assignments.select_related("group__classroom")
        .annotate(full=Sum("parts__points", default=Decimal(0)), parts_count=Count("parts"))
        .order_by("due_at", "pk")
    )
    if not found:
        return []
    groups = SubmissionGroupMember.objects.filter(racer=racer)
    mine = Q(racer=racer, submission_group=None) | Q(submission_group__in=groups.values("group"))
    attempts: dict[int, list[datetime]] = {}
    kept = Attempt.objects.filter(mine, assignment__in=found, refunded_at=None, is_reference=False)
    for assignment, accepted_at in kept.values_list("assignment", "accepted_at"):
        attempts.setdefault(assignment, []).append(accepted_at)
    marks = {mark.assignment_id: mark for mark in Mark.objects.filter(assignment__in=found, racer=racer)}
    extended = extensions_of(racer)
    tasks = [
        task_of(one, attempts.get(one.pk, ()), marks.get(one.pk), extended.get(one.pk), now, one.full, one.parts_count)
        for one in found
    ]
    over = {CLOSED: 3, UPCOMING: 2, LATE: 1}
    tasks.sort(
        key=lambda task: (over.get(task.state, 0), task.due_at.timestamp() * (-1 if task.state == CLOSED else 1))
    )
    return tasks


def extensions_of(racer: Racer) -> dict[int, Extension]:
    """The extensions that count for a student by assignment: their own, or the latest of their submission group."""
    mine = SubmissionGroupMember.objects.filter(racer=racer)
    fellows = SubmissionGroupMember.objects.filter(
        group__in=mine.values("group"), assignment=OuterRef("assignment"), racer=OuterRef("racer")
    )
    granted = Extension.objects.filter(Q(racer=racer) | Exists(fellows))
    latest: dict[int, Extension] = {}
    for one in sorted(granted, key=lambda each: (each.due_at, each.last_at or each.due_at)):
        latest[one.assignment_id] = one
    return latest


def task_of(
    assignment: Assignment,
    accepted: Iterable[datetime],
    mark: Mark | None,
    extension: Extension | None,
    now: datetime,
    full: Decimal,
    parts: int,
) -> Task:
    """``accepted``: when the attempts that were not given back were accepted."""
    due_at, last_at = times_with(assignment, extension)
    accepted = list(accepted)
    begin, end = local_day(now, assignment.time_zone)
    today = sum(begin <= moment < end for moment in accepted)
    in_all, a_day = assignment.attempts_in_all, assignment.attempts_a_day
    return Task(
        assignment,
        due_at,
        last_at,
        state_of(assignment.opens_at, due_at, last_at, now),
        mark,
        full,
        parts,
        len(accepted),
        None if in_all is None else max(0, in_all - len(accepted)),
        None if a_day is None else max(0, a_day - today),
        extension is not None,
    )


def handed_in_by(racer: Racer) -> QuerySet[Assignment]:
    """The published assignments of the groups in which the racer is a student."""
    return assignments_visible_to(racer).exclude(taught_by(racer, "group")).filter(published_at__isnull=False)


def due_next(racer: Racer, now: datetime) -> list[Task]:
    """What a student can hand in now, the next deadline first; no query for racers without an open assignment."""

    def read() -> frozenset[int]:
        members = GroupMember.objects.filter(confirmed_at__isnull=False, group__assignments__in=_open(now))
        return frozenset(members.order_by().values_list("racer", flat=True))

    if racer.pk not in shared_value("students with open assignments", read):
        return []
    mine = handed_in_by(racer).filter(pk__in=_open(now).values("pk"))
    tasks = tasks_of(racer, mine, now)
    late = [task for task in tasks if task.state == LATE and task.passed < task.parts]
    return [task for task in tasks if task.state == OPEN] + late


def _open(now: datetime) -> QuerySet[Assignment]:
    later = Q(due_at__gte=now) | Q(last_at__gte=now) | Q(extensions__due_at__gte=now) | Q(extensions__last_at__gte=now)
    current = Assignment.objects.filter(later, published_at__isnull=False, opens_at__lte=now)
    return Assignment.objects.filter(pk__in=current.values("pk"))
