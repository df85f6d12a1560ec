"""What an attempt costs: seconds of the trainer by the database's clock, and how often the platform's faults are borne.

Seconds run from the claim to the end, whatever ended it. Only what was taken away from outside of the sandbox, which no
reward function brings about, costs no more than what its last checkpoint has kept.

After a fault of ours a training waits to go on, with pauses that grow while it gets no further, for as long as it
takes. It is given up where its own process said again and again that it failed, without getting further: as its
writer's fault where the reward function is theirs; else as ours, if others passed meanwhile.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import datetime, timedelta

from django.conf import settings

from core.jobs.outages import waits_for_storage
from core.jobs.retried import pause_after
from paddock.errors import PaddockError, PlatformFault, UserFault

from ..models import Checkpoint, JobState, TrainingJob
from ..rewards.examples import EXAMPLES

# What its own process says of itself; everything else is beyond the reach of a stranger's code.
_FROM_INSIDE = ("trainer_error", "trainer_protocol")
_OUR_CODE = frozenset(example.code.strip() for example in EXAMPLES)


@dataclass(frozen=True)
class Toll:
    """Columns of a training: ``failures`` and ``kills`` in a row, since it got further than ``got_to``, an iteration.

    ``failures``: faults of ours, after which it pauses; ``kills``: those of them that its own process told of.
    """

    failures: int
    kills: int
    got_to: int

    def columns(self) -> dict[str, int]:
        return asdict(self)

    @property
    def pause(self) -> timedelta:
        """How long it waits until it is tried again."""
        return pause_after(self.failures)


def toll_of(job: TrainingJob, fault: PlatformFault) -> Toll:
    """What stands with the training after this fault of its present attempt."""
    if waits_for_storage(fault):
        return Toll(job.failures, job.kills, job.got_to)
    newest = _newest(job)
    reached = newest.iteration if newest is not None else 0
    further = reached > job.got_to
    failures, kills = (0, 0) if further else (job.failures, job.kills)
    counts = fault.code in _FROM_INSIDE and (not _runs_our_code(job) or _others_pass(job))
    return Toll(failures + 1, kills + counts, max(reached, job.got_to))


def last_word(job: TrainingJob, fault: PaddockError) -> PaddockError | None:
    """What a training ends with after this fault of this attempt; None: it goes on from its last checkpoint."""
    if not isinstance(fault, PlatformFault):
        return fault
    kills = toll_of(job, fault).kills
    if kills < settings.EVALUATION_MAX_ATTEMPTS:
        return None
    if not _runs_our_code(job):
        how = fault.params.get("detail") or fault.params.get("how", "")
        return UserFault("training_broke_down", attempts=kills, how=how)
    return PlatformFault("training_gave_up", attempts=kills)


def charge(job: TrainingJob, until: datetime, fault: PaddockError | None = None) -> float:
    """``charged_s`` after an attempt that ended at ``until``, by ``fault`` or in good order. Read the job under its
    lease."""
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
    """Whether another training came to its end since this one was queued or last failed."""
    passed = TrainingJob.objects.filter(state__in=(JobState.FINISHED, JobState.STOPPED), steps_done__gt=0)
    return passed.exclude(pk=job.pk).filter(ended_at__gte=job.failed_at or job.created_at).exists()
