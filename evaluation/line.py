"""The order of the queue.

Higher priority first. Within a priority, racers take turns: first comes whoever has had the fewest turns while waiting,
where a turn is an evaluation of theirs that is running, or that was started after the one now at the head of their own
line was queued. Among equals the oldest comes first. So one submission each is first come, first served, with any
number of workers, and fifty submissions of one racer do not keep a newcomer waiting.

What nobody waits for (:data:`BACKGROUND`) runs when nothing else is there to run, and is no turn of anybody's.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from datetime import datetime
from typing import NamedTuple

from django.db.models import Count, F, IntegerField, OuterRef, Q, Subquery, Window
from django.db.models.functions import Coalesce, RowNumber

from .models import Evaluation, State

BACKGROUND = -20  # the lowest priority there is


class Waiting(NamedTuple):
    """A queued evaluation as the queue sees it."""

    pk: int
    attempt: int
    owner_id: int
    priority: int
    queued_at: datetime


def heads_of_line(now: datetime) -> list[Waiting]:
    """The next evaluation of every racer who waits at the highest priority, in the order in which they run. What pauses
    after a fault of ours stands aside."""
    ready = queued().filter(due(now))
    top = ready.order_by("-priority").values("priority")[:1]
    first_of_owner = (
        ready.filter(priority=Subquery(top))
        .annotate(place=Window(RowNumber(), partition_by=F("owner_id"), order_by=[F("queued_at"), F("pk")]))
        .filter(place=1)
    )
    rows = [Waiting(*row) for row in first_of_owner.values_list(*Waiting._fields)]
    turns = _turns_taken([row.pk for row in rows])
    return sorted(rows, key=lambda row: (turns[row.pk], row.queued_at, row.pk))


def whole_line() -> list[int]:
    """The ids of all queued evaluations in the order in which they will run if nothing else is queued."""
    lines: dict[tuple[int, int], list[Waiting]] = defaultdict(list)
    for row in queued().order_by("queued_at", "pk").values_list(*Waiting._fields):
        waiting = Waiting(*row)
        lines[-waiting.priority, waiting.owner_id].append(waiting)
    turns = _turns_taken([line[0].pk for line in lines.values()])
    order = []
    before: Counter[int] = Counter()  # turns that a racer will have had with rows of a higher priority
    for (minus_priority, owner_id), line in sorted(lines.items()):
        first_turn = turns[line[0].pk] + before[owner_id]
        before[owner_id] += len(line)
        order += [(minus_priority, first_turn + place, row.queued_at, row.pk) for place, row in enumerate(line)]
    return [pk for *_, pk in sorted(order)]


def due(now: datetime) -> Q:
    """What does not pause."""
    return Q(not_before=None) | Q(not_before__lte=now)


def queued():
    """All queued evaluations, unordered."""
    return Evaluation.objects.filter(state=State.QUEUED).order_by()


def _turns_taken(heads: list[int]) -> dict[int, int]:
    """For each head of a racer's line, how many turns that racer has had while it waited."""
    turns = (
        Evaluation.objects.filter(owner=OuterRef("owner"))
        .exclude(state=State.QUEUED)
        .filter(priority__gt=BACKGROUND)
        .filter(Q(state=State.RUNNING) | Q(started_at__gte=OuterRef("queued_at")))
        .order_by()
        .values("owner")
        .annotate(turns=Count("pk"))
        .values("turns")
    )
    rows = Evaluation.objects.filter(pk__in=heads).order_by()
    return dict(
        rows.annotate(turns=Coalesce(Subquery(turns, output_field=IntegerField()), 0)).values_list("pk", "turns")
    )
