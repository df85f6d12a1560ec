"""Claiming, holding and ending an evaluation.

Every write is one guarded UPDATE that changes one row or none: the row's lease is a fencing token, and whoever does not
hold it any more changes nothing. Nothing here needs row locks, so SQLite and PostgreSQL behave alike.
"""

from __future__ import annotations

import logging
import uuid
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

from django.conf import settings
from django.db import transaction
from django.db.models import F, QuerySet, Value
from django.db.models.functions import Concat, Right

from paddock.errors import PaddockError, PlatformFault

from ..events import record_end, record_start
from ..line import FRONT, next_in_line, queued
from ..models import Evaluation, Result, State
from ..signals import evaluation_ended
from .bell import BELLS_AT_ONCE, ring_bell
from .outages import look_after_storage, storage_is_out
from .results import delete_files, file_names, store_files, write_result
from .turns import put_in_turn

if TYPE_CHECKING:
    from ..pipeline import EvaluationOutcome

logger = logging.getLogger(__name__)
DETAIL_LIMIT, DETAILS_LIMIT = 4000, 20_000
FIRST_PAUSE, LONGEST_PAUSE = timedelta(seconds=4), timedelta(hours=1)
CANDIDATES = 16  # looked at by one claim at once: as many workers may reach for the first
# The simulator's process ended under a car, and its worker lived to tell.
KILLS = frozenset(("runner_died", "runner_error", "runner_protocol", "runner_timeout"))


def pause_after(attempts: int) -> timedelta:
    """How long a run waits after so many attempts: none after the first, then 4, 16, 64 s and so on to an hour."""
    return timedelta(0) if attempts < 2 else min(FIRST_PAUSE * 4 ** min(attempts - 2, 10), LONGEST_PAUSE)


def detail_with(note: str) -> Right:
    """The column ``operator_detail`` with one more note, as an expression. The newest 20,000 characters are kept: what
    is tried for as long as it takes has no end of them."""
    return Right(Concat("operator_detail", Value(note.strip() + "\n")), DETAILS_LIMIT)


def claim_next_evaluation(*, worker: str, now: datetime) -> Evaluation | None:
    """Take the evaluation whose turn it is (:mod:`evaluation.line`) under a new lease.

    None when nothing waits, when all that waits pauses, and while the storage is out: every car would fail alike.
    """
    if storage_is_out():
        return None
    _end_pauses(now)
    while candidates := next_in_line(CANDIDATES):
        for pk, attempt in candidates:
            evaluation = _claim(pk, attempt, worker, now)
            if evaluation is not None:
                return evaluation
    return None  # a lost race means that somebody else won it, so this loop ends


@transaction.atomic
def _claim(pk: int, attempt: int, worker: str, now: datetime) -> Evaluation | None:
    lease = uuid.uuid4()
    mine = Evaluation.objects.filter(pk=pk, state=State.QUEUED, not_before=None, attempt=attempt)
    claimed = mine.update(
        state=State.RUNNING,
        lease=lease,
        leased_until=now + timedelta(seconds=settings.LEASE_SECONDS),
        worker=worker[:128],
        attempt=F("attempt") + 1,
        started_at=now,
        not_before=None,
        progress={},
    )
    # by its lease: if it was stopped or taken over in this very moment, it is not ours to run
    evaluation = _held(pk, lease).select_related("model__network", "track").first() if claimed else None
    if evaluation is not None:
        record_start(evaluation, now)
    return evaluation


def beat(*, evaluation_id: int, lease: uuid.UUID, progress: dict | None, now: datetime) -> bool:
    """Prolong a lease, and write the progress unless it is None. False: the lease is gone, stop at once."""
    changes: dict = {"leased_until": now + timedelta(seconds=settings.LEASE_SECONDS)}
    if progress is not None:
        changes["progress"] = progress
    return bool(_held(evaluation_id, lease).update(**changes))


def finish_evaluation(*, evaluation_id: int, lease: uuid.UUID, outcome: EvaluationOutcome, now: datetime) -> bool:
    """Write the result, once, with everything that receivers of ``evaluation_ended`` write. False: the lease is gone.

    The files of the run are stored before the transaction, under names of this lease alone, and deleted again when
    the transaction does not go through.
    """
    evaluation = _held(evaluation_id, lease).first()
    if evaluation is None:
        return False
    files = store_files(evaluation, outcome)
    try:
        with transaction.atomic():
            finished = _held(evaluation_id, lease).update(
                state=State.FINISHED, lease=None, leased_until=None, ended_at=now, reason_code="", reason_params={}
            )
            if finished:
                result = write_result(evaluation_id, lease, outcome, files, now)
                _tell(evaluation_id, result, now)
    except BaseException:
        files.delete()
        raise
    if not finished:
        files.delete()
    return bool(finished)


