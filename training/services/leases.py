"""Claiming, holding and ending a training: guarded UPDATEs that name the lease (see evaluation.services.leases)."""

from __future__ import annotations

import logging
import uuid
from dataclasses import dataclass
from datetime import datetime, timedelta

from django.conf import settings
from django.db import transaction
from django.db.models import F, QuerySet, Value
from django.db.models.functions import Concat

from evaluation.services.outages import storage_is_out
from faults import PaddockError, PlatformFault, UserFault, fault_from_dict

from ..models import Checkpoint, EndReason, JobState, TrainingJob
from ..rewards.examples import EXAMPLES
from .bell import ring_training_bell

logger = logging.getLogger(__name__)
DETAIL_LIMIT = 4000
BELLS_AT_ONCE = 4
KEEPINGS_TRIED = 3  # by so many workers, one after the other, to make models of what a lost training had learned
# What a process may die of that a stranger's code ran in; everything else is beyond that code's reach.
_FROM_INSIDE = ("trainer_error", "trainer_died")
_OUR_CODE = frozenset(example.code.strip() for example in EXAMPLES)


def held(job_id: int, lease: uuid.UUID) -> QuerySet[TrainingJob]:
    """The job while this lease is good: one row or none."""
    return TrainingJob.objects.filter(pk=job_id, state=JobState.RUNNING, lease=lease)


def claim_next_training(*, worker: str, now: datetime) -> TrainingJob | None:
    """Take the training that has waited longest under a new lease; None when nothing waits, and while
    the storage is out."""
    if storage_is_out():
        return None
    while True:
        waiting = TrainingJob.objects.filter(state=JobState.QUEUED).order_by("created_at", "pk").only("attempt").first()
        if waiting is None:
            return None
        lease = uuid.uuid4()
        claimed = TrainingJob.objects.filter(pk=waiting.pk, state=JobState.QUEUED, attempt=waiting.attempt).update(
            state=JobState.RUNNING,
            lease=lease,
            leased_until=now + timedelta(seconds=settings.LEASE_SECONDS),
            worker=worker[:128],
            attempt=F("attempt") + 1,
            started_at=now,
            progress={},
        )
        if claimed:
            job = held(waiting.pk, lease).select_related("track", "owner", "cloned_from__network").first()
            if job is not None:
                return job


@dataclass(frozen=True)
class Pulse:
    """What a heartbeat learned: whether the lease is still good, and whether the training shall stop."""

    held: bool
    stop_asked: bool


def beat(*, job_id: int, lease: uuid.UUID, progress: dict | None, now: datetime) -> Pulse:
    """Prolong a lease, and write the progress unless it is None."""
    changes: dict = {"leased_until": now + timedelta(seconds=settings.LEASE_SECONDS)}
    if progress is not None:
        changes |= {"progress": progress, "seconds_done": progress["seconds"]}
    mine = held(job_id, lease)
    if not mine.update(**changes):
        return Pulse(held=False, stop_asked=False)
    return Pulse(held=True, stop_asked=mine.filter(stop_asked_at__isnull=False).exists())


def fail_training(*, job_id: int, lease: uuid.UUID, fault: PaddockError, now: datetime, detail: str = "") -> bool:
    """End an attempt that failed. False: the lease is gone.

    A user's fault is final at once. While the storage is out it waits, and no attempt counts. After another fault of
    the platform the training waits to go on from its last checkpoint, until ``EVALUATION_MAX_ATTEMPTS`` are
    used up; then it fails with ``training_gave_up``, or with the UserFault
    ``training_broke_down`` where a reward function of the racer's own may have brought that about.

    Where there is a checkpoint it waits once more, with that reason, for a worker that makes models of what the
    checkpoint holds: a training leaves a model whatever ends it.
    """
    job = held(job_id, lease).first()
    return job is not None and _fail(held(job_id, lease), job, fault, now, detail)


def verdict(job: TrainingJob) -> PaddockError | None:
    """What a training that still waits or runs will end with: nothing is trained any more, its models are to be kept.
    None: it trains."""
    return fault_from_dict({"code": job.reason_code, "params": job.reason_params}) if job.reason_code else None


