"""Every write to training jobs and what they leave behind."""

from .again import train_again
from .create import clone_settings, create_training
from .evaluate import evaluate_training
from .first import begun_by, train_first_car
from .jobs import TRAININGS
from .records import keep_checkpoint, purge_trainings, record_iteration
from .remove import delete_training, forget_deleted
from .results import finish_training
from .stop import stop_training
from .work import run_next_training, spec_of

__all__ = [
    "TRAININGS",
    "begun_by",
    "clone_settings",
    "create_training",
    "delete_training",
    "evaluate_training",
    "finish_training",
    "forget_deleted",
    "keep_checkpoint",
    "purge_trainings",
    "record_iteration",
    "run_next_training",
    "spec_of",
    "stop_training",
    "train_again",
    "train_first_car",
]
