"""Selectors and permissions of videos. Every permission has its twin, a queryset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

from django.conf import settings
from django.db.models import Q, QuerySet, Sum

from core.database.kept_queries import KeptQuery
from evaluation.models import Evaluation, State

from .hooks import runs
from .models import REEL, UNDER_WAY, Video, VideoState
from .scenes import VideoRun, is_current

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

A_DAY = timedelta(days=1)


def can_see_video(racer: Racer | AnonymousUser | None, video: Video) -> bool:
    """Whether the racer may watch the finished video. Twin of :func:`videos_visible_to`."""
    return runs().can_see(racer, video.evaluation)


def videos_visible_to(racer: Racer | AnonymousUser | None) -> QuerySet[Video]:
    """The videos of runs that the racer may see."""
    return Video.objects.filter(evaluation__in=runs().visible_to(racer).order_by())


def can_request_video(racer: Racer | AnonymousUser | None, evaluation: Evaluation) -> bool:
    """Whether the racer may request a video of the run. Twin of :func:`evaluations_for_videos`."""
    if racer is None or not racer.is_authenticated or evaluation.state != State.FINISHED:
        return False
    return runs().can_see(racer, evaluation)


def evaluations_for_videos(racer: Racer | AnonymousUser | None) -> QuerySet[Evaluation]:
    """The runs of which the racer may request videos."""
    if racer is None or not racer.is_authenticated:
        return Evaluation.objects.none()
    return runs().visible_to(racer).filter(state=State.FINISHED)


def can_stop_video(racer: Racer | AnonymousUser | None, video: Video) -> bool:
    """Whether the racer may stop the unfinished video. Twin of :func:`videos_to_stop`."""
    if racer is None or not racer.is_authenticated or not video.is_under_way:
        return False
    return racer.is_staff or racer.pk == video.asked_by_id


def videos_to_stop(racer: Racer | AnonymousUser | None) -> QuerySet[Video]:
    """The videos that the racer may stop: the requester their own, admins all."""
    if racer is None or not racer.is_authenticated:
        return Video.objects.none()
    mine = Q() if racer.is_staff else Q(asked_by=racer.pk)
    return Video.objects.filter(mine, state__in=UNDER_WAY)


@dataclass(frozen=True)
class ShownVideo:
    """A video as pages and the API show it. ``is_stale``: it is ready, but shows an old name or look. ``position``: in
    the queue, 1 for the next one; None unless it waits."""

    video: Video
    is_stale: bool
    position: int | None

    @property
    def state(self) -> str:
        """``waiting``, ``drawing``, ``ready``, ``stale`` or ``failed``."""
        return "stale" if self.is_stale else self.video.state

    @property
    def mark(self) -> str:
        """A mark that changes with the state or the progress."""
        return f"{self.video.public_id}-{self.state}-{self.position or self.video.progress}"


def shown_video(video: Video, run: VideoRun | None = None) -> ShownVideo:
    """The shown state of a video. ``run``: spares queries."""
    return ShownVideo(video, _is_stale(video, run), video_position(video))


def _is_stale(video: Video, run: VideoRun | None) -> bool:
    return video.state == VideoState.READY and not is_current(video, run or VideoRun.of(video.evaluation))


_of_run = KeptQuery(lambda run: Video.objects.filter(evaluation_id=run, part__lt=REEL).select_related("asked_by"))


def videos_of(run: VideoRun) -> list[ShownVideo]:
    """All videos of a run alone, the last request first. One query, and one more where any waits."""
    for video in (found := _of_run(run=run.evaluation.pk)):
        video.evaluation = run.evaluation
    places: dict[int, int] = {}
    if any(video.state == VideoState.WAITING for video in found):
        queue = Video.objects.filter(state=VideoState.WAITING).order_by("asked_at", "pk").values_list("pk", flat=True)
        places = {pk: place for place, pk in enumerate(queue, start=1)}
    return [ShownVideo(video, _is_stale(video, run), places.get(video.pk)) for video in found]


def video_position(video: Video) -> int | None:
    """The position in the queue, 1 for the next one; None unless it waits."""
    if video.state != VideoState.WAITING:
        return None
    before = Q(asked_at__lt=video.asked_at) | Q(asked_at=video.asked_at, pk__lt=video.pk)
    return Video.objects.filter(before, state=VideoState.WAITING).count() + 1


def videos_to_purge(now: datetime) -> QuerySet[Video]:
    """Videos last watched, or failed, more than ``VIDEO_DAYS`` ago."""
    before = now - timedelta(days=settings.VIDEO_DAYS)
    return Video.objects.filter(
        Q(state=VideoState.READY, watched_at__lt=before) | Q(state=VideoState.FAILED, ended_at__lt=before)
    )


def best_shown(videos: Sequence[ShownVideo], language: str, racer: Racer | AnonymousUser | None) -> ShownVideo | None:
    """The video that a page shows first: the reader's unfinished one, then a ready one, in the reader's language if
    possible."""

    def rank(shown: ShownVideo) -> tuple:
        mine = racer is not None and racer.pk is not None and shown.video.asked_by_id == racer.pk
        return (
            not (mine and shown.video.is_under_way),
            shown.state != VideoState.READY,
            shown.video.language != language,
        )

    watchable = [shown for shown in videos if shown.state == VideoState.READY or shown.video.is_under_way]
    return min(watchable, key=rank, default=None)


def bytes_of_videos() -> int:
    """The size of all video files."""
    return Video.objects.aggregate(size=Sum("size"))["size"] or 0
