"""Running a failed training again."""

from __future__ import annotations

from django.db import transaction

from paddock.errors.reasons import platform_codes

from ..models import JobState, TrainingJob
from .jobs import TRAININGS
from .records import delete_stored


@transaction.atomic
def train_again(*, job: TrainingJob) -> bool:
    """Put a training that failed without leaving a model back into the queue: it begins from its start, its log goes
    on. False when it is not failed any more.

    Raises IntegrityError when its owner has another training of that name under way.
    """
    failed = TrainingJob.objects.filter(pk=job.pk, state=JobState.FAILED, best_model=None, last_model=None)
    again = TRAININGS.begin_anew(
        failed.filter(deleted_at=None),
        steps_done=0,
        seconds_done=0,
        charged_s=0.0 if job.reason_code in platform_codes() else job.charged_s,
        failures=0,
        got_to=0,
        stop_asked_at=None,
        stopped_by=None,
        ended_because="",
    )
    if again:
        traces = [name for name in job.iterations.values_list("simtrace", flat=True) if name]
        job.iterations.all().delete()
        transaction.on_commit(lambda: delete_stored(traces), robust=True)
    return again
