"""What the clock does around deadlines: reminders, draws of hidden tracks, complete marks."""

from datetime import datetime, timedelta
from hashlib import sha256

from django.db import transaction

from core.database.locks import hold
from core.events import record, record_all, written

from ..events import ASSIGNMENT_DUE, TRACKS_DRAWN
from ..grading.services import complete_marks, recompute_marks, reopen_marks
from ..models import Assignment, AssignmentPart, PartTrack, TrackKind
from .runs import queue_hidden_runs

A_DAY = timedelta(days=1)


def record_due_assignments(*, now: datetime) -> int:
    """Record once which assignments are due within a day; one that opened within a day has only just been published.
    Returns the number of new events."""
    due = Assignment.objects.filter(published_at__isnull=False, opens_at__lte=now - A_DAY)
    due = due.filter(due_at__gt=now, due_at__lte=now + A_DAY).order_by("due_at", "pk")
    return record_all(
        written(ASSIGNMENT_DUE, at=now, subject=one.public_id, once=f"{one.public_id}:{one.due_at:%Y%m%d%H%M}")
        for one in due
    )


def draw_hidden_tracks(*, now: datetime) -> int:
    """Draw for all assignments whose deadline has passed, and queue the runs of the attempts that may count. Returns
    the number of assignments."""
    due = Assignment.objects.filter(drawn_at=None, due_at__lt=now, published_at__isnull=False)
    return sum(_draw(pk, now) for pk in due.order_by("due_at", "pk").values_list("pk", flat=True))


def complete_all_marks(*, now: datetime) -> int:
    """Complete the marks of assignments that are over. Returns how many."""
    over = Assignment.objects.filter(final_at=None, due_at__lt=now, published_at__isnull=False)
    return sum(_complete(one, now) for one in over.order_by("due_at", "pk"))


@transaction.atomic
def _complete(assignment: Assignment, now: datetime) -> bool:
    if not complete_marks(assignment=assignment, now=now):
        return False
    if queue_hidden_runs(assignment, now):  # of attempts that count only since the rules changed
        reopen_marks(assignment)
        recompute_marks(assignment=assignment, now=now)
        return False
    return True


@transaction.atomic
def _draw(pk: int, now: datetime) -> bool:
    assignment = Assignment.objects.filter(pk=pk, drawn_at=None).first()
    if assignment is None:
        return False
    hold(assignment)
    assignment.refresh_from_db()
    if assignment.drawn_at is not None or assignment.due_at >= now:
        return False
    parts = list(assignment.parts.filter(hidden_tracks__gt=0))
    for part in parts:
        PartTrack.objects.filter(pk__in=drawn_of(assignment, part)).update(kind=TrackKind.DRAWN)
    assignment.drawn_at = now
    assignment.save(update_fields=["drawn_at"])
    if parts:
        queue_hidden_runs(assignment, now)
        recompute_marks(assignment=assignment, now=now)
        record(TRACKS_DRAWN, at=now, subject=assignment.public_id, once=assignment.public_id)
    return True


def drawn_of(assignment: Assignment, part: AssignmentPart) -> list[int]:
    """The ids of the part's tracks that are drawn: the same at every call, by the secret seed."""
    candidates = part.tracks.exclude(kind=TrackKind.SHOWN).select_related("track")

    def lot(one: PartTrack) -> str:
        return sha256(f"{assignment.draw_seed}:{part.number}:{one.track.slug}".encode()).hexdigest()

    return [one.pk for one in sorted(candidates, key=lot)[: part.hidden_tracks]]