def fail_evaluation(
    *, evaluation_id: int, lease: uuid.UUID, fault: PaddockError, now: datetime, detail: str = ""
) -> bool:
    """End an attempt that failed. False: the lease is gone.

    A user's fault is final at once. After a platform's fault the evaluation goes back to its place in the queue, to be
    tried after pauses that grow (:func:`pause_after`) for as long as it takes. Only a car whose simulator ended
    ``EVALUATION_MAX_ATTEMPTS`` times (:data:`KILLS`), while others passed between each time and the one before, fails
    with ``platform_gave_up``. ``detail`` is for operators.
    """
    evaluation = _held(evaluation_id, lease).first()
    return evaluation is not None and _fail(_held(evaluation_id, lease), evaluation, fault, now, detail)


def release_evaluation(*, evaluation_id: int, lease: uuid.UUID, now: datetime) -> bool:
    """Hand an evaluation back unfinished because its worker is shutting down. It keeps its place; no attempt counts."""
    with transaction.atomic():
        released = _held(evaluation_id, lease).update(
            state=State.QUEUED,
            lease=None,
            leased_until=None,
            started_at=None,
            progress={},
            attempt=F("attempt") - 1,
        )
        if released:
            ring_bell()
    return bool(released)


@dataclass(frozen=True)
class SweepReport:
    """What a sweep found: leases that had run out, and how many evaluations wait now and could be run (of more than
    ``FRONT``, that many)."""

    requeued: int = 0
    waiting: int = 0


def sweep_queue(*, now: datetime, ring: bool = True) -> SweepReport:
    """Put evaluations whose worker disappeared back into the queue, see whether a storage that was out is back, move
    forward what hurries, and ring for whatever waits and does not pause.

    One evaluation that cannot be ended (a receiver raises) does not keep the others waiting. ``ring=False`` is for a
    caller that is about to look at the queue itself.
    """
    requeued = 0
    for evaluation in Evaluation.objects.filter(state=State.RUNNING, leased_until__lt=now).order_by("leased_until"):
        fault = PlatformFault("lease_expired")
        mine = _held(evaluation.pk, evaluation.lease).filter(leased_until__lt=now)
        try:
            if not _fail(mine, evaluation, fault, now, f"worker {evaluation.worker}"):
                continue
        except Exception:
            logger.exception("Evaluation %s cannot be ended.", evaluation)
            continue
        delete_files(file_names(evaluation))  # left behind if the worker died between storing and committing
        requeued += 1
    look_after_storage(now=now)
    _end_pauses(now)
    put_in_turn(now=now)
    waiting = 0 if storage_is_out() else len(next_in_line(FRONT))
    if waiting and ring:
        ring_bell(times=min(waiting, BELLS_AT_ONCE))
    return SweepReport(requeued, waiting)


def _end_pauses(now: datetime) -> None:
    over = queued().filter(not_before__lte=now)
    if over.exists():  # an update that changes nothing would still wait for the one who writes
        over.update(not_before=None)


def _held(evaluation_id: int, lease: uuid.UUID) -> QuerySet[Evaluation]:
    """The evaluation while this lease is good: one row or none."""
    return Evaluation.objects.filter(pk=evaluation_id, state=State.RUNNING, lease=lease)


def _killed_alone(evaluation: Evaluation, fault: PaddockError) -> bool:
    """Whether its simulator ended, and another car has passed since it was queued or last failed."""
    if fault.code not in KILLS:
        return False
    passed = Result.objects.exclude(evaluation__model__network=evaluation.model.network_id)
    return passed.filter(evaluation__ended_at__gte=evaluation.failed_at or evaluation.queued_at).exists()


@transaction.atomic
def _fail(mine: QuerySet[Evaluation], evaluation: Evaluation, fault: PaddockError, now: datetime, detail: str) -> bool:
    """End the attempt of the row in ``mine`` (one or none); ``evaluation`` is how it was read under the same lease."""
    changes: dict = {"lease": None, "leased_until": None}
    ours = isinstance(fault, PlatformFault)
    if ours or detail:
        note = f"Attempt {evaluation.attempt}: {fault.code}. {detail.strip()[-DETAIL_LIMIT:]}"
        changes["operator_detail"] = detail_with(note)
    if ours:
        logger.warning("Evaluation %s, attempt %s: %s. %s", evaluation, evaluation.attempt, fault.code, detail)
    kills = evaluation.kills + (ours and _killed_alone(evaluation, fault))
    if ours:
        changes |= {"kills": kills, "failed_at": now}
    if ours and (kills == evaluation.kills or kills < settings.EVALUATION_MAX_ATTEMPTS):
        pause = pause_after(evaluation.attempt)
        requeued = mine.update(
            state=State.QUEUED, started_at=None, progress={}, not_before=now + pause if pause else None, **changes
        )
        if requeued and not pause:
            ring_bell()
        return bool(requeued)
    if ours:
        code, params = "platform_gave_up", {"attempts": kills}
    else:
        code, params = fault.code, fault.params
    failed = mine.update(state=State.FAILED, ended_at=now, reason_code=code, reason_params=params, **changes)
    if failed:
        _tell(evaluation.pk, None, now)
    return bool(failed)


def _tell(evaluation_id: int, result, now: datetime) -> None:
    evaluation = Evaluation.objects.select_related("model", "track", "owner").get(pk=evaluation_id)
    record_end(evaluation, result, now)
    evaluation_ended.send(sender=Evaluation, evaluation=evaluation, result=result, now=now)
