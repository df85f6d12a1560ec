"""Quotas of trainings: at the same time, minutes a month, stored files."""

from collections import defaultdict
from collections.abc import Mapping
from datetime import datetime
from typing import Any

from django.conf import settings
from django.db.models import Case, Q, QuerySet, Sum, Value, When
from django.db.models.functions import Coalesce
from django.utils.translation import gettext_lazy as _

from accounts.quotas import CountedRows, Quota, Racers, one_of, only
from accounts.usage.storage import Shelf
from core.database.kept_queries import KeptQuery
from core.times import start_of_month
from evaluation.garage.quotas import FileColumn, sizes_of_files
from evaluation.models import StoredFile
from paddock.errors.reasons import platform_codes

from .models import Checkpoint, JobState, Sweep, SweepState, TrainingIteration, TrainingJob
from .models.choices import UNDER_WAY


def used_quotas(racers: Racers, now: datetime) -> dict[str, Mapping[int, float]]:
    """The use of both quotas by their names, in one query. Trainings that wait or run; a sweep is one of them until it
    ends. Minutes of the trainers since the month began (in the site's time zone): what ended counts as long as it held
    one, what waits or runs for as long as it may, and a running sweep for its budget. What failed through our fault
    counts for nothing; what was deleted counts on."""
    month = start_of_month(now)
    one = one_of(racers)
    rows = _rows(racers, month) if one is None else _rows_of_one(racer=one, month=month)
    at_once: dict[int, float] = defaultdict(float)
    minutes: dict[int, float] = defaultdict(float)
    for kind, owner, is_whole, created_at, seconds, most in rows:
        at_once[owner] += is_whole
        if kind == "sweep":
            minutes[owner] += max(0.0, most - seconds) / 60.0
        elif created_at >= month:
            minutes[owner] += max(float(most), seconds / 60.0) if is_whole else seconds / 60.0
    return {AT_ONCE.name: at_once, MINUTES.name: minutes}


def _rows(racers: Racers, month: Any) -> QuerySet[Any, Any]:
    ours = Q(state=JobState.FAILED, reason_code__in=platform_codes())
    jobs = only(TrainingJob.objects.all(), "owner", racers).filter(
        Q(created_at__gte=month) & ~ours | Q(state__in=UNDER_WAY, stop_seconds=None)
    )
    whole = Case(When(state__in=UNDER_WAY, stop_seconds=None, then=1), default=0)
    jobs = jobs.order_by().annotate(kind=Value("job"), whole=whole)
    running = only(Sweep.objects.filter(state=SweepState.RUNNING), "owner", racers)
    sweeps = running.order_by().annotate(kind=Value("sweep"), whole=Value(1))
    sweeps = sweeps.annotate(charged_s=Coalesce(Sum("trials__job__charged_s"), 0.0))
    columns = ("kind", "owner", "whole", "created_at", "charged_s")
    return jobs.values_list(*columns, "stop_minutes").union(sweeps.values_list(*columns, "budget_s"), all=True)


_rows_of_one: KeptQuery[Any] = KeptQuery(lambda racer, month: _rows(racer, month))


def _files(racers: Racers) -> list[CountedRows]:
    """Checkpoints, sim-traces and models as stable-baselines3 saves them. Networks that became models are on the shelf
    of networks."""
    tables: list[FileColumn] = [
        (Checkpoint, "file", "job__owner", {}),
        (Checkpoint, "networks", "job__owner", {}),
        (TrainingIteration, "simtrace", "job__owner", {}),
        (TrainingJob, "sb3_zip", "owner", {}),
    ]
    return sizes_of_files(tables, racers)


def files_of(job: TrainingJob) -> list[str]:
    """The names of all files that a training has."""
    names = [name for names in job.checkpoints.values_list("file", "networks") for name in names]
    names += job.iterations.values_list("simtrace", flat=True)
    return [name for name in (*names, job.sb3_zip.name) if name]


def bytes_of(job: TrainingJob) -> int:
    """What the training's files weigh together, without its models' networks."""
    sizes = StoredFile.objects.filter(name__in=files_of(job)).aggregate(Sum("size"))
    return sizes["size__sum"] or 0


def _have_training() -> bool:
    return settings.TRAINING


FILES = Shelf(3, "trainings", _("Trainings: checkpoints, sim-traces, models for stable-baselines3"), _files)
AT_ONCE = Quota(
    5, "trainings_at_once", "TRAININGS_AT_ONCE", _("Trainings in progress"), used_quotas, _have_training, False
)
MINUTES = Quota(
    *(6, "training_minutes", "TRAINING_MINUTES_A_MONTH", _("Minutes of training this month")),
    *(used_quotas, _have_training, False),
)
