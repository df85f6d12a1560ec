"""Claiming, holding and ending a video: guarded UPDATEs that name the lease (see evaluation.services.leases)."""

from __future__ import annotations

import logging
import uuid
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from django.conf import settings
from django.db import transaction
from django.db.models import F, Q, QuerySet

from core.events import record
from evaluation.services.leases import DETAIL_LIMIT, detail_with, pause_after
from evaluation.services.outages import storage_is_out
from paddock.errors import PaddockError, PlatformFault

from ...events import VIDEO_READY
from ...models import Video, VideoState
from .bell import ring_video_bell
from .files import delete_files, digest_of, names_of, store

if TYPE_CHECKING:
    from videos.film import FilmFacts

logger = logging.getLogger(__name__)
# A mistake of ours that may be about this one video, where the host, the storage and the worker are fine.
_MISTAKES = ("internal_error",)


@dataclass(frozen=True)
class DrawnVideo:
    """What a worker has drawn: the film in a file of this machine, a JPEG, and the fingerprint of what both show."""

    film: Path
    still: bytes
    facts: FilmFacts
    fingerprint: str


def claim_next_video(*, worker: str, now: datetime) -> Video | None:
    """Take the video that has waited longest under a new lease; None when nothing waits or all that waits pauses, and
    while the storage is out."""
    if storage_is_out():
        return None
    while True:
        waiting = _due(now).order_by("asked_at", "pk").only("attempt").first()
        if waiting is None:
            return None
        lease = uuid.uuid4()
        claimed = (
            _due(now)
            .filter(pk=waiting.pk, attempt=waiting.attempt)
            .update(
                state=VideoState.DRAWING,
                lease=lease,
                leased_until=now + timedelta(seconds=settings.LEASE_SECONDS),
                worker=worker[:128],
                attempt=F("attempt") + 1,
                started_at=now,
                not_before=None,
                progress=0,
            )
        )
        if claimed:
            video = _held(waiting.pk, lease).first()
            if video is not None:
                return video


def beat_video(*, video_id: int, lease: uuid.UUID, progress: int | None, now: datetime) -> bool:
    """Prolong a lease, and write the progress in per cent unless it is None. False: the lease is gone, stop at once."""
    changes: dict = {"leased_until": now + timedelta(seconds=settings.LEASE_SECONDS)}
    if progress is not None:
        changes["progress"] = progress
    return bool(_held(video_id, lease).update(**changes))


def finish_video(*, video_id: int, lease: uuid.UUID, drawn: DrawnVideo, now: datetime) -> bool:
    """Store the files and write the row, once. False: the lease is gone, and nothing is kept.

    The files are stored before the row is written, under names of this lease alone, and deleted again when it is not.
    Raises PlatformFault("storage_failed").
    """
    video = _held(video_id, lease).first()
    if video is None:
        return False
    film, still = names = store(video, drawn.film, drawn.still)
    finished = 0
    try:
        with transaction.atomic():
            written = _held(video_id, lease).update(
                state=VideoState.READY,
                lease=None,
                leased_until=None,
                ended_at=now,
                watched_at=now,
                progress=100,
                fingerprint=drawn.fingerprint,
                file=film,
                poster=still,
                sha256=digest_of(drawn.film),
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
    return bool(finished)


def fail_video(*, video_id: int, lease: uuid.UUID, fault: PaddockError, now: datetime, detail: str = "") -> bool:
    """End an attempt that failed. False: the lease is gone.

    A user's fault is final at once. While the storage is out it waits, and no attempt counts. After another fault of
    the platform the video goes back to its place in the queue, to be tried after growing pauses for as long as it
    takes. Only one at which our own code fails ``EVALUATION_MAX_ATTEMPTS`` times, while others were drawn in between,
    fails with ``video_gave_up``. ``detail`` is for operators.
    """
    video = _held(video_id, lease).first()
    return video is not None and _fail(_held(video_id, lease), video, fault, now, detail)


def release_video(*, video_id: int, lease: uuid.UUID, now: datetime) -> bool:
    """Hand a video back because its worker is shutting down: it is drawn anew elsewhere. No attempt counts."""
    with transaction.atomic():
        released = _held(video_id, lease).update(
            state=VideoState.WAITING,
            lease=None,
            leased_until=None,
            started_at=None,
            progress=0,
            attempt=F("attempt") - 1,
        )
        if released:
            ring_video_bell()
    return bool(released)


def sweep_videos(*, now: datetime, ring: bool = True) -> int:
    """Put videos whose worker disappeared back into the queue, and ring for whatever waits and does not pause. How many
    do."""
    for video in Video.objects.filter(state=VideoState.DRAWING, leased_until__lt=now).order_by("leased_until"):
        mine = _held(video.pk, video.lease).filter(leased_until__lt=now)
        if _fail(mine, video, PlatformFault("lease_expired"), now, f"worker {video.worker}"):
            delete_files(names_of(video))  # left behind if the worker died between storing and writing
    waiting = _due(now).count()
    if waiting and ring:
        ring_video_bell()
    return waiting


def _due(now: datetime) -> QuerySet[Video]:
    """What could be claimed."""
    return Video.objects.filter(Q(not_before=None) | Q(not_before__lte=now), state=VideoState.WAITING)


def _held(video_id: int, lease: uuid.UUID | None) -> QuerySet[Video]:
    """The video while this lease is good: one row or none."""
    return Video.objects.filter(pk=video_id, state=VideoState.DRAWING, lease=lease)


def _fails_alone(video: Video, fault: PaddockError) -> bool:
    """Whether our own code failed at it, and another was drawn since it was asked for or last failed."""
    if fault.code not in _MISTAKES:
        return False
    passed = Video.objects.filter(state=VideoState.READY).exclude(pk=video.pk)
    return passed.filter(ended_at__gte=video.failed_at or video.asked_at).exists()


@transaction.atomic
def _fail(mine: QuerySet[Video], video: Video, fault: PaddockError, now: datetime, detail: str) -> bool:
    """End the attempt of the row in ``mine`` (one or none); ``video`` is how it was read under the same lease."""
    changes: dict = {"lease": None, "leased_until": None, "progress": 0}
    ours = isinstance(fault, PlatformFault)
    if ours or detail:
        changes["operator_detail"] = detail_with(
            f"Attempt {video.attempt}: {fault.code}. {detail.strip()[-DETAIL_LIMIT:]}"
        )
        logger.warning("Video %s, attempt %s: %s. %s", video, video.attempt, fault.code, detail)
    kills = video.kills + _fails_alone(video, fault)
    pause = pause_after(video.attempt)
    if fault.code == "storage_failed" and storage_is_out():
        changes["attempt"], pause = F("attempt") - 1, None
    if ours:
        changes |= {"kills": kills, "failed_at": now}
    if ours and (kills == video.kills or kills < settings.EVALUATION_MAX_ATTEMPTS):
        not_before = now + pause if pause else None
        requeued = mine.update(state=VideoState.WAITING, started_at=None, not_before=not_before, **changes)
        if requeued and not pause:
            ring_video_bell()
        return bool(requeued)
    code, params = ("video_gave_up", {"attempts": kills}) if ours else (fault.code, fault.params)
    return bool(mine.update(state=VideoState.FAILED, ended_at=now, reason_code=code, reason_params=params, **changes))
