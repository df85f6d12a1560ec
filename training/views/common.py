"""What the pages of training share."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from django.http import HttpRequest
from django.shortcuts import get_object_or_404

from accounts.quotas import limit_of, used_by
from core.forms import explain
from paddock.errors import PlatformFault
from training.models import TrainingJob
from training.quotas import AT_ONCE, MINUTES
from training.selectors import minutes_left, visible_trainings
from training.services.create import refuse_when_closed

if TYPE_CHECKING:
    from accounts.models import Racer


@dataclass(frozen=True)
class TrainingAllowance:
    """What a racer may still train. ``closed``: why nothing can be trained on this site now, "" if it can."""

    minutes_left: int
    minutes: int
    active: int
    at_once: int
    closed: str

    @property
    def percent_used(self) -> int:
        """Of the month's minutes."""
        return round(100 * (1 - self.minutes_left / self.minutes)) if self.minutes else 100


def usage_of(racer: Racer, now: datetime) -> TrainingAllowance:
    """The quota of a racer at ``now``."""
    return TrainingAllowance(
        minutes_left=int(minutes_left(racer, now)),
        minutes=limit_of(racer, MINUTES.name),
        active=int(used_by(racer, AT_ONCE.name, now)),
        at_once=limit_of(racer, AT_ONCE.name),
        closed=closed_because(),
    )


def closed_because() -> str:
    """Why no training is taken on now, in the reader's language; "" if they are."""
    try:
        refuse_when_closed()
    except PlatformFault as fault:
        return explain(fault)
    return ""


def visible_training(request: HttpRequest, public_id: str, *, whole: bool = True) -> TrainingJob:
    """The training, or 404 when there is none or the reader may not see it. ``whole=False``: only what is asked for
    all the time, the rest when it is looked at."""
    jobs = visible_trainings(request.user)
    if whole:
        related = ("track", "owner", "best_model__network", "last_model__network", "cloned_from", "submit_to_race")
        jobs = jobs.select_related(*related, "own_evaluation__evaluation__track")
    else:
        jobs = jobs.defer("log", "driving", "reward_code", "operator_detail")
    return get_object_or_404(jobs, public_id=public_id)
