"""The job kind of trainings (:mod:`core.jobs`): claim, stop, repeat."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

from django.db import transaction
from django.db.models import F, QuerySet
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from core.database.clock import database_now
from core.jobs.heartbeat import Heartbeat
from core.jobs.kinds import register
from core.jobs.outages import waits_for_storage
from core.jobs.queues import Queue, register_queue
from core.jobs.retried import RetriedKind, Verdict, pause_after
from core.streams import poke
from paddock.errors import PaddockError, PlatformFault, fault_from_dict
from paddock.errors.reasons import platform_codes

from ...events import record_end
from ...models import Checkpoint, EndReason, JobState, TrainingJob, TrainingProgress
from ..queue_order import waiting_in_order
from .deletion import delete_stored, drop_checkpoints
from .usage_accounting import charge, count_fault, final_fault

KEEPINGS_TRIED = 3  # so often a mistake of ours may stop what makes models of what a lost training had learned
_MISTAKES = ("internal_error", "file_damaged", "conversion_failed")  # which trying again seldom mends


class Trainings(RetriedKind[TrainingJob]):
    """Racers take turns at the trainers (:mod:`training.jobs.queue_order`).

    After a fault of the platform a training waits and resumes from its last checkpoint. It fails only if its process
    fails ``EVALUATION_MAX_ATTEMPTS`` times without progress (:mod:`.usage_accounting`): with ``training_gave_up``, or
    with the UserFault ``training_broke_down`` if the racer's reward function may be the cause. If there is a
    checkpoint, it waits once more, with that reason, for a worker that makes models of the checkpoint's networks: every
    training with a checkpoint leaves a model.
    """

    name, model, task, queue = "Training", TrainingJob, "training.tasks.train", "training"
    since = "created_at"
    related = ("track", "owner", "cloned_from__network")
    blank = {"progress": {}, "seen": {}}
    wakes = 4
    lost_code = "trainer_lost"

    def next_in_queue(self, now: datetime) -> Sequence[tuple[int, int]]:
        return [(one.pk, one.attempt) for one in waiting_in_order(now)]

    def progress_columns(self, progress: TrainingProgress) -> dict[str, object]:
        figures = {name: value for name, value in progress.items() if name != "seen"}
        columns = {"progress": figures, "seconds_done": progress["seconds"]}
        return columns | {"seen": progress["seen"]} if "seen" in progress else columns

    def after(self, job: TrainingJob, fault: PaddockError, now: datetime) -> Verdict:
        columns: dict[str, object] = {"charged_s": charge(job, now, fault)}
        final, again = _what_next(job, fault)
        pause = None
        if isinstance(fault, PlatformFault):
            count = count_fault(job, fault)
            columns |= count._asdict()
            if waits_for_storage(fault):
                columns["attempt"] = F("attempt") - 1
            else:
                pause = pause_after(count.failures)
        if final is not None and verdict(job) is None:
            pause = None
            columns |= {"reason_code": final.code, "reason_params": final.params, "failures": 0, "kills": 0}
        elif final is not None and fault.code in _MISTAKES:
            columns["kills"] = job.kills + 1
        if again:
            return Verdict(pause=pause, columns=columns)
        return Verdict(final, columns=columns | {"ended_because": EndReason.FAILED})

    def released(self, job: TrainingJob, now: datetime) -> dict[str, float]:
        return {"charged_s": charge(job, now, PlatformFault("trainer_lost"))}

    def gave_up(self, job: TrainingJob, now: datetime) -> None:
        drop_checkpoints(job)
        record_end(job.pk, now)

    def topics(self, job: TrainingJob) -> tuple[str, ...]:
        return (f"training:{job.public_id}",)

    def heartbeat(self, job: TrainingJob) -> TrainingHeartbeat:
        return TrainingHeartbeat(job)


TRAININGS = register(Trainings())


class TrainingHeartbeat(Heartbeat):
    """Also reads the owner's request to stop, ``stop_asked``. ``progress``: the latest report."""

    def __init__(self, job: TrainingJob) -> None:
        super().__init__(f"training {job.public_id}", self.look, lease=TRAININGS.lease, always=True)
        self._topics = TRAININGS.topics(job)
        assert job.lease is not None, "it was claimed"
        self._pk, self._lease = job.pk, job.lease
        self.progress: TrainingProgress = {}
        self.stop_asked = job.stop_asked_at is not None

    def tell(self, progress: TrainingProgress) -> None:
        self.progress = progress
        super().tell(progress)

    def look(self, progress: TrainingProgress | None) -> bool:
        """Extend the lease and read the request to stop. False: the lease is gone."""
        if not TRAININGS.beat(pk=self._pk, lease=self._lease, progress=progress, now=database_now()):
            return False
        if progress is not None:
            poke(self._topics)
        asked = TRAININGS.held(self._pk, self._lease).filter(stop_asked_at__isnull=False)
        self.stop_asked = self.stop_asked or asked.exists()
        return True


def verdict(job: TrainingJob) -> PaddockError | None:
    """What a training whose models are only to be kept ends with; None: it trains."""
    return fault_from_dict({"code": job.reason_code, "params": job.reason_params}) if job.reason_code else None


def _what_next(job: TrainingJob, fault: PaddockError) -> tuple[PaddockError | None, bool]:
    known = verdict(job)
    if known is not None:
        mistakes = job.kills + (fault.code in _MISTAKES)
        return known, isinstance(fault, PlatformFault) and mistakes < KEEPINGS_TRIED
    final = final_fault(job, fault)
    return final, final is None or Checkpoint.objects.filter(job=job).exclude(networks="").exists()


@audited("training.stopped", _("Training stopped"), target="job", unless="owner")
@transaction.atomic
def stop_training(*, job: TrainingJob, now: datetime, by: Racer | None = None) -> bool:
    """Stop a training; its models stay. False if it had ended already. ``by``: the owner or an admin.

    A training that has not begun ends at once; a worker stops any other within a second and keeps its models.
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


@transaction.atomic
def train_again(*, job: TrainingJob) -> bool:
    """Queue a training that failed without a model again, from its start; its log goes on. False if it is not failed.

    Raises IntegrityError if its owner has another training of that name under way.
    """
    failed = repeatable(TrainingJob.objects.filter(pk=job.pk, state=JobState.FAILED))
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


def repeatable(failed: QuerySet[TrainingJob]) -> QuerySet[TrainingJob]:
    """Those of failed trainings that left no model; not trials, for their sweep went on without them."""
    return failed.filter(best_model=None, last_model=None, trial=None)


def register_operators_queue() -> None:
    """Add trainings to the operators' page."""
    register_queue(
        Queue(
            *("trainings", _("Trainings"), TRAININGS),
            related=("owner", "track"),
            repeatable=repeatable,
            run_again=lambda job, now: train_again(job=job),
        )
    )
