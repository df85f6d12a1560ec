"""What operators see of the kinds of job, and run again. Each room registers its own when the site comes up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.db.models import QuerySet
from django.utils.functional import Promise

from .kinds import JobKind


@dataclass(frozen=True)
class Queue:
    """A kind of job on the operators' page; what it is stands in ``kind``.

    ``name``: in addresses; ``since``: the column that says since when a job waits; ``related``: what the page shows of
    a job. ``repeatable``: those of the failed ones that can be run again; ``run_again``: puts one of them back, False
    when it is not failed any more, raises UserFault for why it stays as it is.
    """

    name: str
    label: Promise
    kind: JobKind[Any]
    since: str
    related: tuple[str, ...]
    repeatable: Callable[[QuerySet[Any]], QuerySet[Any]]
    run_again: Callable[[Any, datetime], object]

    def jobs(self) -> QuerySet[Any]:
        """All jobs of the kind."""
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
