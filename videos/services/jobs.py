"""The queue of videos (:mod:`core.jobs`): what is theirs of it, and how one ends that was drawn."""

from __future__ import annotations

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
from .files import delete_files, digest_of, names_of, store

if TYPE_CHECKING:
    from videos.drawing import VideoFacts


@dataclass(frozen=True)
class DrawnVideo:
    """What a worker has drawn: the video, a file of this machine; a JPEG; the fingerprint of what both show."""

    file: Path
    still: bytes
    facts: VideoFacts
    fingerprint: str


class Videos(RetriedKind[Video]):
    """First come, first drawn. One at which our own code fails again and again, while others are drawn in between,
    fails with ``video_gave_up``."""

    name, model, task, queue = "Video", Video, "videos.tasks.draw", "videos"
    waiting, working, finished = VideoState.WAITING, VideoState.DRAWING, VideoState.READY
    order = ("asked_at", "pk")
    blank = {"progress": 0}
    # a mistake of ours that may be about this one video, where the host, the storage and the worker are fine
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
    """Store the files and write the row, once. False: the lease is gone, and nothing is kept.

    The files are stored before the row is written, under names of this lease alone, and deleted again when it is not.
    Raises PlatformFault("storage_failed").
    """
    video = VIDEOS.held(pk, lease).first()
    if video is None:
        return False
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
                sha256=digest_of(drawn.file),
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
