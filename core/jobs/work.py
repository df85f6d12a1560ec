"""The loop of a worker: claim a job, run it with a heartbeat, store its result."""

import logging
import traceback
from collections.abc import Callable
from time import monotonic
from typing import Any, TypeVar

from paddock.errors import PaddockError, PlatformFault, UserFault

from ..database.clock import database_now
from ..files.storage_faults import is_of_storage
from ..logs.filters import is_outage_of_database
from ..logs.lines import job_in_log
from ..metrics import Histogram
from .heartbeat import Heartbeat
from .kinds import JobKind
from .models import Job
from .outages import note_fault
from .retried import RetriedKind

logger = logging.getLogger(__name__)
StopCheck = Callable[[], bool]
SECONDS = Histogram(
    "paddock_job_seconds",
    "Time of an attempt of a job, by its kind and how it ended: ended, failed, back (handed back), lost.",
    ("kind", "end"),
    buckets=(0.5, 1, 2, 5, 10, 30, 60, 300, 1800, 7200),
)
J = TypeVar("J", bound=Job)


def never() -> bool:
    """The check of a worker that is never stopped."""
    return False


def run_next(
    kind: RetriedKind[J], do: Callable[[J, Heartbeat], bool], *, worker: str, interrupted: StopCheck = never
) -> bool:
    """Run the next job to its end. Returns False when nothing is due.

    ``do`` runs it, stores its result and returns whether the lease was valid; an exception becomes the job's fault.
    ``interrupted``: whether the worker shuts down, which requeues the job."""
    job = kind.claim(worker=worker, now=database_now())
    if job is None:
        return False
    with job_in_log(f"{kind.name.lower()}:{getattr(job, 'public_id', job.pk)}", job.request_id):
        _run(kind, job, do, interrupted)
    return True


def _run(kind: RetriedKind[J], job: J, do: Callable[[J, Heartbeat], bool], interrupted: StopCheck) -> None:
    assert job.lease is not None
    logger.info("%s %s attempt %s starts.", kind.name, job, job.attempt)
    began = monotonic()
    with kind.heartbeat(job) as heartbeat:
        try:
            ended, end, how = do(job, heartbeat), "ended", "ended"
        except Exception as error:
            if not heartbeat.lost and interrupted():
                ended = kind.release(pk=job.pk, lease=job.lease, now=database_now())
                end, how = "back", "was handed back"
            else:
                # what a database ended that was away, or full, is no fault of the job
                if heartbeat.lost or is_outage_of_database(error):
                    lost = PlatformFault(kind.lost_code)
                    lost.__cause__ = error
                    error = lost
                fault, detail = fault_of(error)
                note_fault(fault, now=database_now())
                ended = kind.fail(pk=job.pk, lease=job.lease, fault=fault, now=database_now(), detail=detail)
                end, how = "failed", f"failed: {fault.code}"
    SECONDS.observe(monotonic() - began, kind.name.lower(), end if ended else "lost")
    logger.info("%s %s %s.", kind.name, job, how if ended else "was stopped or given to somebody else")


def work_off(
    kind: JobKind[Any],
    turn: Callable[[StopCheck], bool],
    *,
    budget_s: float = 0.0,
    idle: Callable[[], object] | None = None,
) -> int:
    """Take turns until nothing is left, the worker stops or ``budget_s`` is over; then wake another worker. Returns the
    number of turns.

    ``turn`` gets the check for a stop; ``idle`` is called at the end unless the worker stops."""
    from .stopping import shutdown_flag  # needs Celery

    kind.sweep(now=database_now(), wake=False)
    started, count = monotonic(), 0
    with shutdown_flag() as must_stop:
        while not must_stop() and turn(must_stop):
            count += 1
            if monotonic() - started >= budget_s and not must_stop():
                kind.wake()
                break
        if idle is not None and not must_stop():
            idle()
    return count


def fault_of(error: Exception) -> tuple[PaddockError, str]:
    """The fault to record for whatever was raised, and what operators read about it."""
    if isinstance(error, UserFault):
        return error, "\n".join(getattr(error, "__notes__", ()))
    code = "storage_failed" if is_of_storage(error) else "internal_error"
    fault = error if isinstance(error, PlatformFault) else PlatformFault(code)
    return fault, "".join(traceback.format_exception(error))
