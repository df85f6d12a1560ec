"""The quota of a teacher: assignments that are not over."""

from datetime import datetime

from django.db.models import Count, Q
from django.utils.translation import gettext_lazy as _

from accounts.quotas import CountedRows, Quota, Racers, only

from .models import Assignment


def _assignments(racers: Racers, now: datetime) -> CountedRows:
    """Assignments that the racer made and that students may still hand in to."""
    under_way = Assignment.objects.filter(Q(due_at__gt=now) | Q(last_at__gt=now)).exclude(created_by=None)
    return only(under_way, "created_by", racers).order_by().values_list("created_by").annotate(Count("pk"))


ASSIGNMENTS = Quota(13, "assignments", "ASSIGNMENTS_PER_TEACHER", _("Assignments that are not over"), _assignments)
