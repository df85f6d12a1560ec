"""How many trainings a racer may have under way, and how many minutes they may train in a month."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from datetime import datetime

from django.conf import settings
from django.db.models import Count, QuerySet
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from accounts.quotas import Quota
from faults.reasons import REASONS

from .models import JobState, TrainingJob

UNDER_WAY = (JobState.QUEUED, JobState.RUNNING)
_PLATFORM_CODES = [code for code, reason in REASONS.items() if reason.fault == "platform"]


def _at_once(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    """Trainings that wait or run."""
    return dict(_jobs(racers).filter(state__in=UNDER_WAY).order_by().values_list("owner").annotate(Count("pk")))


def _minutes(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    """Minutes of training since the month began (in the site's time zone): what ended counts as long as it took, what
    waits or runs for as long as it may. What failed through our fault does not count."""
    month = timezone.localtime(now).replace(day=1, hour=0, minute=0, second=0, microsecond=0)
    jobs = (
        _jobs(racers)
        .filter(created_at__gte=month)
        .exclude(state=JobState.FAILED, reason_code__in=_PLATFORM_CODES)
        .values_list("owner", "state", "seconds_done", "stop_minutes")
    )
    used: dict[int, float] = defaultdict(float)
    for owner, state, seconds, minutes in jobs:
        used[owner] += float(minutes) if state in UNDER_WAY else seconds / 60.0
    return used


def _jobs(racers: Collection[int] | None) -> QuerySet[TrainingJob]:
    return TrainingJob.objects.all() if racers is None else TrainingJob.objects.filter(owner__in=racers)


def _have_training() -> bool:
    return settings.TRAINING


AT_ONCE = Quota(5, "trainings_at_once", "TRAININGS_AT_ONCE", _("Trainings under way"), _at_once, _have_training)
MINUTES = Quota(
    6, "training_minutes", "TRAINING_MINUTES_A_MONTH", _("Minutes of training this month"), _minutes, _have_training
)
