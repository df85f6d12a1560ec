"""The events of runs, and the stream topic of the queue. A sealed run records none until it is unsealed."""

from collections.abc import Sequence
from datetime import datetime

from core.events import Event, EventKind, record, register
from core.streams import Topic, register_moves, register_topic

from ..models import Evaluation, Result, State

RUN_QUEUED = register(EventKind("run.queued", "a run was queued", ("racer", "subject")))
RUN_STARTED = register(EventKind("run.started", "a worker has started a run", ("racer", "subject"), ("attempt",)))
RUN_FINISHED = register(
    EventKind("run.finished", "a run has a result", ("racer", "subject"), ("best_lap_ms", "total_ms"))
)
RUN_FAILED = register(EventKind("run.failed", "a run ended without a result", ("racer", "subject"), ("reason",)))
RUN_STOPPED = register(EventKind("run.stopped", "a run was stopped", ("racer", "subject")))


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


QUEUE = "queue"  # places in the queue of runs may have changed; the message names no run
_MOVE_IT = {kind.name for kind in (RUN_QUEUED, RUN_STARTED, RUN_FINISHED, RUN_FAILED, RUN_STOPPED)}


def register_streams() -> None:
    """Register the topic ``queue``, which everybody may follow."""
    register_topic(Topic(QUEUE, lambda viewer, key: not key))
    register_moves(moves)


def moves(events: Sequence[Event]) -> dict[int, set[str]]:
    return {event.pk: {QUEUE} for event in events if event.kind in _MOVE_IT}
