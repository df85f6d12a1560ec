"""Running again what failed: evaluations of races and of the garage, trainings, videos."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from django.db import IntegrityError

from core.jobs.queues import Queue
from paddock.errors import UserFault


@dataclass
class RunAgain:
    """How many are in the queue again, and the reasons of those that are not, each with its number."""

    queued: int = 0
    refused: Counter[str] = field(default_factory=Counter)


def run_again(*, queue: Queue, jobs: Iterable[Any], now: datetime) -> RunAgain:
    """Put each of these jobs of a queue into it again, each in a transaction of its own: what one is refused for does
    not keep the others back. One that somebody else has put back meanwhile counts as neither."""
    report = RunAgain()
    for job in jobs:
        try:
            report.queued += bool(queue.run_again(job, now))
        except UserFault as fault:
            report.refused[str(fault)] += 1
        except IntegrityError:  # another one of that name runs by now
            report.refused[""] += 1
    return report
