"""Hands in attempts, gives them back, takes the ends of their runs; reference rows."""

from __future__ import annotations

from datetime import datetime, timedelta

from django.db import transaction
from django.db.models import Max
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from core.audit.recording import audited
from core.database.locks import hold
from core.events import record
from evaluation.models import Evaluation, Result, TrainedModel
from evaluation.selectors import can_see_model, can_use_model
from paddock.errors import UserFault

from ..assignments.services import delete_runs
from ..events import ATTEMPT_REFUNDED
from ..grading.members import Unit, hold_units, is_student, require_teacher, unit_of, unit_of_attempt
from ..grading.services import deadline_of, recompute_marks, reopen_marks
from ..models import Assignment, Attempt, AttemptRun, Extension, ReferenceRow, RefundKind, RunState
from .runs import queue_hidden_runs, queue_runs
from .selectors import refusal_of

# after a fault of the site's own, an attempt may be repeated for so long
GRACE = timedelta(hours=24)
MOST_WAITING = 10  # attempts of a racer whose runs are not over


@transaction.atomic
def submit_attempt(*, assignment: Assignment, racer: Racer, model: TrainedModel, now: datetime) -> Attempt:
    """Hand in a model and queue its runs; it is in time by the moment ``now``.

    Raises UserFault ``assignment_gone``, ``attempt_students_only``, ``model_not_yours``, ``attempt_not_open_yet``,
    ``attempt_too_late``, ``attempts_used_up``, ``attempts_of_day_used_up``, ``attempts_wait``, and
    ``attempt_already_submitted`` for the car of the latest attempt, a repeated click among others."""
    _hold(assignment)
    if assignment.published_at is None or not is_student(racer, assignment.group_id):
        raise UserFault("attempt_students_only")
    if not can_use_model(racer, model):
        raise UserFault("model_not_yours")
    unit = unit_of(assignment, racer)
    latest = unit.attempts(assignment).filter(refunded_at=None).select_related("model").order_by("-number").first()
    if latest is not None and latest.model.network_id == model.network_id:
        raise UserFault("attempt_already_submitted")
    if (refusal := refusal_of(assignment, unit, now)) is not None:
        raise refusal
    _refuse_waiting(racer)
    attempt = _new_attempt(assignment, racer, unit, model, now)
    queue_runs(assignment, [attempt], now)
    reopen_marks(assignment)
    recompute_marks(assignment=assignment, racers=unit.racers, now=now)
    return attempt


@audited("attempt.refunded", _("Attempt given back"), target="attempt")
@transaction.atomic
def refund_attempt(*, attempt: Attempt, by: Racer, reason: str, now: datetime) -> Attempt:
    """Give an attempt back: it counts for no limit and no mark. Raises UserFault("assignment_not_yours" |
    "attempt_refunded_already")."""
    assignment = attempt.assignment
    require_teacher(assignment.group, by)
    _hold(assignment)
    if not _refund(attempt, RefundKind.TEACHER, now, reason=reason, by=by):
        raise UserFault("attempt_refunded_already")
    return attempt


@audited("assignment.reference_added", _("Reference row added"), target="assignment")
@transaction.atomic
def add_reference(*, assignment: Assignment, by: Racer, label: str, model: TrainedModel, now: datetime) -> ReferenceRow:
    """Drive a car that is shown on the board, neither ranked nor marked: one of the teacher's, a shared one or a house
    car. Raises UserFault("assignment_not_yours" | "model_not_yours" | "attempts_wait")."""
    require_teacher(assignment.group, by)
    if not can_see_model(by, model):
        raise UserFault("model_not_yours")
    _hold(assignment)
    row = ReferenceRow(assignment=assignment, label=label.strip())
    row.full_clean(exclude=["attempt"])
    _refuse_waiting(by)
    row.attempt = _new_attempt(assignment, by, Unit((by.pk,)), model, now, is_reference=True)
    row.save()
    queue_runs(assignment, [row.attempt], now)
    return row


@audited("assignment.reference_removed", _("Reference row removed"), target="assignment")
@transaction.atomic
def remove_reference(*, assignment: Assignment, row: ReferenceRow, by: Racer) -> None:
    """Take a reference row off the board, with its attempt. Raises UserFault("assignment_not_yours")."""
    require_teacher(assignment.group, by)
    delete_runs(Evaluation.with_sealed.filter(attempt_run__attempt=row.attempt))
    row.attempt.delete()


