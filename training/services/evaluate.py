"""A private run of what was trained: the referee of races, seen by its owner only."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Any, Literal

from evaluation.models import Evaluation
from evaluation.selectors import can_use_model
from paddock.errors import UserFault
from races.services import drive_own

from ..models import TrainingJob
from .create import layout_of

if TYPE_CHECKING:
    from accounts.models import Racer

LAPS_OF_A_TEST = 3


def evaluate_training(
    *, job: TrainingJob, which: Literal["best", "last"] = "best", by: Racer, now: datetime
) -> Evaluation:
    """Queue three laps of the best or the last model on the track and the layout that it was trained on, as a run of
    the racer's own.

    Raises UserFault("training_no_model") while there is none, ("model_not_yours") for who does not own it, and as
    :func:`races.services.drive_own`.
    """
    model = job.last_model if which == "last" else job.best_model
    if model is None or model.deleted_at is not None:
        raise UserFault("training_no_model")
    if not can_use_model(by, model):
        raise UserFault("model_not_yours")
    own = drive_own(owner=by, model=model, track=job.track, now=now, **options_of_a_test(job))
    assert own.evaluation is not None, "it has just been queued"
    return own.evaluation


def options_of_a_test(job: TrainingJob) -> dict[str, Any]:
    """How a model of this training is tried: three laps among what it was trained among, in the same direction."""
    options = {**layout_of(job), "race_type": job.race_type, "direction": job.direction, "laps": LAPS_OF_A_TEST}
    return options | ({"seed": job.seed} if job.random_boxes or job.bots else {})
