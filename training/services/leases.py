"""Claiming, holding and ending a training: guarded UPDATEs that name the lease (see evaluation.services.leases)."""

from __future__ import annotations

import logging
import uuid
from dataclasses import dataclass
from datetime import datetime, timedelta

from django.conf import settings
from django.db import transaction
from django.db.models import F, QuerySet

from evaluation.services.leases import DETAIL_LIMIT, detail_with
from evaluation.services.outages import storage_is_out
from paddock.errors import PaddockError, PlatformFault, fault_from_dict

from ..events import record_end
from ..line import due, line_of
from ..models import Checkpoint, EndReason, JobState, TrainingJob
from .bell import ring_training_bell
from .tolls import charge, last_word, toll_of, waits_for_storage

logger = logging.getLogger(__name__)
BELLS_AT_ONCE = 4
KEEPINGS_TRIED = 3  # so often a mistake of ours may stop what makes models of what a lost training had learned
_MISTAKES = ("internal_error", "file_damaged", "conversion_failed")  # which trying again seldom mends


def held(job_id: int, lease: uuid.UUID) -> QuerySet[TrainingJob]:
    """The job while this lease is good: one row or none."""
    return TrainingJob.objects.filter(pk=job_id, state=JobState.RUNNING, lease=lease)


def claim_next_training(*, worker: str, now: datetime) -> TrainingJob | None:
    """Take the training whose turn it is (:mod:`training.line`) under a new lease; None when nothing waits or all that
    waits pauses, and while the storage is out."""
    if storage_is_out():
        return None
    while line := line_of(now):
        for waiting in line:
            lease = uuid.uuid4()
            mine = TrainingJob.objects.filter(due(now), pk=waiting.pk, state=JobState.QUEUED, attempt=waiting.attempt)
            claimed = mine.update(
                state=JobState.RUNNING,
                lease=lease,
                leased_until=now + timedelta(seconds=settings.LEASE_SECONDS),
                worker=worker[:128],
                attempt=F("attempt") + 1,
                started_at=now,
                not_before=None,
                progress={},
            )
            related = ("track", "owner", "cloned_from__network")
            job = held(waiting.pk, lease).select_related(*related).first() if claimed else None
            if job is not None:
                return job
    return None  # a lost race means that somebody else won it, so this loop ends


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

    A user's fault is final at once. After a fault of the platform the training waits to go on from its last checkpoint,
    with growing pauses, for as long as it takes. It fails only where its own process says so
    ``EVALUATION_MAX_ATTEMPTS`` times and it gets no further (:mod:`.tolls`): with ``training_gave_up``, or with the
    UserFault ``training_broke_down`` where a reward function of the racer's own may have brought that about.

    Where there is a checkpoint it waits once more, with that reason, for a worker that makes models of what the
    checkpoint holds: a training leaves a model whatever ends it.
    """
    job = held(job_id, lease).first()
    return job is not None and _fail(held(job_id, lease), job, fault, now, detail)


def verdict(job: TrainingJob) -> PaddockError | None:
    """What a training that still waits or runs will end with: nothing is trained any more, its models are to be kept.
    None: it trains."""
    return fault_from_dict({"code": job.reason_code, "params": job.reason_params}) if job.reason_code else None


def release_training(*, job_id: int, lease: uuid.UUID, now: datetime) -> bool:
    """Hand a training back because its worker is shutting down: it goes on from its last checkpoint elsewhere. No
    attempt counts."""
    with transaction.atomic():
        job = held(job_id, lease).first()
        released = job is not None and held(job_id, lease).update(
            state=JobState.QUEUED,
            lease=None,
            leased_until=None,
            started_at=None,
            progress={},
            attempt=F("attempt") - 1,
            charged_s=charge(job, now, PlatformFault("trainer_lost")),
        )
        if released:
            ring_training_bell()
    return bool(released)


def sweep_trainings(*, now: datetime, ring: bool = True) -> int:
    """Put trainings whose worker disappeared back into the queue, and ring for whatever waits and does not pause. How
    many do."""
    for job in TrainingJob.objects.filter(state=JobState.RUNNING, leased_until__lt=now).order_by("leased_until"):
        mine = held(job.pk, job.lease).filter(leased_until__lt=now)
        try:
            _fail(mine, job, PlatformFault("trainer_lost"), now, f"worker {job.worker}")
        except Exception:
            logger.exception("Training %s cannot be ended.", job.public_id)
    waiting = TrainingJob.objects.filter(due(now), state=JobState.QUEUED).count()
    if waiting and ring:
        ring_training_bell(times=min(waiting, BELLS_AT_ONCE))
    return waiting


@transaction.atomic
def _fail(mine: QuerySet[TrainingJob], job: TrainingJob, fault: PaddockError, now: datetime, detail: str) -> bool:
    """End the attempt of the row in ``mine`` (one or none); ``job`` is how it was read under the same lease."""
    from .records import drop_checkpoints

    ours = isinstance(fault, PlatformFault)
    changes: dict = {"lease": None, "leased_until": None, "charged_s": charge(job, now, fault)}
    if ours or detail:
        changes["operator_detail"] = detail_with(
            f"Attempt {job.attempt}: {fault.code}. {detail.strip()[-DETAIL_LIMIT:]}"
        )
    if ours:
        logger.warning("Training %s, attempt %s: %s. %s", job.public_id, job.attempt, fault.code, detail)
    final, again = _what_next(job, fault)
    pause = None
    if isinstance(fault, PlatformFault):
        toll = toll_of(job, fault)
        changes |= toll.columns() | {"failed_at": now}
        if waits_for_storage(fault):
            changes["attempt"] = F("attempt") - 1
        else:
            pause = toll.pause
    if final is not None and verdict(job) is None:
        pause = None
        changes |= {"reason_code": final.code, "reason_params": final.params, "failures": 0, "kills": 0}
    elif final is not None and fault.code in _MISTAKES:
        changes["kills"] = job.kills + 1
    if again:
        not_before = now + pause if pause else None
        requeued = mine.update(state=JobState.QUEUED, started_at=None, progress={}, not_before=not_before, **changes)
        if requeued and not pause:
            ring_training_bell()
        return bool(requeued)
    failed = mine.update(state=JobState.FAILED, ended_because=EndReason.FAILED, ended_at=now, **changes)
    if failed:
        record_end(job.pk, now)
        drop_checkpoints(job)
    return bool(failed)


def _what_next(job: TrainingJob, fault: PaddockError) -> tuple[PaddockError | None, bool]:
    """What the training ends with, None if it goes on; and whether a worker has yet to take it on."""
    known = verdict(job)
    if known is not None:
        mistakes = job.kills + (fault.code in _MISTAKES)
        return known, isinstance(fault, PlatformFault) and mistakes < KEEPINGS_TRIED
    final = last_word(job, fault)
    return final, final is None or Checkpoint.objects.filter(job=job).exclude(networks="").exists()
