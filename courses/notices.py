"""Notices of assignments to their students. None of them names a track: hidden ones stay hidden."""

from collections.abc import Callable, Iterable
from datetime import datetime, timedelta

from django.utils.translation import gettext_lazy as _
from django.utils.translation import gettext_noop

from core.events import Event, EventKind, EventReader
from core.times import stored
from league.notices.kinds import register
from league.notices.writer import NewNotice, notify

from .assignments.wording import plain_points
from .events import ASSIGNMENT_DUE, ASSIGNMENT_PUBLISHED, ATTEMPT_REFUNDED, MARKS_COMPLETED, MARKS_REGRADED
from .grading.members import students_of
from .models import Assignment, Attempt, Extension, Mark

REACH = timedelta(days=3)

ASSIGNED = register(
    "assigned",
    _("an assignment is published"),
    gettext_noop("%(assignment)s (%(group)s) is due at %(due)s."),
    spoils=False,
)
DUE = register(
    "due",
    _("an assignment is due in a day and you have not handed in"),
    gettext_noop("%(assignment)s (%(group)s) is due at %(due)s. You have not handed in a car yet."),
    spoils=False,
)
MARKED = register(
    "marked",
    _("marks of an assignment are complete or have changed"),
    gettext_noop("Your mark for %(assignment)s (%(group)s): %(points)s points."),
)
GIVEN_BACK = register(
    "given_back",
    _("an attempt at an assignment is given back"),
    gettext_noop("Attempt %(number)s at %(assignment)s is given back: it counts for no limit and no mark."),
    spoils=False,
)


def _published(event: Event, now: datetime) -> int:
    assignment = _assignment(event, now)
    if assignment is None or assignment.due_at <= now:
        return 0
    racers = students_of(assignment.group_id).values_list("pk", flat=True)
    return notify(NewNotice(ASSIGNED, event.subject, racers, assignment.get_absolute_url(), _params(assignment)), now)


def _due(event: Event, now: datetime) -> int:
    """Remind students without an attempt. Those with an extension have another deadline."""
    assignment = _assignment(event, now)
    if assignment is None or assignment.due_at <= now:
        return 0
    handed_in = Attempt.objects.filter(assignment=assignment, is_reference=False, refunded_at=None)
    racers = (
        students_of(assignment.group_id)
        .exclude(pk__in=handed_in.values("racer"))
        .exclude(submission_groups__group__in=handed_in.exclude(submission_group=None).values("submission_group"))
        .exclude(pk__in=Extension.objects.filter(assignment=assignment).values("racer"))
        .values_list("pk", flat=True)
    )
    about = event.once or event.subject
    return notify(NewNotice(DUE, about, racers, assignment.get_absolute_url(), _params(assignment)), now)


def _marked(event: Event, now: datetime) -> int:
    assignment = _assignment(event, now)
    if assignment is None:
        return 0
    written = 0
    for mark in Mark.objects.filter(assignment=assignment, is_complete=True).order_by("pk"):
        params = {**_params(assignment), "points": plain_points(mark.points)}
        about = f"{event.subject}:{mark.points}"  # marks that are complete again after a change of others are no news
        written += notify(NewNotice(MARKED, about, [mark.racer_id], assignment.get_absolute_url(), params), now)
    return written


def _given_back(event: Event, now: datetime) -> int:
    attempt = Attempt.objects.filter(public_id=event.subject).select_related("assignment__group").first()
    if attempt is None or event.at <= now - REACH:
        return 0
    params = {**_params(attempt.assignment), "number": attempt.number}
    racers: Iterable[int] = [attempt.racer_id]
    if attempt.submission_group is not None:
        racers = attempt.submission_group.members.values_list("racer", flat=True)
    return notify(NewNotice(GIVEN_BACK, event.subject, racers, attempt.get_absolute_url(), params), now)


def _assignment(event: Event, now: datetime) -> Assignment | None:
    """The published assignment of a recent event."""
    if event.at <= now - REACH:
        return None
    found = Assignment.objects.filter(public_id=event.subject, published_at__isnull=False)
    return found.select_related("group").first()


def _params(assignment: Assignment) -> dict[str, str | int]:
    return {"assignment": assignment.title, "group": assignment.group.name, "due": stored(assignment.due_at)}


_WRITERS: dict[EventKind, Callable[[Event, datetime], int]] = {
    ASSIGNMENT_PUBLISHED: _published,
    ASSIGNMENT_DUE: _due,
    MARKS_COMPLETED: _marked,
    MARKS_REGRADED: _marked,
    ATTEMPT_REFUNDED: _given_back,
}
_BY_NAME = {kind.name: write for kind, write in _WRITERS.items()}
NOTICES = EventReader("assignment notices", tuple(_WRITERS), lambda event, now: _BY_NAME[event.kind](event, now))
