"""Stopping a training."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

from django.db import transaction

from ..events import record_end
from ..models import Checkpoint, EndReason, JobState, TrainingJob
from .jobs import TRAININGS

if TYPE_CHECKING:
    from accounts.models import Racer


@transaction.atomic
def stop_training(*, job: TrainingJob, now: datetime, by: Racer | None = None) -> bool:
    """Stop a training for good; what it has learned stays. False when it had ended already.

    One that runs is told so by its worker within a second, and ends with its models; so does one that waits to go on
    from a checkpoint. One that has not begun ends at once. ``by``: who asked, its owner or an admin.
    """
    begun = Checkpoint.objects.filter(job=job).exists()
    asked = {"stop_asked_at": now, "stopped_by": by}
    queued = TrainingJob.objects.filter(pk=job.pk, state=JobState.QUEUED)
    stopped: int = not begun and TRAININGS.end(
        queued, state=JobState.STOPPED, now=now, ended_because=EndReason.STOPPED, **asked
    )
    if stopped:
        record_end(job.pk, now)
    else:
        stopped = TRAININGS.under_way(job.pk).update(not_before=None, **asked)
        TRAININGS.wake()
    job.refresh_from_db()
    return bool(stopped)
