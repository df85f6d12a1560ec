"""Kinds whose jobs fail at once by a racer's fault and are retried after the platform's."""

import logging
import uuid
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any, TypeVar

from django.conf import settings
from django.db import transaction
from django.db.models import F, QuerySet, Value
from django.db.models.functions import Concat, Right

from paddock.errors import PaddockError, PlatformFault, UserFault

from ..metrics import Counter
from .kinds import JobKind
from .models import Job
from .outages import waits_for_storage

logger = logging.getLogger(__name__)
DETAIL_LIMIT, DETAILS_LIMIT = 4000, 20_000
FIRST_PAUSE, LONGEST_PAUSE = timedelta(seconds=4), timedelta(hours=1)
R = TypeVar("R", bound=Job)
FAULTS = Counter(
    "paddock_job_faults_total",
    "Failed attempts of jobs, by the kind of the job, the code of the reason, whose fault it is (user, platform) and"
    " what follows (failed, retried).",
    ("kind", "reason", "fault", "then"),
)


def pause_after(attempts: int) -> timedelta:
    """How long a job waits after so many attempts: none after the first, then 4, 16, 64 s and so on to an hour."""
    return timedelta(0) if attempts < 2 else min(FIRST_PAUSE * 4 ** min(attempts - 2, 10), LONGEST_PAUSE)


def detail_with(detail: str, head: str = "") -> Right:
    """An expression: ``operator_detail`` with one more note, cut to the newest :data:`DETAILS_LIMIT` characters."""
    note = f"{head} {detail.strip()[-DETAIL_LIMIT:]}".strip() + "\n"
    return Right(Concat("operator_detail", Value(note)), DETAILS_LIMIT)


@dataclass(frozen=True)
class Verdict:
    """The consequence of a fault: the job ends with ``fault``, or (None) waits for ``pause``. ``columns``: more to
    write."""

    fault: PaddockError | None = None
    pause: timedelta | None = None
    columns: dict[str, object] = field(default_factory=dict)


class RetriedKind(JobKind[R]):
    """A kind whose jobs end by a fault.

    ``lost_code``: a lost worker's fault; ``alone``: codes that may be a job's own doing, which ends with
    ``gave_up_code`` after ``EVALUATION_MAX_ATTEMPTS`` of them while others passed; ``storage_counts``: whether outages
    of the storage count."""

    lost_code: str
    alone: frozenset[str] = frozenset()
    gave_up_code: str
    storage_counts = False

    def fails_alone(self, job: R, fault: PaddockError) -> bool:
        """Whether this fault may be the job's own doing."""
        return fault.code in self.alone and self.others_passed(job)

    def others_passed(self, job: R) -> bool:
        """Whether another job finished since this one was queued or last failed."""
        return False

    def gave_up(self, job: R, now: datetime) -> None:
        """In the transaction in which a job has ended by a fault. ``job``: how it was read before."""

    def clean_up(self, job: R) -> None:
        """After a lost worker's job was put back or ended: what it may have left behind."""

    def after(self, job: R, fault: PaddockError, now: datetime) -> Verdict:
        """What becomes of a job after this fault of its present attempt."""
        if isinstance(fault, UserFault):
            return Verdict(fault)
        if not self.storage_counts and waits_for_storage(fault):
            return Verdict(columns={"attempt": F("attempt") - 1})
        kills = job.kills + self.fails_alone(job, fault)
        if job.kills < kills >= settings.EVALUATION_MAX_ATTEMPTS:
            return Verdict(PlatformFault(self.gave_up_code, attempts=kills), columns={"kills": kills})
        return Verdict(pause=pause_after(job.attempt), columns={"kills": kills})

    # --- what follows a fault

    def fail(self, *, pk: int, lease: uuid.UUID, fault: PaddockError, now: datetime, detail: str = "") -> bool:
        """End a failed attempt as :meth:`after` decides. Returns False if the lease is gone."""
        mine = self.held(pk, lease)
        job = mine.first()
        return job is not None and self._fail(mine, job, fault, now, detail)

    def lost(self, mine: QuerySet[R], job: R, now: datetime) -> bool:
        """A worker that disappeared is a fault of ours."""
        if not self._fail(mine, job, PlatformFault(self.lost_code), now, f"worker {job.worker}"):
            return False
        self.clean_up(job)
        return True

    @transaction.atomic
    def _fail(self, mine: QuerySet[R], job: R, fault: PaddockError, now: datetime, detail: str) -> bool:
        ours = isinstance(fault, PlatformFault)
        verdict = self.after(job, fault, now)
        columns = dict(verdict.columns)
        if ours:
            columns["failed_at"] = now
            logger.warning("%s %s, attempt %s: %s. %s", self.name, job, job.attempt, fault.code, detail)
        if ours or detail:
            columns["operator_detail"] = detail_with(detail, f"Attempt {job.attempt}: {fault.code}.")
        final = verdict.fault
        if final is None:
            changed = self.put_back(mine, now=now, pause=verdict.pause, **columns)
        else:
            columns |= {"reason_code": final.code, "reason_params": final.params}
            changed = self.end(mine, state=self.failed, now=now, **columns)
            if changed:
                self.gave_up(job, now)
        if changed:
            then = "retried" if final is None else "failed"
            FAULTS.inc(self.name.lower(), fault.code, "platform" if ours else "user", then)
        return changed

    # --- by hand

    def begin_anew(self, rows: QuerySet[R], **columns: Any) -> bool:
        """Requeue the ended one of ``rows`` as new. Returns False for none."""
        none = dict.fromkeys(("failed_at", "not_before", "started_at", "ended_at"))
        fresh = {"state": self.waiting, "attempt": 0, "kills": 0, "worker": "", "reason_code": "", "reason_params": {}}
        again = rows.update(**(none | fresh | self.blank | columns))
        if again:
            self.wake()
        return bool(again)

    def end_pauses(self, *, since: datetime) -> None:
        """What has failed by us ``since`` then is due at once."""
        waiting = self.model._base_manager.filter(state=self.waiting)
        waiting.filter(failed_at__gte=since, not_before__isnull=False).update(not_before=None)
