"""Every write to models, evaluations and results."""

from .bell import ring_bell
from .garage import (
    UploadedModel,
    delete_model,
    describe_model,
    purge_garages,
    share_model,
    stop_sharing_model,
    upload_model,
)
from .leases import (
    SweepReport,
    beat,
    claim_next_evaluation,
    fail_evaluation,
    finish_evaluation,
    release_evaluation,
    sweep_queue,
)
from .nodes import engines_at_work, note_worker
from .queue import queue_again, queue_copies, queue_evaluation, stop_evaluation
from .turns import reschedule
from .work import job_of, run_next_evaluation

__all__ = [
    "SweepReport",
    "UploadedModel",
    "beat",
    "claim_next_evaluation",
    "delete_model",
    "describe_model",
    "engines_at_work",
    "fail_evaluation",
    "finish_evaluation",
    "job_of",
    "note_worker",
    "purge_garages",
    "queue_again",
    "queue_copies",
    "queue_evaluation",
    "release_evaluation",
    "reschedule",
    "ring_bell",
    "run_next_evaluation",
    "share_model",
    "stop_evaluation",
    "stop_sharing_model",
    "sweep_queue",
    "upload_model",
]
