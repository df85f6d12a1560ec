"""Request a video of a run, or stop one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from django.conf import settings
from django.db import IntegrityError, transaction
from django.db.models import Max
from django.utils.translation import gettext_lazy as _

from accounts.quotas import limit_of, used_by
from core.audit.recording import audited
from core.database.locks import hold
from evaluation.garage.quotas import STORAGE
from evaluation.models import Evaluation
from paddock.errors import UserFault

from ..models import CLIPS, REEL, Video, VideoState
from ..quotas import A_DAY, VIDEOS_A_DAY, VIDEOS_AT_ONCE
from ..scenes import PLAIN, ClipForm, Segment, VideoRun, check_language, is_current
from .queue import VIDEOS
from .stored_files import NO_FILE, delete_files_on_commit

if TYPE_CHECKING:
    from accounts.models import Racer


@dataclass(frozen=True)
class VideoRequest:
    """A video, and whether this request queued it."""

    video: Video
    queued: bool


def request_video(
    *,
    evaluation: Evaluation,
    by: Racer,
    car: int = 0,
    part: str = "best",
    language: str,
    now: datetime,
    form: ClipForm = PLAIN,
) -> VideoRequest:
    """Queue a video of a finished run, unless it is queued, being drawn or ready.

    ``car``: the number of the car that is followed; ``part``: "whole", "best" or the number of a lap of that car. A
    ``form``: its camera and format, and the moment of a clip. A
    failed or stale video is made anew under the same id. The caller checks that ``by`` may see the run.

    Raises UserFault ``video_run_not_finished``, ``car_number``, ``video_part``, ``video_no_best_lap``,
    ``video_lap_unknown``, ``video_language``, ``video_too_long``, ``videos_off``, ``storage_full``, ``videos_at_once``,
    ``videos_a_day``, and those of :meth:`videos.scenes.ClipForm.checked`.
    """
    run = VideoRun.of(evaluation)
    number = run.part(car, part)
    form = form.checked(run, car, number)
    of = {"evaluation": evaluation, "car": car, "language": check_language(language)}
    if form == PLAIN:
        of["part"] = number
    while True:
        try:
            return _request(run, of if form == PLAIN else of | _clip(of, form), by, now)
        except IntegrityError:  # a concurrent request for the same video, or for another clip
            if not Video.objects.filter(**of).exists():
                raise


def request_reel(
    *, evaluations: Sequence[Evaluation], segments: Sequence[Segment], by: Racer, language: str, now: datetime
) -> VideoRequest:
    """Queue a video of moments of several runs, one for each first run and language. ``evaluations``: the finished runs
    of the ``segments``. The caller checks that ``by`` may see them, and that every racer with access to the first has
    access to all of them.

    Raises UserFault ``video_run_not_finished``, ``video_language``, ``video_too_long``, ``videos_off``,
    ``storage_full``, ``videos_at_once``, ``videos_a_day``.
    """
    by_id = {one.public_id: one for one in evaluations}
    run = VideoRun.of(by_id[segments[0].run])
    of = {"evaluation": run.evaluation, "car": 0, "part": REEL, "language": check_language(language)}
    return _request(run, of, by, now, segments)


def _clip(of: dict, form: ClipForm) -> dict:
    """The clip of this form, or the next one of the run."""
    clips = Video.objects.filter(**of, part__gte=CLIPS, part__lt=REEL)
    made = clips.filter(**asdict(form)).values_list("part", flat=True).first()
    last = clips.aggregate(last=Max("part"))["last"] or CLIPS - 1
    return asdict(form) | {"part": last + 1 if made is None else made}


@transaction.atomic
def _request(
    run: VideoRun, of: dict, by: Racer, now: datetime, moments: Sequence[Segment] | None = None
) -> VideoRequest:
    hold(by)
    segments = None if moments is None else [asdict(one) for one in moments]
    video = Video.objects.filter(**of).first()
    if video is not None:
        video.evaluation = run.evaluation
        stands = video.state == VideoState.READY and video.segments == segments and is_current(video, run)
        if video.is_under_way or stands:
            return VideoRequest(video, queued=False)
    if moments is not None:
        length_ms = sum(one.length_ms for one in moments)
    else:
        length_ms = of["to_ms"] - of["from_ms"] if "to_ms" in of else run.length_ms(of["car"], of["part"])
    _check_limits(length_ms, by, now)
    if video is None:
        video = Video.objects.create(**of, segments=segments, asked_by_id=by.pk, asked_at=now)
        VIDEOS.wake()
    elif not _request_anew(video, by, now, segments):
        return VideoRequest(Video.objects.get(**of), queued=False)  # a concurrent request did
    return VideoRequest(video, queued=True)


def _check_limits(length_ms: int, by: Racer, now: datetime) -> None:
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


def _request_anew(video: Video, by: Racer, now: datetime, segments: list[dict] | None) -> bool:
    """Requeue a failed or stale video and delete its old files."""
    again = video.asked_by_id == by.pk and video.asked_at > now - A_DAY
    as_seen = Video.objects.filter(pk=video.pk, state=video.state, ended_at=video.ended_at)
    asks = video.asks + 1 if again else 1
    changed = VIDEOS.begin_anew(as_seen, asked_by=by.pk, asked_at=now, asks=asks, segments=segments, **NO_FILE)
    if changed:
        delete_files_on_commit([video.file.name, video.poster.name])
        video.refresh_from_db()
    return changed


def redraw_video(*, video: Video, now: datetime) -> bool:
    """Requeue a failed video for an admin, outside of all quotas. False when it is not failed any more."""
    failed = Video.objects.filter(pk=video.pk, state=VideoState.FAILED)
    return VIDEOS.begin_anew(failed, asked_at=now, **NO_FILE)


@audited("video.stopped", _("Video stopped"), target="video", unless="asked_by")
def stop_video(*, video: Video, now: datetime) -> bool:
    """Remove an unfinished video from the queue; a worker that draws it stops at its next heartbeat. False when it was
    finished."""
    stopped = VIDEOS.end(VIDEOS.under_way(video.pk), state=VideoState.FAILED, now=now, reason_code="video_stopped")
    video.refresh_from_db()
    return stopped
