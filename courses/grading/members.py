"""Teachers and students of groups. Each permission predicate has its queryset twin."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from django.db.models import Exists, OuterRef, Q, QuerySet

from accounts.models import ClassLearner, ClassTeacher, GroupMember, Racer, RacerGroup, Viewer
from paddock.errors import UserFault

from ..models import Assignment, Attempt, SubmissionGroup, SubmissionGroupMember


@dataclass(frozen=True)
class Unit:
    """The holder of one mark: a student, or a submission group with its members."""

    racers: tuple[int, ...]
    group: int | None = None

    def attempts(self, assignment: Assignment) -> QuerySet[Attempt]:
        """Their attempts, those given back too."""
        found = Attempt.objects.filter(assignment=assignment, is_reference=False)
        if self.group is not None:
            return found.filter(submission_group=self.group)
        return found.filter(submission_group=None, racer__in=self.racers)


def can_teach_group(viewer: Viewer, group: RacerGroup) -> bool:
    """Whether the racer makes assignments for a group: its leader, and the teachers of a class. Learners never. Twin of
    :func:`groups_taught_by`."""
    if not isinstance(viewer, Racer) or ClassLearner.objects.filter(racer=viewer.pk).exists():
        return False
    if viewer.pk == group.leader_id:
        return True
    return ClassTeacher.objects.filter(classroom__group=group, racer=viewer.pk).exists()


def require_teacher(group: RacerGroup, by: Racer) -> None:
    """Raises UserFault("assignment_not_yours")."""
    if not can_teach_group(by, group):
        raise UserFault("assignment_not_yours")


def groups_taught_by(viewer: Viewer) -> QuerySet[RacerGroup]:
    """Twin of :func:`can_teach_group`."""
    groups = RacerGroup.objects.all()
    if not isinstance(viewer, Racer):
        return groups.none()
    return groups.filter(_taught_by(viewer, ""))


def taught_by(viewer: Racer, to_group: str) -> Q:
    """Rows whose group, which ``to_group`` leads to, the racer teaches."""
    return _taught_by(viewer, f"{to_group}__")


def _taught_by(viewer: Racer, way: str) -> Q:
    second = ClassTeacher.objects.filter(racer=viewer.pk).values("classroom__group")
    return (Q(**{f"{way}leader": viewer.pk}) | Q(**{f"{way}pk__in": second})) & ~Q(
        Exists(ClassLearner.objects.filter(racer=viewer.pk))
    )


def students_of(group: RacerGroup | int) -> QuerySet[Racer]:
    """The confirmed members of a group without its teachers. Twin of :func:`is_student`."""
    return Racer.objects.filter(Exists(_memberships(group).filter(racer=OuterRef("pk"))))


def is_student(viewer: Viewer, group: RacerGroup | int) -> bool:
    """Whether the racer hands in attempts. Twin of :func:`students_of`."""
    return isinstance(viewer, Racer) and _memberships(group).filter(racer=viewer.pk).exists()


def _memberships(group: RacerGroup | int) -> QuerySet[GroupMember]:
    confirmed = GroupMember.objects.filter(group=group, confirmed_at__isnull=False)
    teaches = ClassTeacher.objects.filter(classroom__group=OuterRef("group"), racer=OuterRef("racer"))
    leads = RacerGroup.objects.filter(pk=OuterRef("group"), leader=OuterRef("racer"))
    return confirmed.exclude(Exists(teaches)).exclude(Exists(leads))


def unit_of(assignment: Assignment, racer: Racer | int) -> Unit:
    """The student, or their submission group."""
    pk = racer if isinstance(racer, int) else racer.pk
    member = SubmissionGroupMember.objects.filter(assignment=assignment, racer=pk).first()
    if member is None:
        return Unit((pk,))
    racers = SubmissionGroupMember.objects.filter(group=member.group_id).values_list("racer", flat=True)
    return Unit(tuple(racers), member.group_id)


def unit_of_attempt(attempt: Attempt) -> Unit:
    """Whose an attempt is."""
    if attempt.submission_group_id is None:
        return Unit((attempt.racer_id,))
    racers = SubmissionGroupMember.objects.filter(group=attempt.submission_group_id).values_list("racer", flat=True)
    return Unit(tuple(racers), attempt.submission_group_id)


def units_of(assignment: Assignment, racers: Iterable[int]) -> list[Unit]:
    """:func:`unit_of` of many in two queries, each once."""
    members = SubmissionGroupMember.objects.filter(assignment=assignment).values_list("racer", "group")
    group_of = dict(members)
    members_of: dict[int, list[int]] = {}
    for racer, group in group_of.items():
        members_of.setdefault(group, []).append(racer)
    units: dict[Unit, None] = {}
    for racer in racers:
        own = group_of.get(racer)
        units[Unit((racer,)) if own is None else Unit(tuple(members_of[own]), own)] = None
    return list(units)


def hold_units(units: Iterable[Unit]) -> None:
    """Lock these students and groups, always in the same order, until the transaction ends."""
    units = list(units)
    racers = sorted(racer for unit in units if unit.group is None for racer in unit.racers)
    groups = sorted(unit.group for unit in units if unit.group is not None)
    for rows, keys in ((Racer._base_manager.all(), racers), (SubmissionGroup._base_manager.all(), groups)):
        if keys:
            list(rows.select_for_update(no_key=True).filter(pk__in=keys).order_by("pk").only("pk"))
