"""The table of marks for the teacher."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

from django.db.models import Count, Q

from accounts.models import RacerGroup

from ..assignments.students import Student, students_named
from ..models import Assignment, Attempt, Mark, SubmissionGroupMember

NOT_TRIED, WAITING, PASSED, NOT_PASSED = "none", "waiting", "passed", "not_passed"
# what the table can be sorted by, and whether the highest comes first
SORTS = {"name": False, "points": True, "late": True, "attempts": True, "state": False}


@dataclass(frozen=True)
class MarkRow:
    """A student of an assignment; ``cells``: the points of each part, None before it is marked."""

    student: Student
    mark: Mark | None
    cells: list[tuple[Decimal | None, bool]]
    attempts: int
    group: str

    @property
    def points(self) -> Decimal | None:
        """None without an attempt while one may come."""
        return self.mark.points if self.mark else None

    @property
    def state(self) -> str:
        if self.mark is None or self.mark.attempt_id is None:
            return NOT_TRIED
        if not self.mark.is_complete:
            return WAITING
        return PASSED if all(part["passed"] for part in self.mark.parts) else NOT_PASSED


def mark_table(assignment: Assignment, sort: str = "name", *, backwards: bool = False) -> list[MarkRow]:
    """All students, and former members with an attempt."""
    known = Mark.objects.filter(assignment=assignment).select_related("attempt")
    if assignment.final_at is None:
        known = known.exclude(attempt=None)  # of a regrade, or after one was given back: an attempt may come
    marks = {one.racer_id: one for one in known}
    kept = Q(refunded_at=None, is_reference=False)
    members = SubmissionGroupMember.objects.filter(assignment=assignment).select_related("group")
    group_of = {one.racer_id: one.group for one in members}
    counted = Attempt.objects.filter(kept, assignment=assignment).order_by()
    alone: dict[int, int] = {}
    together: dict[int, int] = {}
    for racer, of_group, count in counted.values_list("racer", "submission_group").annotate(Count("pk")):
        if of_group is None:
            alone[racer] = count
        else:
            together[of_group] = together.get(of_group, 0) + count
    numbers = [part.number for part in assignment.parts.all()]
    rows = []
    for student in students_named(assignment.group, marks):
        pk = student.racer.pk
        group, mark = group_of.get(pk), marks.get(pk)
        marked = {part["number"]: part for part in mark.parts} if mark else {}
        cells: list[tuple[Decimal | None, bool]] = [
            (Decimal(marked[number]["points"]), bool(marked[number]["passed"])) if number in marked else (None, False)
            for number in numbers
        ]
        attempts = together.get(group.pk, 0) if group else alone.get(pk, 0)
        rows.append(MarkRow(student, mark, cells, attempts, group.name if group else ""))
    keys = {
        "points": lambda row: row.points or Decimal(0),
        "late": lambda row: row.mark.late_days if row.mark else 0,
        "attempts": lambda row: row.attempts,
        "state": lambda row: row.state,
    }
    if sort in keys:
        rows.sort(key=keys[sort], reverse=SORTS[sort] != backwards)
    elif backwards:
        rows.reverse()
    return rows


def assignments_of(group: RacerGroup) -> Sequence[Assignment]:
    """The published assignments of a group in the order in which they are due."""
    return list(Assignment.objects.filter(group=group, published_at__isnull=False).order_by("due_at", "pk"))
