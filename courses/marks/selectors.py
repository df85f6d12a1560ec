"""Marks that a racer sees."""

from django.db.models import Q, QuerySet

from accounts.models import Racer, Viewer

from ..grading.members import taught_by
from ..models import Mark


def marks_visible_to(viewer: Viewer) -> QuerySet[Mark]:
    """Teachers, and students their own."""
    marks = Mark.objects.select_related("assignment__group", "racer", "attempt")
    if not isinstance(viewer, Racer):
        return marks.none()
    member = {"assignment__group__members__racer": viewer.pk, "assignment__group__members__confirmed_at__isnull": False}
    own = Q(pk__in=Mark.objects.filter(racer=viewer.pk, assignment__published_at__isnull=False, **member).values("pk"))
    return marks.filter(own | taught_by(viewer, "assignment__group"))
