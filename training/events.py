"""What happens to a training, as events."""

from __future__ import annotations

from datetime import datetime

from core.events import OWN, EventKind, record, register

from .models import TrainingJob

TRAINING_ENDED = register(
    EventKind("training.ended", "a training has ended", OWN, ("racer", "subject"), ("ended_because", "reason"))
)


def record_end(job_id: int, now: datetime) -> None:
    """A training is final. Call it in the transaction that ends it, after the row is written."""
    job = TrainingJob.objects.only("owner_id", "public_id", "ended_because", "reason_code").get(pk=job_id)
    what = {"ended_because": job.ended_because, "reason": job.reason_code}
    record(TRAINING_ENDED, at=now, racer=job.owner_id, subject=job.public_id, **what)