def last_word(job: TrainingJob, fault: PaddockError) -> PaddockError | None:
    """What a training ends with after this fault of this attempt; None: it goes on from its last checkpoint."""
    if not isinstance(fault, PlatformFault):
        return fault
    if job.attempt < settings.EVALUATION_MAX_ATTEMPTS or _waits_for_storage(fault):
        return None
    if fault.code in _FROM_INSIDE and job.reward_code.strip() not in _OUR_CODE:
        how = fault.params.get("detail") or fault.params.get("how", "")
        return UserFault("training_broke_down", attempts=job.attempt, how=how)
    return PlatformFault("training_gave_up", attempts=job.attempt)


def _waits_for_storage(fault: PaddockError) -> bool:
    return fault.code == "storage_failed" and storage_is_out()


def release_training(*, job_id: int, lease: uuid.UUID, now: datetime) -> bool:
    """Hand a training back because its worker is shutting down: it goes on from its last checkpoint elsewhere. No
    attempt counts."""
    with transaction.atomic():
        released = held(job_id, lease).update(
            state=JobState.QUEUED, lease=None, leased_until=None, started_at=None, progress={}, attempt=F("attempt") - 1
        )
        if released:
            ring_training_bell()
    return bool(released)


def sweep_trainings(*, now: datetime, ring: bool = True) -> int:
    """Put trainings whose worker disappeared back into the queue, and ring for whatever waits. How many wait.

    What has used up its attempts fails; with a checkpoint, as soon as a worker has made models of that.
    """
    for job in TrainingJob.objects.filter(state=JobState.RUNNING, leased_until__lt=now).order_by("leased_until"):
        mine = held(job.pk, job.lease).filter(leased_until__lt=now)
        try:
            _fail(mine, job, PlatformFault("trainer_lost"), now, f"worker {job.worker}")
        except Exception:
            logger.exception("Training %s cannot be ended.", job.public_id)
    waiting = TrainingJob.objects.filter(state=JobState.QUEUED).count()
    if waiting and ring:
        ring_training_bell(times=min(waiting, BELLS_AT_ONCE))
    return waiting


@transaction.atomic
def _fail(mine: QuerySet[TrainingJob], job: TrainingJob, fault: PaddockError, now: datetime, detail: str) -> bool:
    from .records import drop_checkpoints

    changes: dict = {"lease": None, "leased_until": None}
    ours = isinstance(fault, PlatformFault)
    if ours or detail:
        note = f"Attempt {job.attempt}: {fault.code}. {detail.strip()[-DETAIL_LIMIT:]}".strip()
        changes["operator_detail"] = Concat("operator_detail", Value(note + "\n"))
    if ours:
        logger.warning("Training %s, attempt %s: %s. %s", job.public_id, job.attempt, fault.code, detail)
    if _waits_for_storage(fault):
        changes["attempt"] = F("attempt") - 1
        final, again = None, True
    else:
        final, again = _what_next(job, fault)
    if final is not None:
        changes |= {"reason_code": final.code, "reason_params": final.params}
    if again:
        requeued = mine.update(state=JobState.QUEUED, started_at=None, progress={}, **changes)
        if requeued:
            ring_training_bell()
        return bool(requeued)
    failed = mine.update(state=JobState.FAILED, ended_because=EndReason.FAILED, ended_at=now, **changes)
    if failed:
        drop_checkpoints(job)
    return bool(failed)


def _what_next(job: TrainingJob, fault: PaddockError) -> tuple[PaddockError | None, bool]:
    """What the training ends with, None if it goes on; and whether a worker has yet to take it on."""
    known = verdict(job)
    if known is not None:
        left = settings.EVALUATION_MAX_ATTEMPTS + KEEPINGS_TRIED - job.attempt
        return known, isinstance(fault, PlatformFault) and left > 0
    final = last_word(job, fault)
    return final, final is None or Checkpoint.objects.filter(job=job).exclude(networks="").exists()
