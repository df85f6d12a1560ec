"""The order of the trainers' queue.

Racers take turns: first comes whoever has had the least of the trainers in the last day, by the host's own clock, what
runs now included; then whoever came first. A second training of the same racer stands as if the minutes of the first
were had already. What only waits for its models to be kept goes before all: that takes seconds.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import NamedTuple

from django.db.models import Q, QuerySet

from .models import JobState, TrainingJob
from .models.choices import UNDER_WAY

REMEMBERED = timedelta(days=1)


class Waiting(NamedTuple):
    """A queued training as the queue sees it."""

    pk: int
    attempt: int
    owner_id: int
    stop_minutes: int
    charged_s: float
    reason_code: str
    created_at: datetime


def waiting_in_order(now: datetime) -> list[Waiting]:
    """All trainings that could be claimed at ``now``, in the order in which they will be if nothing else is queued:
    what pauses after a fault of ours stands aside. Two queries."""
    return _in_turn(queued().filter(due(now)), now)


def place_of(job: TrainingJob, now: datetime) -> int | None:
    """The place in the queue, 1 for the next one to run; behind all others while it pauses. None when it does not
    wait."""
    if job.state != JobState.QUEUED:
        return None
    waiting = [*waiting_in_order(now), *_in_turn(queued().exclude(due(now)), now)]
    return next((place for place, each in enumerate(waiting, 1) if each.pk == job.pk), None)


def due(now: datetime) -> Q:
    """What does not pause."""
    return Q(not_before=None) | Q(not_before__lte=now)


def queued() -> QuerySet[TrainingJob]:
    """All queued trainings, unordered."""
    return TrainingJob.objects.filter(state=JobState.QUEUED).order_by()


def _in_turn(waiting: QuerySet[TrainingJob], now: datetime) -> list[Waiting]:
    rows = [Waiting(*row) for row in waiting.order_by("created_at", "pk").values_list(*Waiting._fields)]
    had = _had({row.owner_id for row in rows}, now)
    keyed = []
    for row in rows:
        keyed.append((not row.reason_code, had[row.owner_id], row.created_at, row.pk, row))
        if not row.reason_code:
            had[row.owner_id] += max(0.0, 60.0 * row.stop_minutes - row.charged_s)
    return [each[-1] for each in sorted(keyed)]


def _had(owners: Iterable[int], now: datetime) -> dict[int, float]:
    """Seconds of the trainers that these racers have had."""
    jobs = TrainingJob.objects.filter(owner__in=owners)
    jobs = jobs.filter(Q(state__in=UNDER_WAY) | Q(ended_at__gt=now - REMEMBERED))
    had: dict[int, float] = defaultdict(float)
    for owner, charged, state, started_at in jobs.values_list("owner", "charged_s", "state", "started_at"):
        had[owner] += charged
        if state == JobState.RUNNING and started_at is not None:
            had[owner] += max(0.0, (now - started_at).total_seconds())
    return had
