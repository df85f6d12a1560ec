"""Seconds and platform faults charged to an attempt of a training.

Seconds run from the claim to the end of the attempt. An attempt that ended for a cause outside the sandbox costs only
the seconds up to its last checkpoint.

After a platform fault a training resumes without limit, after growing pauses while it makes no progress. It is given up
if its own process reports failures repeatedly without progress: as the racer's fault if the reward function is theirs,
otherwise as the platform's if other trainings passed meanwhile.
"""

from datetime import datetime
from typing import NamedTuple

from django.conf import settings

from core.jobs.outages import waits_for_storage
from paddock.errors import PaddockError, PlatformFault, UserFault

from ...models import Checkpoint, JobState, TrainingJob
from ...rewards.examples import EXAMPLES

# Reported by the sandboxed process itself; a racer's code cannot cause the other codes.
_FROM_INSIDE = ("trainer_error", "trainer_protocol")
_OUR_CODE = frozenset(example.code.strip() for example in EXAMPLES)


class FaultCount(NamedTuple):
    """Columns of a training: ``failures`` and ``kills`` in a row since it passed iteration ``got_to``.

    ``failures``: platform faults, each followed by a pause; ``kills``: those reported by its own process.
    """

    failures: int
    kills: int
    got_to: int


def count_fault(job: TrainingJob, fault: PlatformFault) -> FaultCount:
    if waits_for_storage(fault):
        return FaultCount(job.failures, job.kills, job.got_to)
    newest = _newest(job)
    reached = newest.iteration if newest is not None else 0
    further = reached > job.got_to
    failures, kills = (0, 0) if further else (job.failures, job.kills)
    counts = fault.code in _FROM_INSIDE and (not _runs_our_code(job) or _others_pass(job))
    return FaultCount(failures + 1, kills + counts, max(reached, job.got_to))


def final_fault(job: TrainingJob, fault: PaddockError) -> PaddockError | None:
    """What a training ends with after this fault of this attempt; None: it goes on from its last checkpoint."""
    if not isinstance(fault, PlatformFault):
        return fault
    kills = count_fault(job, fault).kills
    if kills < settings.EVALUATION_MAX_ATTEMPTS:
        return None
    if not _runs_our_code(job):
        how = fault.params.get("detail") or fault.params.get("how", "")
        return UserFault("training_broke_down", attempts=kills, how=how)
    return PlatformFault("training_gave_up", attempts=kills)


def charge(job: TrainingJob, until: datetime, fault: PaddockError | None = None) -> float:
    """``charged_s`` after an attempt that ended at ``until``, by ``fault`` or without. Read the job under its lease."""
    held_s = max(0.0, (until - job.started_at).total_seconds()) if job.started_at is not None else 0.0
    total = job.charged_s + held_s
    if not isinstance(fault, PlatformFault) or fault.code in _FROM_INSIDE:
        return total
    newest = _newest(job)
    kept = newest.seconds if newest is not None else 0.0
    return min(total, max(job.charged_s, kept))


def _newest(job: TrainingJob) -> Checkpoint | None:
    return Checkpoint.objects.filter(job=job).order_by("-iteration").only("iteration", "seconds").first()


def _runs_our_code(job: TrainingJob) -> bool:
    return job.reward_code.strip() in _OUR_CODE


def _others_pass(job: TrainingJob) -> bool:
    passed = TrainingJob.objects.filter(state__in=(JobState.FINISHED, JobState.STOPPED), steps_done__gt=0)
    return passed.exclude(pk=job.pk).filter(ended_at__gte=job.failed_at or job.created_at).exists()
