"""How many trainings a racer may have under way, and how many minutes they may train in a month."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from datetime import datetime

from django.conf import settings
from django.db.models import Count, QuerySet, Sum
from django.utils.translation import gettext_lazy as _

from accounts.quotas import Quota
from accounts.storage import Shelf
from core.times import start_of_month
from evaluation.models import StoredFile
from evaluation.quotas import sizes_of_files
from paddock.errors.reasons import platform_codes

from .models import Checkpoint, JobState, TrainingIteration, TrainingJob
from .models.choices import UNDER_WAY


def _at_once(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    """Trainings that wait or run."""
    return dict(_jobs(racers).filter(state__in=UNDER_WAY).order_by().values_list("owner").annotate(Count("pk")))


def _minutes(racers: Collection[int] | None, now: datetime) -> Mapping[int, float]:
    """Minutes of the trainers since the month began (in the site's time zone): what ended counts as long as it held
    one, what waits or runs for as long as it may. What failed through our fault counts for nothing; what was
    deleted counts on."""
    month = start_of_month(now)
    jobs = (
        _jobs(racers)
        .filter(created_at__gte=month)
        .exclude(state=JobState.FAILED, reason_code__in=platform_codes())
        .values_list("owner", "state", "charged_s", "stop_minutes")
    )
    used: dict[int, float] = defaultdict(float)
    for owner, state, seconds, minutes in jobs:
        used[owner] += max(float(minutes), seconds / 60.0) if state in UNDER_WAY else seconds / 60.0
    return used


def _files(racers: Collection[int] | None) -> Mapping[int, float]:
    """Checkpoints, sim-traces and models as stable-baselines3 saves them. Networks that became models are on the shelf
    of networks."""
    used: dict[int, float] = defaultdict(float)
    for model, column, owner in (
        (Checkpoint, "file", "job__owner"),
        (Checkpoint, "networks", "job__owner"),
        (TrainingIteration, "simtrace", "job__owner"),
        (TrainingJob, "sb3_zip", "owner"),
    ):
        for racer, size in sizes_of_files(model, column, owner, racers).items():
            used[racer] += size
    return used


def files_of(job: TrainingJob) -> list[str]:
    """The names of all files that a training has."""
    names = [name for names in job.checkpoints.values_list("file", "networks") for name in names]
    names += job.iterations.values_list("simtrace", flat=True)
    return [name for name in (*names, job.sb3_zip.name) if name]


def bytes_of(job: TrainingJob) -> int:
    """What the training's files weigh together, without its models' networks."""
    sizes = StoredFile.objects.filter(name__in=files_of(job)).aggregate(Sum("size"))
    return sizes["size__sum"] or 0


def _jobs(racers: Collection[int] | None) -> QuerySet[TrainingJob]:
    return TrainingJob.objects.all() if racers is None else TrainingJob.objects.filter(owner__in=racers)


def _have_training() -> bool:
    return settings.TRAINING


FILES = Shelf(3, "trainings", _("Trainings: checkpoints, sim-traces, models for stable-baselines3"), _files)
AT_ONCE = Quota(5, "trainings_at_once", "TRAININGS_AT_ONCE", _("Trainings in progress"), _at_once, _have_training)
MINUTES = Quota(
    6, "training_minutes", "TRAINING_MINUTES_A_MONTH", _("Minutes of training this month"), _minutes, _have_training
)
