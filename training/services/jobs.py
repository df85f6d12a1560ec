"""The queue of trainings (:mod:`core.jobs`): what is theirs of it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from django.db.models import F

from core.clock import database_now
from core.jobs.heartbeat import Heartbeat
from core.jobs.kinds import register
from core.jobs.outages import waits_for_storage
from core.jobs.retried import RetriedKind, Verdict
from core.streams import poke
from paddock.errors import PaddockError, PlatformFault, fault_from_dict

from ..events import record_end
from ..models import Checkpoint, EndReason, TrainingJob
from ..queue_order import waiting_in_order
from .tolls import charge, last_word, toll_of

KEEPINGS_TRIED = 3  # so often a mistake of ours may stop what makes models of what a lost training had learned
_MISTAKES = ("internal_error", "file_damaged", "conversion_failed")  # which trying again seldom mends


class Trainings(RetriedKind[TrainingJob]):
    """Racers take turns at the trainers (:mod:`training.queue_order`).

    After a fault of the platform a training waits to go on from its last checkpoint. It fails only where its own
    process says so ``EVALUATION_MAX_ATTEMPTS`` times and it gets no further (:mod:`.tolls`): with ``training_gave_up``,
    or with the UserFault ``training_broke_down`` where a reward function of the racer's own may have brought that
    about. Where there is a checkpoint it waits once more, with that reason, for a worker that makes models of what the
    checkpoint holds: a training leaves a model whatever ends it.
    """

    name, model, task, queue = "Training", TrainingJob, "training.tasks.train", "training"
    related = ("track", "owner", "cloned_from__network")
    blank = {"progress": {}, "seen": {}}
    wakes = 4
    lost_code = "trainer_lost"

    def next_in_queue(self, now: datetime) -> Sequence[tuple[int, int]]:
        return [(one.pk, one.attempt) for one in waiting_in_order(now)]

    def progress_columns(self, progress: dict[str, Any]) -> dict[str, Any]:
        told = dict(progress)
        seen = told.pop("seen", None)
        columns = {"progress": told, "seconds_done": told["seconds"]}
        return columns if seen is None else columns | {"seen": seen}

    def after(self, job: TrainingJob, fault: PaddockError, now: datetime) -> Verdict:
        columns: dict[str, Any] = {"charged_s": charge(job, now, fault)}
        final, again = _what_next(job, fault)
        pause = None
        if isinstance(fault, PlatformFault):
            toll = toll_of(job, fault)
            columns |= toll.columns()
            if waits_for_storage(fault):
                columns["attempt"] = F("attempt") - 1
            else:
                pause = toll.pause
        if final is not None and verdict(job) is None:
            pause = None
            columns |= {"reason_code": final.code, "reason_params": final.params, "failures": 0, "kills": 0}
        elif final is not None and fault.code in _MISTAKES:
            columns["kills"] = job.kills + 1
        if again:
            return Verdict(pause=pause, columns=columns)
        return Verdict(final, columns=columns | {"ended_because": EndReason.FAILED})

    def released(self, job: TrainingJob, now: datetime) -> dict[str, Any]:
        return {"charged_s": charge(job, now, PlatformFault("trainer_lost"))}

    def gave_up(self, job: TrainingJob, now: datetime) -> None:
        from .records import drop_checkpoints

        drop_checkpoints(job)
        record_end(job.pk, now)

    def topics(self, job: TrainingJob) -> tuple[str, ...]:
        return (f"training:{job.public_id}",)

    def heartbeat(self, job: TrainingJob) -> TrainingHeartbeat:
        return TrainingHeartbeat(job)


TRAININGS = register(Trainings())


class TrainingHeartbeat(Heartbeat):
    """It also hears of its owner's wish, ``stop_asked``. ``progress``: as it was told last."""

    def __init__(self, job: TrainingJob) -> None:
        super().__init__(f"training {job.public_id}", self.look, lease=TRAININGS.lease, always=True)
        self._topics = TRAININGS.topics(job)
        self._held: dict[str, Any] = {"pk": job.pk, "lease": job.lease}
        self.progress: dict[str, Any] = {}
        self.stop_asked = job.stop_asked_at is not None

    def tell(self, progress: dict[str, Any]) -> None:
        self.progress = progress
        super().tell(progress)

    def look(self, progress: dict[str, Any] | None) -> bool:
        """Prolong the lease, and see whether it shall stop. False: the lease is gone."""
        if not TRAININGS.beat(**self._held, progress=progress, now=database_now()):
            return False
        if progress is not None:
            poke(self._topics)
        asked = TRAININGS.held(**self._held).filter(stop_asked_at__isnull=False)
        self.stop_asked = self.stop_asked or asked.exists()
        return True


def verdict(job: TrainingJob) -> PaddockError | None:
    """What a training that still waits or runs will end with: nothing is trained any more, its models are to be kept.
    None: it trains."""
    return fault_from_dict({"code": job.reason_code, "params": job.reason_params}) if job.reason_code else None


def _what_next(job: TrainingJob, fault: PaddockError) -> tuple[PaddockError | None, bool]:
    """What the training ends with, None if it goes on; and whether a worker has yet to take it on."""
    known = verdict(job)
    if known is not None:
        mistakes = job.kills + (fault.code in _MISTAKES)
        return known, isinstance(fault, PlatformFault) and mistakes < KEEPINGS_TRIED
    final = last_word(job, fault)
    return final, final is None or Checkpoint.objects.filter(job=job).exclude(networks="").exists()
