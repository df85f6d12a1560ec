"""The event of a training's end."""

from datetime import datetime

from core.events import EventKind, record, register

from .models import TrainingJob

TRAINING_ENDED = register(
    EventKind("training.ended", "a training has ended", ("racer", "subject"), ("ended_because", "reason"))
)


def record_end(job_id: int, now: datetime) -> None:
    """A training is final. Call it in the transaction that ends it, after the row is written. A trial that may continue
    has no event."""
    columns = ("owner_id", "public_id", "ended_because", "reason_code", "keeps_models")
    job = TrainingJob.objects.only(*columns).get(pk=job_id)
    if not job.keeps_models:
        return
    what = {"ended_because": job.ended_because, "reason": job.reason_code}
    record(TRAINING_ENDED, at=now, racer=job.owner_id, subject=job.public_id, **what)
