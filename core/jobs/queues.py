"""What operators see of queues: how full each is, and the registry of those on their page."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.db.models import Count, Min, Q, QuerySet
from django.utils.functional import Promise

from .kinds import JobKind


@dataclass(frozen=True)
class Queue:
    """A kind of job on the operators' page.

    ``name``: in addresses; ``related``: for the page; ``repeatable``: failed jobs that can run again; ``run_again``:
    requeues one, and raises UserFault if it must not."""

    name: str
    label: Promise
    kind: JobKind[Any]
    related: tuple[str, ...]
    repeatable: Callable[[QuerySet[Any]], QuerySet[Any]]
    run_again: Callable[[Any, datetime], object]

    def jobs(self) -> QuerySet[Any]:
        return self.kind.model._default_manager.all()

    def failed_runs(self) -> QuerySet[Any]:
        """What failed and can be run again, the newest first."""
        return self.repeatable(self.jobs().filter(state=self.kind.failed)).order_by("-ended_at", "-pk")


_QUEUES: dict[str, Queue] = {}


def register_queue(queue: Queue) -> None:
    """Show this kind of job on the operators' page. Registering one twice changes nothing."""
    _QUEUES[queue.name] = queue


def all_queues() -> list[Queue]:
    """Every kind of job that operators see, in the order of their names."""
    return [_QUEUES[name] for name in sorted(_QUEUES)]


@dataclass(frozen=True)
class Backlog:
    """The jobs of a kind at a moment. ``paused``: after a fault of ours; ``oldest``: since when the first one waits of
    those that somebody waits for; ``workers``: that have one."""

    waiting: int
    paused: int
    running: int
    oldest: datetime | None
    workers: int


def backlog(kind: JobKind[Any], now: datetime) -> Backlog:
    """How full the queue of a kind is: two queries."""
    rows = kind.model._base_manager.order_by()
    pausing = Count("pk", filter=Q(not_before__gt=now))
    oldest = Min(kind.since, filter=kind.awaited)
    waits = rows.filter(state=kind.waiting).aggregate(all=Count("pk"), pausing=pausing, oldest=oldest)
    works = rows.filter(state=kind.working).aggregate(all=Count("pk"), workers=Count("worker", distinct=True))
    waiting = waits["all"] - waits["pausing"]
    return Backlog(waiting, waits["pausing"], works["all"], waits["oldest"], works["workers"])