def take_ended_evaluation(
    sender: object, *, evaluation: Evaluation, result: Result | None, now: datetime, **kwargs: object
) -> None:
    """Receiver of ``evaluation_ended``."""
    record_ended_run(evaluation=evaluation, result=result, now=now)


@transaction.atomic
def record_ended_run(*, evaluation: Evaluation, result: Result | None, now: datetime) -> None:
    """Take the end of an attempt's run and compute the mark, in the transaction that ends it: exactly once, also after
    a kill. What failed by the site's fault gives the attempt back."""
    run = AttemptRun.objects.filter(evaluation=evaluation, state=RunState.WAITING).first()
    if run is None:
        return
    attempt = Attempt.objects.select_related("assignment__group", "racer").get(pk=run.attempt_id)
    assignment = attempt.assignment
    ours = result is None and evaluation.is_platform_fault
    state = RunState.FINISHED if result is not None else RunState.PLATFORM_FAULT if ours else RunState.FAILED
    laps = [] if result is None else result.laps
    if ours:
        _hold(assignment)
    unit = unit_of_attempt(attempt)
    hold_units([unit])
    AttemptRun.objects.filter(pk=run.pk).update(state=state, laps=laps, ended_at=now)
    if ours:
        _refund(attempt, RefundKind.PLATFORM, now)
    elif not attempt.is_reference and attempt.refunded_at is None:
        recompute_marks(assignment=assignment, racers=unit.racers, now=now)


def _refund(attempt: Attempt, kind: RefundKind, now: datetime, *, reason: str = "", by: Racer | None = None) -> bool:
    """Give back once; the assignment is locked."""
    attempt.refresh_from_db()
    if attempt.refunded_at is not None:
        return False
    attempt.refunded_at, attempt.refund_kind, attempt.refund_reason, attempt.refunded_by = now, kind, reason, by
    attempt.save(update_fields=["refunded_at", "refund_kind", "refund_reason", "refunded_by"])
    assignment, unit = attempt.assignment, unit_of_attempt(attempt)
    if attempt.is_reference:
        return True
    if kind == RefundKind.PLATFORM:
        _give_time(attempt, unit, now)
    if assignment.drawn_at is not None:
        queue_hidden_runs(assignment, now)  # another attempt may count now
    reopen_marks(assignment)
    recompute_marks(assignment=assignment, racers=unit.racers, now=now)
    record(ATTEMPT_REFUNDED, at=now, racer=attempt.racer_id, subject=attempt.public_id, cause=str(kind))
    return True


def _give_time(attempt: Attempt, unit: Unit, now: datetime) -> None:
    """Extend the deadline where an attempt that was in time can hardly be repeated in time, and the last moment where
    a late one can hardly be repeated. The reason of an extension that a teacher gave stays."""
    due_at, last_at = deadline_of(attempt.assignment, unit)
    until = now + GRACE
    if attempt.accepted_at > due_at:
        if last_at is None or last_at >= until:
            return
        last_at = until
    elif due_at >= until:
        return
    else:
        due_at, last_at = until, last_at if last_at is not None and last_at > until else None
    Extension.objects.update_or_create(
        assignment=attempt.assignment,
        racer=attempt.racer,
        defaults={"due_at": due_at, "last_at": last_at, "granted_at": now},
    )


def _refuse_waiting(racer: Racer) -> None:
    """No quota of runs holds for attempts, and they go before others in the last hour: nobody fills the queue."""
    waiting = AttemptRun.objects.filter(attempt__racer=racer, state=RunState.WAITING)
    if waiting.order_by().values("attempt").distinct().count() >= MOST_WAITING:
        raise UserFault("attempts_wait", limit=MOST_WAITING)


def _new_attempt(
    assignment: Assignment, racer: Racer, unit: Unit, model: TrainedModel, now: datetime, *, is_reference: bool = False
) -> Attempt:
    if is_reference:
        before = Attempt.objects.filter(assignment=assignment, racer=racer, is_reference=True)
    else:
        before = unit.attempts(assignment)
    return Attempt.objects.create(
        assignment=assignment,
        racer=racer,
        submission_group_id=unit.group,
        model=model,
        model_name=model.name,
        number=1 + (before.aggregate(most=Max("number"))["most"] or 0),
        is_reference=is_reference,
        accepted_at=now,
    )


def _hold(assignment: Assignment) -> None:
    """Lock the assignment and read it again. Raises UserFault("assignment_gone")."""
    try:
        hold(assignment)
        assignment.refresh_from_db()
    except Assignment.DoesNotExist:
        raise UserFault("assignment_gone") from None
