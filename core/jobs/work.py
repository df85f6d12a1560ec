"""A worker's turns: claim a job, do it under a heartbeat, write down how it ended."""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable
from time import monotonic
from typing import Any, TypeVar

from paddock.errors import PaddockError, PlatformFault, UserFault

from ..clock import database_now
from ..storage_faults import is_of_storage
from .heartbeat import Heartbeat
from .kinds import JobKind
from .models import Job
from .outages import note_fault
from .retried import RetriedKind
from .stopping import shutdown_flag

logger = logging.getLogger(__name__)
Told = Callable[[], bool]
J = TypeVar("J", bound=Job)


def never() -> bool:
    """Nobody is told to shut down."""
    return False


def run_next(
    kind: RetriedKind[J], do: Callable[[J, Heartbeat], bool], *, worker: str, interrupted: Told = never
) -> bool:
    """Do the job whose turn it is to its end. False: nothing waits.

    ``do`` does it and writes down that it is done, False if the lease was gone; what it raises becomes the job's fault.
    ``interrupted`` turns true when the worker is told to shut down: the job is then handed back.
    """
    job = kind.claim(worker=worker, now=database_now())
    if job is None:
        return False
    assert job.lease is not None
    logger.info("%s %s attempt %s starts.", kind.name, job, job.attempt)
    with kind.heartbeat(job) as heartbeat:
        try:
            ended, how = do(job, heartbeat), "ended"
        except Exception as error:
            if not heartbeat.lost and interrupted():
                ended = kind.release(pk=job.pk, lease=job.lease, now=database_now())
                how = "was handed back"
            else:
                # what we stopped because the database was away for too long is no fault of the job
                fault, detail = fault_of(PlatformFault(kind.lost_code) if heartbeat.lost else error)
                note_fault(fault, now=database_now())
                ended = kind.fail(pk=job.pk, lease=job.lease, fault=fault, now=database_now(), detail=detail)
                how = f"failed: {fault.code}"
    logger.info("%s %s %s.", kind.name, job, how if ended else "was stopped or given to somebody else")
    return True


def work_off(
    kind: JobKind[Any],
    turn: Callable[[Told], bool],
    *,
    budget_s: float = 0.0,
    idle: Callable[[], object] | None = None,
) -> int:
    """Take turns until one finds nothing to do, the worker is told to stop, or ``budget_s`` seconds are over; then
    wake the next, since more may wait. How many turns did something.

    ``turn`` gets what tells whether to stop; ``idle`` is called at the end unless it was told.
    """
    kind.sweep(now=database_now(), wake=False)
    started, count = monotonic(), 0
    with shutdown_flag() as told_to_stop:
        while not told_to_stop() and turn(told_to_stop):
            count += 1
            if monotonic() - started >= budget_s and not told_to_stop():
                kind.wake()
                break
        if idle is not None and not told_to_stop():
            idle()
    return count


def fault_of(error: Exception) -> tuple[PaddockError, str]:
    """The fault to record for whatever was raised, and what operators read about it."""
    if isinstance(error, UserFault):
        return error, "\n".join(getattr(error, "__notes__", ()))
    code = "storage_failed" if is_of_storage(error) else "internal_error"
    fault = error if isinstance(error, PlatformFault) else PlatformFault(code)
    return fault, "".join(traceback.format_exception(error))
