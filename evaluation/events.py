"""What happens to a run, as events. Of a sealed one nothing is told until it is unsealed."""

from __future__ import annotations

from datetime import datetime

from core.events import EventKind, record, register

from .models import Evaluation, Result, State

# Who may see the run. What that means is said by the room that knows races.
RUN = "run"

RUN_QUEUED = register(EventKind("run.queued", "a run waits in the queue", RUN, ("racer", "subject")))
RUN_STARTED = register(EventKind("run.started", "a worker has taken a run", RUN, ("racer", "subject"), ("attempt",)))
RUN_FINISHED = register(
    EventKind("run.finished", "a run has a result", RUN, ("racer", "subject"), ("best_lap_ms", "total_ms"))
)
RUN_FAILED = register(EventKind("run.failed", "a run ended without a result", RUN, ("racer", "subject"), ("reason",)))
RUN_STOPPED = register(EventKind("run.stopped", "a run was stopped", RUN, ("racer", "subject")))


def record_queued(evaluation: Evaluation, now: datetime) -> None:
    """The run is in the queue. Call it in the transaction that puts it there."""
    if not evaluation.sealed:
        record(RUN_QUEUED, at=now, **_whose(evaluation))


def record_start(evaluation: Evaluation, now: datetime) -> None:
    """A worker has claimed the run. Call it in the transaction that claims it."""
    if not evaluation.sealed:
        record(RUN_STARTED, at=now, **_whose(evaluation), attempt=evaluation.attempt)


def record_end(evaluation: Evaluation, result: Result | None, now: datetime) -> None:
    """The run is final, with a result or without. Call it in the transaction that ends it."""
    if evaluation.sealed:
        return
    whose = _whose(evaluation)
    if result is not None:
        record(RUN_FINISHED, at=now, **whose, best_lap_ms=result.best_lap_ms, total_ms=result.total_ms)
    elif evaluation.state == State.STOPPED:
        record(RUN_STOPPED, at=now, **whose)
    else:
        record(RUN_FAILED, at=now, **whose, reason=evaluation.reason_code)


def _whose(evaluation: Evaluation) -> dict:
    return {"racer": evaluation.owner_id, "subject": evaluation.public_id}
