"""The registry of queues that the operators' page shows."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.db.models import QuerySet
from django.utils.functional import Promise

from .kinds import JobKind


@dataclass(frozen=True)
class Queue:
    """A kind of job on the operators' page.

    ``name``: in addresses; ``since``: the column with the start of the wait; ``related``: for the page; ``repeatable``:
    failed jobs that can run again; ``run_again``: requeues one, and raises UserFault if it must not."""

    name: str
    label: Promise
    kind: JobKind[Any]
    since: str
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
