"""A kind of job, and how its jobs are claimed, renewed, released and finished."""

import logging
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Generic, TypeVar

from django.conf import settings
from django.db import transaction
from django.db.models import F, Q, QuerySet

from ..database.clock import database_now
from ..wakeups.streams import poke, poke_after_commit
from ..wakeups.workers import wake
from .heartbeat import Heartbeat
from .holds import hold_of, not_held
from .models import Leased
from .outages import STORAGE, ended_outage, is_out

logger = logging.getLogger(__name__)
CANDIDATES = 16  # looked at by one claim at once: as many workers may reach for the first
COUNTED = 1000  # a sweep counts no more than so many that wait
J = TypeVar("J", bound=Leased)
Row = TypeVar("Row", bound="JobKind[Any]")


@dataclass(frozen=True)
class SweepReport:
    """Expired leases that a sweep found, and the jobs that wait and are due (at most :data:`COUNTED`)."""

    requeued: int = 0
    waiting: int = 0


class JobKind(Generic[J]):
    """One kind of job: attributes and methods that a subclass overrides.

    ``task``: the task that wakes a worker, in the broker's ``queue``; ``order``: of waiting jobs; ``since``: the column
    with the start of the wait; ``awaited``: the jobs that somebody waits for; ``related``: of a claimed one; ``blank``:
    columns that a new attempt resets; ``wakes``: most workers woken by a sweep; ``needs``: parts that must not be out
    (:mod:`core.jobs.outages`); ``beat_s``: seconds between heartbeats with progress."""

    name: str
    model: type[J]
    task: str
    queue: str
    waiting: str = "queued"
    working: str = "running"
    finished: str = "finished"
    failed: str = "failed"
    order: Sequence[str] = ("pk",)
    since: str
    awaited = Q()
    related: Sequence[str] = ()
    blank: dict[str, object] = {}
    wakes = 1
    needs: Sequence[str] = (STORAGE,)
    beat_s = 1.0

    @property
    def lease(self) -> timedelta:
        """How long a claim lasts without a heartbeat."""
        return timedelta(seconds=settings.LEASE_SECONDS)

    # --- which ones

    def free(self, now: datetime) -> QuerySet[J]:
        """Those that wait and do not pause, unordered: what a claim makes sure of."""
        return self.model._base_manager.filter(
            Q(not_before=None) | Q(not_before__lte=now), state=self.waiting
        ).order_by()

    def due(self, now: datetime) -> QuerySet[J]:
        """Those of them that would be claimed now, unordered."""
        return self.free(now)

    def held(self, pk: int, lease: uuid.UUID | None) -> QuerySet[J]:
        """The job while this lease is good: one row or none."""
        return self.model._base_manager.filter(pk=pk, state=self.working, lease=lease)

    def under_way(self, pk: int) -> QuerySet[J]:
        """The job while it waits or is being done: one row or none."""
        return self.model._base_manager.filter(pk=pk, state__in=(self.waiting, self.working))

    def next_in_queue(self, now: datetime) -> Sequence[tuple[int, int]]:
        """``(id, attempt)`` of those that are claimed next, in their order: a few of them are enough."""
        return list(self.due(now).order_by(*self.order).values_list("pk", "attempt")[:CANDIDATES])

    # --- what each kind may do besides

    def prepare(self, now: datetime) -> None:
        """Before anybody looks for what is due."""

    def tidy(self, now: datetime) -> None:
        """A part of every sweep."""

    def lost(self, mine: QuerySet[J], job: J, now: datetime) -> bool:
        """Handle the loss of a job's worker (``mine``: one row or none). Returns whether the job was changed."""
        return self.put_back(mine, now=now)

    def began(self, job: J, now: datetime) -> None:
        """In the transaction in which a job is claimed."""

    def released(self, job: J, now: datetime) -> Mapping[str, object]:
        """More columns of a job that is handed back."""
        return {}

    # --- claim, heartbeat, end

    def claim(self, *, worker: str, now: datetime) -> J | None:
        """Take the next job under a new lease. None when nothing is due, while a needed part is out, and for a worker
        that is held."""
        if is_out(*self.needs):
            return None
        self.prepare(now)
        for _ in range(CANDIDATES):  # a lost race means that somebody else won it: nobody loses so many
            following = self.next_in_queue(now)
            for pk, attempt in following:
                job = self.take(pk, attempt, worker=worker, now=now)
                if job is not None:
                    return job
                if hold_of(worker[:128]):  # asked only now: most claims succeed
                    return None
            if not following:
                break
        return None

    @transaction.atomic
    def take(self, pk: int, attempt: int, *, worker: str, now: datetime) -> J | None:
        """Claim this one, unless somebody else has since it was seen to wait, or the worker is held."""
        lease = uuid.uuid4()
        claimed = (
            self.free(now)
            .filter(not_held(worker[:128]), pk=pk, attempt=attempt)
            .update(
                state=self.working,
                lease=lease,
                leased_until=now + self.lease,
                worker=worker[:128],
                attempt=F("attempt") + 1,
                started_at=now,
                not_before=None,
                **self.blank,
            )
        )
        # by its lease: if it was stopped or taken over in this very moment, it is not ours to do
        job = self.held(pk, lease).select_related(*self.related).first() if claimed else None
        if job is not None:
            self.began(job, now)
            poke_after_commit(self.topics(job))
        return job

    def beat(self, *, pk: int, lease: uuid.UUID, progress: Any | None = None, now: datetime) -> bool:
        """Prolong a lease, and write the progress unless it is None. False: the lease is gone, stop at once."""
        columns = {} if progress is None else self.progress_columns(progress)
        return bool(self.held(pk, lease).update(leased_until=now + self.lease, **columns))

    def progress_columns(self, progress: Any) -> dict[str, object]:
        """The columns that tell of a progress."""
        return {"progress": progress}

    def topics(self, job: J) -> tuple[str, ...]:
        """What moves on the stream (:mod:`core.streams`) when the job gets on without an event."""
        return ()

    def heartbeat(self, job: J) -> Heartbeat:
        """What holds the lease of a claimed job."""

        def beat(progress: Any | None) -> bool:
            assert job.lease is not None
            held = self.beat(pk=job.pk, lease=job.lease, progress=progress, now=database_now())
            if held and progress is not None:
                poke(self.topics(job))
            return held

        return Heartbeat(f"{self.name} {job}", beat, lease=self.lease, every_s=self.beat_s)

    def end(self, rows: QuerySet[J], *, state: str, now: datetime, **columns: Any) -> bool:
        """Make those of ``rows`` final (one or none), with more columns. False: there was none."""
        return bool(rows.update(state=state, lease=None, leased_until=None, not_before=None, ended_at=now, **columns))

    def put_back(self, mine: QuerySet[J], *, now: datetime, pause: timedelta | None = None, **columns: Any) -> bool:
        """Let ``mine`` (one row or none) wait again in its place, after a pause or at once. False: there was none."""
        none = dict.fromkeys(("lease", "leased_until", "started_at"))
        wait = {"state": self.waiting, "not_before": now + pause if pause else None}
        back = mine.update(**(none | wait | self.blank | columns))
        if back and not pause:
            self.wake()
        return bool(back)

    def release(self, *, pk: int, lease: uuid.UUID, now: datetime) -> bool:
        """Hand a job back unfinished because its worker is shutting down. It keeps its place; no attempt counts."""
        mine = self.held(pk, lease)
        job = mine.first()
        if job is None:
            return False
        return self.put_back(mine, now=now, pause=None, attempt=F("attempt") - 1, **self.released(job, now))

    # --- sweep and wake-up

    def sweep(self, *, now: datetime, wake: bool = True) -> SweepReport:
        """Requeue jobs with expired leases, probe parts that were out, and wake workers for jobs that are due.

        A job that cannot be requeued does not stop the sweep. ``wake=False``: the caller looks at the queue itself."""
        leased = self.model._base_manager.filter(state=self.working)
        # the clock was set back: a living worker's next beat prolongs the lease, a dead one's ends in time
        leased.filter(leased_until__gt=now + 2 * self.lease).update(leased_until=now + self.lease)
        expired = leased.filter(leased_until__lt=now)
        requeued = sum(self._take_back(job, now) for job in expired.order_by("leased_until"))
        end_outages(*self.needs, now=now)
        self.prepare(now)
        self.tidy(now)
        waiting = 0 if is_out(*self.needs) else len(self.due(now).values_list("pk", flat=True)[:COUNTED])
        if waiting and wake:
            self.wake(times=min(waiting, self.wakes))
        return SweepReport(requeued, waiting)

    def _take_back(self, job: J, now: datetime) -> bool:
        mine = self.held(job.pk, job.lease).filter(leased_until__lt=now)
        try:
            return self.lost(mine, job, now)
        except Exception as error:  # of whatever hears of an end: the others wait for nobody
            logger.error("%s %s cannot be ended.", self.name, job, exc_info=error)
            return False

    def wake(self, *, times: int = 1) -> None:
        """Wake up to ``times`` workers once the current transaction is committed."""
        wake(self.task, times=times, queue=self.queue)

    def end_pauses(self, *, since: datetime) -> None:
        """What has failed by us ``since`` then is due at once."""


_KINDS: dict[str, JobKind[Any]] = {}


def register(kind: Row) -> Row:
    """Note a kind: the breaker and the tests' contract reach all there are. Registering one twice changes nothing."""
    _KINDS[kind.name] = kind
    return kind


def all_kinds() -> list[JobKind[Any]]:
    return [_KINDS[name] for name in sorted(_KINDS)]


def end_outages(*parts: str, now: datetime) -> None:
    """End the pauses of all jobs that a part stopped, once the part is back."""
    ended = ended_outage(*parts, now=now)
    if ended is not None:
        part, since = ended
        for kind in all_kinds():
            if part in kind.needs:
                kind.end_pauses(since=since)
