"""A private run of what was trained: the referee of races, seen by its owner only."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Literal

from evaluation.models import Evaluation
from evaluation.services import queue_evaluation
from paddock.errors import UserFault
from paddock.rules.race import RaceRules

from ..models import TrainingJob
from .create import layout_of

if TYPE_CHECKING:
    from accounts.models import Racer

LAPS_OF_A_TEST = 3


def evaluate_training(
    *, job: TrainingJob, which: Literal["best", "last"] = "best", by: Racer, now: datetime
) -> Evaluation:
    """Queue three laps of the best or the last model on the track and the layout that it was trained on.

    Raises UserFault("training_no_model") while there is none, ("model_not_yours") for who does not own it.
    """
    model = job.last_model if which == "last" else job.best_model
    if model is None or model.deleted_at is not None:
        raise UserFault("training_no_model")
    rules = RaceRules.from_dict(
        {**layout_of(job), "race_type": job.race_type, "direction": job.direction, "laps": LAPS_OF_A_TEST}
        | ({"seed": job.seed} if job.random_boxes or job.bots else {})
    )
    return queue_evaluation(owner=by, model=model, track=job.track, rules=rules, now=now)
