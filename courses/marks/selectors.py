"""Marks that a racer sees."""

from django.db.models import Q, QuerySet

from accounts.models import Racer, Viewer

from ..assignments.selectors import can_teach
from ..grading.members import is_student, taught_by
from ..models import Mark


def can_see_mark(viewer: Viewer, mark: Mark) -> bool:
    """Teachers, and students their own. Twin of :func:`marks_visible_to`."""
    assignment = mark.assignment
    if can_teach(viewer, assignment):
        return True
    return (
        isinstance(viewer, Racer)
        and mark.racer_id == viewer.pk
        and assignment.published_at is not None
        and is_student(viewer, assignment.group_id)
    )


def marks_visible_to(viewer: Viewer) -> QuerySet[Mark]:
    """Twin of :func:`can_see_mark`."""
    marks = Mark.objects.select_related("assignment__group", "racer", "attempt")
    if not isinstance(viewer, Racer):
        return marks.none()
    member = {"assignment__group__members__racer": viewer.pk, "assignment__group__members__confirmed_at__isnull": False}
    own = Q(pk__in=Mark.objects.filter(racer=viewer.pk, assignment__published_at__isnull=False, **member).values("pk"))
    return marks.filter(own | taught_by(viewer, "assignment__group"))
