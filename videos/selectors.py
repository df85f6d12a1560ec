"""Which videos there are and who may watch, ask for and stop them. Every predicate has its queryset twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

from django.conf import settings
from django.db.models import Q, QuerySet

from evaluation.models import Evaluation, State

from .hooks import runs
from .models import REEL, UNDER_WAY, Video, VideoState
from .run import VideoRun

if TYPE_CHECKING:
    from django.contrib.auth.models import AnonymousUser

    from accounts.models import Racer

A_DAY = timedelta(days=1)


def can_see_video(racer: Racer | AnonymousUser | None, video: Video) -> bool:
    """Whether the racer may watch the video once it is ready: whoever may see the run. Twin of
    :func:`videos_visible_to`."""
    return runs().can_see(racer, video.evaluation)


def videos_visible_to(racer: Racer | AnonymousUser | None) -> QuerySet[Video]:
    """All videos of runs that the racer may see. Twin of :func:`can_see_video`."""
    return Video.objects.filter(evaluation__in=runs().visible_to(racer).order_by())


def can_ask_for_video(racer: Racer | AnonymousUser | None, evaluation: Evaluation) -> bool:
    """Whether the racer may ask for a video of the run: logged in, and sees it finished. Twin of
    :func:`evaluations_for_videos`."""
    if racer is None or not racer.is_authenticated or evaluation.state != State.FINISHED:
        return False
    return runs().can_see(racer, evaluation)


def evaluations_for_videos(racer: Racer | AnonymousUser | None) -> QuerySet[Evaluation]:
    """All runs that the racer may ask for videos of. Twin of :func:`can_ask_for_video`."""
    if racer is None or not racer.is_authenticated:
        return Evaluation.objects.none()
    return runs().visible_to(racer).filter(state=State.FINISHED)


def can_stop_video(racer: Racer | AnonymousUser | None, video: Video) -> bool:
    """Whether the racer may stop the video: who asked for it while it is not done, and admins. Twin of
    :func:`videos_to_stop`."""
    if racer is None or not racer.is_authenticated or not video.is_under_way:
        return False
    return racer.is_staff or racer.pk == video.asked_by_id


def videos_to_stop(racer: Racer | AnonymousUser | None) -> QuerySet[Video]:
    """All videos that the racer may stop. Twin of :func:`can_stop_video`."""
    if racer is None or not racer.is_authenticated:
        return Video.objects.none()
    mine = Q() if racer.is_staff else Q(asked_by=racer.pk)
    return Video.objects.filter(mine, state__in=UNDER_WAY)


@dataclass(frozen=True)
class ShownVideo:
    """A video as pages and the API show it. ``is_stale``: it is ready, but shows a name or a look of before, so that
    it is not shown but offered anew. ``position``: in the queue, 1 for the next one; None unless it waits."""

    video: Video
    is_stale: bool
    position: int | None

    @property
    def state(self) -> str:
        """``waiting``, ``drawing``, ``ready``, ``stale`` or ``failed``."""
        return "stale" if self.is_stale else self.video.state

    @property
    def mark(self) -> str:
        """Changes whenever there is something new to show."""
        return f"{self.video.public_id}-{self.state}-{self.position or self.video.progress}"


def shown_video(video: Video, run: VideoRun | None = None) -> ShownVideo:
    """One video as it is shown. ``run`` saves looking up what it shows."""
    stale = False
    if video.state == VideoState.READY:
        stale = not (run or VideoRun.of(video.evaluation)).is_current(video)
    return ShownVideo(video, stale, video_position(video))


def videos_of(run: VideoRun) -> list[ShownVideo]:
    """All videos of a run alone, the one asked for last first. Two queries more for each that waits."""
    videos = Video.objects.filter(evaluation=run.evaluation, part__lt=REEL).select_related("asked_by")
    for video in (found := list(videos)):
        video.evaluation = run.evaluation
    return [shown_video(video, run) for video in found]


def video_position(video: Video) -> int | None:
    """The place in the queue, 1 for the next one to be drawn; None unless it waits."""
    if video.state != VideoState.WAITING:
        return None
    before = Q(asked_at__lt=video.asked_at) | Q(asked_at=video.asked_at, pk__lt=video.pk)
    return Video.objects.filter(before, state=VideoState.WAITING).count() + 1


def videos_to_purge(now: datetime) -> QuerySet[Video]:
    """Videos that nobody has watched, or that failed, longer ago than they are kept."""
    before = now - timedelta(days=settings.VIDEO_DAYS)
    return Video.objects.filter(
        Q(state=VideoState.READY, watched_at__lt=before) | Q(state=VideoState.FAILED, ended_at__lt=before)
    )


def best_shown(videos: Sequence[ShownVideo], language: str, racer: Racer | AnonymousUser | None) -> ShownVideo | None:
    """The one that a page shows first: what the reader waits for, then one that can be watched, in their language if
    there is one."""

    def rank(shown: ShownVideo) -> tuple:
        mine = racer is not None and racer.pk is not None and shown.video.asked_by_id == racer.pk
        return (
            not (mine and shown.video.is_under_way),
            shown.state != VideoState.READY,
            shown.video.language != language,
        )

    watchable = [shown for shown in videos if shown.state == VideoState.READY or shown.video.is_under_way]
    return min(watchable, key=rank, default=None)
