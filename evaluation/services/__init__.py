"""Every write to models, evaluations and results."""

from .garage import (
    UploadedModel,
    delete_model,
    describe_model,
    purge_garages,
    share_model,
    stop_sharing_model,
    upload_model,
)
from .jobs import EVALUATIONS, finish_evaluation
from .nodes import engines_at_work, note_worker
from .queue import queue_again, queue_copies, queue_evaluation, stop_evaluation
from .results import delete_evaluation
from .sealed import discard_sealed, unseal_evaluation
from .turns import reschedule
from .work import job_of, run_next_evaluation

__all__ = [
    "EVALUATIONS",
    "UploadedModel",
    "delete_evaluation",
    "delete_model",
    "describe_model",
    "discard_sealed",
    "engines_at_work",
    "finish_evaluation",
    "job_of",
    "note_worker",
    "purge_garages",
    "queue_again",
    "queue_copies",
    "queue_evaluation",
    "reschedule",
    "run_next_evaluation",
    "share_model",
    "stop_evaluation",
    "stop_sharing_model",
    "unseal_evaluation",
    "upload_model",
]
