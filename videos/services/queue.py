"""The queue of videos (:mod:`core.jobs`) and the end of a drawn one."""

from __future__ import annotations

import hashlib
import uuid
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from django.db import transaction

from core.events import record
from core.jobs.kinds import register
from core.jobs.retried import RetriedKind

from ..events import VIDEO_READY
from ..models import Video, VideoState
from .stored_files import delete_files, names_of, store

if TYPE_CHECKING:
    from videos.drawing import VideoFacts


@dataclass(frozen=True)
class DrawnVideo:
    """A drawn video, a file of this machine, and its still, a JPEG."""

    file: Path
    still: bytes
    facts: VideoFacts
    fingerprint: str


class Videos(RetriedKind[Video]):
    """The queue of videos. A video at which our own code fails again and again, while others are drawn in between,
    fails with ``video_gave_up``."""

    name, model, task, queue = "Video", Video, "videos.tasks.draw", "videos"
    waiting, working, finished = VideoState.WAITING, VideoState.DRAWING, VideoState.READY
    order, since = ("asked_at", "pk"), "asked_at"
    blank = {"progress": 0}
    # a fault of our code that may concern this video alone
    alone, gave_up_code = frozenset(("internal_error",)), "video_gave_up"
    lost_code = "lease_expired"

    def topics(self, job: Video) -> tuple[str, ...]:
        return (f"run:{job.evaluation.public_id}",)

    def others_passed(self, job: Video) -> bool:
        passed = Video.objects.filter(state=VideoState.READY).exclude(pk=job.pk)
        return passed.filter(ended_at__gte=job.failed_at or job.asked_at).exists()

    def clean_up(self, job: Video) -> None:
        delete_files(names_of(job))  # left behind if the worker died between storing and writing


VIDEOS = register(Videos())


def finish_video(*, pk: int, lease: uuid.UUID, drawn: DrawnVideo, now: datetime) -> bool:
    """Store the files, then write the row, once. False: the lease is gone, and the files are deleted again. Raises
    PlatformFault("storage_failed")."""
    video = VIDEOS.held(pk, lease).first()
    if video is None:
        return False
    with drawn.file.open("rb") as content:
        sha256 = hashlib.file_digest(content, "sha256").hexdigest()
    file, still = names = store(video, drawn.file, drawn.still)
    finished = False
    try:
        with transaction.atomic():
            written = VIDEOS.end(
                VIDEOS.held(pk, lease),
                state=VideoState.READY,
                now=now,
                watched_at=now,
                progress=100,
                fingerprint=drawn.fingerprint,
                file=file,
                poster=still,
                sha256=sha256,
                size=drawn.facts.size,
                duration_ms=drawn.facts.duration_ms,
                width=drawn.facts.width,
                height=drawn.facts.height,
            )
            if written:
                record(VIDEO_READY, at=now, subject=video.evaluation.public_id, video=video.public_id)
        finished = written
    finally:
        if not finished:
            delete_files(names)
    return finished
