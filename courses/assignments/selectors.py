"""Access to assignments. Each predicate has its queryset twin; tests compare both."""

from collections import defaultdict
from collections.abc import Sequence

from django.db.models import Q, QuerySet

from accounts.models import ClassTeacher, GroupMember, Racer, RacerGroup, Viewer
from core.events import Event

from ..grading.members import can_teach_group, is_student, taught_by
from ..models import Assignment


def can_teach(viewer: Viewer, assignment: Assignment) -> bool:
    """Whether the viewer changes an assignment and sees all attempts and marks. Twin of
    :func:`assignments_taught_by`."""
    return can_teach_group(viewer, assignment.group)


def assignments_taught_by(viewer: Viewer) -> QuerySet[Assignment]:
    """Twin of :func:`can_teach`."""
    found = Assignment.objects.select_related("group__leader")
    return found.filter(taught_by(viewer, "group")) if isinstance(viewer, Racer) else found.none()


def can_see_assignment(viewer: Viewer, assignment: Assignment) -> bool:
    """Teachers, and students once it is published. Twin of :func:`assignments_visible_to`."""
    if can_teach(viewer, assignment):
        return True
    return assignment.published_at is not None and is_student(viewer, assignment.group_id)


def assignments_visible_to(viewer: Viewer) -> QuerySet[Assignment]:
    """Twin of :func:`can_see_assignment`."""
    found = Assignment.objects.select_related("group__leader")
    if not isinstance(viewer, Racer):
        return found.none()
    member = RacerGroup.objects.filter(members__racer=viewer.pk, members__confirmed_at__isnull=False)
    student = Q(published_at__isnull=False, group__in=member.values("pk"))
    # teaching members see it anyway
    return found.filter(student | taught_by(viewer, "group"))


def moves(events: Sequence[Event]) -> dict[int, set[str]]:
    """An event of an assignment moves the open pages of its teachers and students."""
    subjects = {event.pk: event.subject for event in events if event.kind.startswith("assignment.")}
    if not subjects:
        return {}
    groups = dict(Assignment.objects.filter(public_id__in=subjects.values()).values_list("public_id", "group"))
    confirmed = GroupMember.objects.filter(group__in=groups.values(), confirmed_at__isnull=False)
    topics: dict[int, set[str]] = defaultdict(set)
    for group, racer in (
        *confirmed.values_list("group", "racer"),
        *ClassTeacher.objects.filter(classroom__group__in=groups.values()).values_list("classroom__group", "racer"),
        *RacerGroup.objects.filter(pk__in=groups.values()).exclude(leader=None).values_list("pk", "leader"),
    ):
        topics[group].add(f"racer:{racer}")
    return {pk: topics[groups[subject]] for pk, subject in subjects.items() if subject in groups}
