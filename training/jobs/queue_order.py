"""The order of the trainers' queue.

First comes the racer with the least trainer time in the last 24 hours (host clock, running trainings included), then
the oldest training. A racer's second training counts as if the minutes of the first were used. Trainings that only wait
for their models to be stored come before all others.
"""

from collections import defaultdict
from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import NamedTuple

from django.db.models import Q

from core.streams.shared_pieces import shared_value

from ..models import JobState, TrainingJob
from ..models.choices import UNDER_WAY

REMEMBERED = timedelta(days=1)


class Waiting(NamedTuple):
    pk: int
    attempt: int
    owner_id: int
    stop_minutes: int
    charged_s: float
    reason_code: str
    created_at: datetime


def waiting_in_order(now: datetime) -> list[Waiting]:
    """All trainings that can be claimed at ``now``, in the order of the queue. Two queries."""
    return _in_turn(Q(not_before=None) | Q(not_before__lte=now), now)


def place_of(job: TrainingJob, now: datetime) -> int | None:
    """The place in the queue from 1, behind all others during a pause; None if the training is not queued."""
    return (
        shared_value("places of trainings", lambda: _places(now)).get(job.pk) if job.state == JobState.QUEUED else None
    )


def _places(now: datetime) -> dict[int, int]:
    waiting = [*waiting_in_order(now), *_in_turn(Q(not_before__gt=now), now)]
    return {each.pk: place for place, each in enumerate(waiting, 1)}


def _in_turn(which: Q, now: datetime) -> list[Waiting]:
    jobs = TrainingJob.objects.filter(which, state=JobState.QUEUED).order_by("created_at", "pk")
    rows = [Waiting(*row) for row in jobs.values_list(*Waiting._fields)]
    had = _had({row.owner_id for row in rows}, now)
    keyed = []
    for row in rows:
        keyed.append((not row.reason_code, had[row.owner_id], row.created_at, row.pk, row))
        if not row.reason_code:
            had[row.owner_id] += max(0.0, 60.0 * row.stop_minutes - row.charged_s)
    return [each[-1] for each in sorted(keyed)]


def _had(owners: Iterable[int], now: datetime) -> dict[int, float]:
    jobs = TrainingJob.objects.filter(owner__in=owners)
    jobs = jobs.filter(Q(state__in=UNDER_WAY) | Q(ended_at__gt=now - REMEMBERED))
    had: dict[int, float] = defaultdict(float)
    for owner, charged, state, started_at in jobs.values_list("owner", "charged_s", "state", "started_at"):
        had[owner] += charged
        if state == JobState.RUNNING and started_at is not None:
            had[owner] += max(0.0, (now - started_at).total_seconds())
    return had
