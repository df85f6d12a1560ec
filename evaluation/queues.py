"""The kinds of job that workers do, for the operators' page. Each room registers its own when the site comes up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.db.models import Model, QuerySet
from django.utils.functional import Promise


@dataclass(frozen=True)
class Queue:
    """A kind of job, a row of ``model`` each.

    ``name``: in addresses; ``broker``: the queue that its workers listen to; ``waiting``, ``running``, ``failed``:
    states; ``since``: the column that says since when a job waits; ``related``: what a page shows of a job.
    ``repeatable``: those of the failed ones that can be run again; ``run_again``: puts one of them back, False when it
    is not failed any more, raises UserFault for why it stays as it is.
    """

    name: str
    label: Promise
    broker: str
    model: type[Model]
    waiting: str
    running: str
    failed: str
    since: str
    related: tuple[str, ...]
    repeatable: Callable[[QuerySet], QuerySet]
    run_again: Callable[[Any, datetime], object]

    def failed_runs(self) -> QuerySet:
        """What failed and can be run again, the newest first."""
        return self.repeatable(self.model._default_manager.filter(state=self.failed)).order_by("-ended_at", "-pk")


_QUEUES: dict[str, Queue] = {}


def register_queue(queue: Queue) -> None:
    """Show this kind of job on the operators' page. Registering one twice changes nothing."""
    _QUEUES[queue.name] = queue


def all_queues() -> list[Queue]:
    """Every kind of job, in the order of their names."""
    return [_QUEUES[name] for name in sorted(_QUEUES)]
