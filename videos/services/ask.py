"""Asking for a video of a run, and taking that back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from django.conf import settings
from django.db import IntegrityError, transaction

from accounts.quotas import limit_of, used_by
from core.locks import hold
from evaluation.models import Evaluation
from evaluation.quotas import STORAGE
from paddock.errors import UserFault

from ..models import REEL, Video, VideoState
from ..quotas import A_DAY, VIDEOS_A_DAY, VIDEOS_AT_ONCE
from ..reel import Segment, length_of
from ..run import VideoRun, check_language
from .files import NO_FILE, delete_files_on_commit
from .jobs import VIDEOS

if TYPE_CHECKING:
    from accounts.models import Racer


@dataclass(frozen=True)
class Asked:
    """The video, and whether this request put it into the queue (False: it was there already)."""

    video: Video
    queued: bool


def ask_for_video(
    *, evaluation: Evaluation, by: Racer, car: int = 0, part: str = "best", language: str, now: datetime
) -> Asked:
    """Put a video of a finished run into the queue, unless it is there, being drawn or ready: then that one is it.

    ``car``: the number of the car that is followed; ``part``: "whole", "best" or the number of a lap of that car. One
    that failed, or that shows somebody's old name or look, is made anew under the same id. That ``by`` may see the run
    is the caller's word.

    Raises UserFault ``video_run_not_finished``, ``car_number``, ``video_part``, ``video_no_best_lap``,
    ``video_lap_unknown``, ``video_language``, ``video_too_long``, ``videos_off``, ``storage_full``, ``videos_at_once``,
    ``videos_a_day``.
    """
    run = VideoRun.of(evaluation)
    number = run.part(car, part)
    of = {"evaluation": evaluation, "car": car, "part": number, "language": check_language(language)}
    while True:
        try:
            return _ask(run, of, by, now)
        except IntegrityError:  # somebody asked for the very same in this very moment: then theirs is it
            if not Video.objects.filter(**of).exists():
                raise


def ask_for_reel(
    *, evaluations: Sequence[Evaluation], segments: Sequence[Segment], by: Racer, language: str, now: datetime
) -> Asked:
    """Put a video of moments of several runs into the queue, as :func:`ask_for_video` does; there is one for each first
    run and language. ``evaluations``: the finished runs of the ``segments``. That ``by`` may see them, and who sees the
    first sees all of them, is the caller's word.

    Raises UserFault ``video_run_not_finished``, ``video_language``, ``video_too_long``, ``videos_off``,
    ``storage_full``, ``videos_at_once``, ``videos_a_day``.
    """
    by_id = {one.public_id: one for one in evaluations}
    run = VideoRun.of(by_id[segments[0].run])
    of = {"evaluation": run.evaluation, "car": 0, "part": REEL, "language": check_language(language)}
    return _ask(run, of, by, now, [one.told() for one in segments])


@transaction.atomic
def _ask(run: VideoRun, of: dict, by: Racer, now: datetime, segments: list[dict] | None = None) -> Asked:
    hold(by)
    video = Video.objects.filter(**of).first()
    if video is not None:
        video.evaluation = run.evaluation
        stands = video.state == VideoState.READY and video.segments == segments and run.is_current(video)
        if video.is_under_way or stands:
            return Asked(video, queued=False)
    length_ms = run.length_ms(of["car"], of["part"]) if segments is None else sum(map(length_of, segments))
    _refuse(length_ms, by, now)
    if video is None:
        video = Video.objects.create(**of, segments=segments, asked_by_id=by.pk, asked_at=now)
        VIDEOS.wake()
    elif not _ask_again(video, by, now, segments):
        return Asked(Video.objects.get(**of), queued=False)  # somebody else did in this very moment
    return Asked(video, queued=True)


def _refuse(length_ms: int, by: Racer, now: datetime) -> None:
    if not settings.VIDEOS:
        raise UserFault("videos_off")
    seconds = length_ms / 1000
    if seconds > settings.VIDEO_SECONDS:
        raise UserFault("video_too_long", seconds=round(seconds), limit=settings.VIDEO_SECONDS)
    limit_mb = limit_of(by, STORAGE.name)
    if used_by(by, STORAGE.name, now) >= limit_mb:
        raise UserFault("storage_full", limit_mb=limit_mb)
    for quota in (VIDEOS_AT_ONCE, VIDEOS_A_DAY):
        limit = limit_of(by, quota.name)
        if used_by(by, quota.name, now) >= limit:
            raise UserFault(quota.name, limit=limit)


def _ask_again(video: Video, by: Racer, now: datetime, segments: list[dict] | None) -> bool:
    """Put a row whose video failed or is stale back into the queue; its old files go."""
    again = video.asked_by_id == by.pk and video.asked_at > now - A_DAY
    as_seen = Video.objects.filter(pk=video.pk, state=video.state, ended_at=video.ended_at)
    asks = video.asks + 1 if again else 1
    changed = VIDEOS.begin_anew(as_seen, asked_by=by.pk, asked_at=now, asks=asks, segments=segments, **NO_FILE)
    if changed:
        delete_files_on_commit([video.file.name, video.poster.name])
        video.refresh_from_db()
    return changed


def draw_again(*, video: Video, now: datetime) -> bool:
    """Put a video that failed back into the queue for an admin; it counts for nobody's day. False when it is not failed
    any more."""
    failed = Video.objects.filter(pk=video.pk, state=VideoState.FAILED)
    return VIDEOS.begin_anew(failed, asked_at=now, **NO_FILE)


def stop_video(*, video: Video, now: datetime) -> bool:
    """Take a video that is not done out of the queue. False when it was done already.

    A worker that draws it finds its lease gone at the next beat, ends and keeps nothing.
    """
    stopped = VIDEOS.end(VIDEOS.under_way(video.pk), state=VideoState.FAILED, now=now, reason_code="video_stopped")
    video.refresh_from_db()
    return stopped
