"""How long videos are kept, and what takes them away."""

from __future__ import annotations

from contextlib import suppress
from datetime import datetime, timedelta

from django.db.models import Q
from django.utils import timezone

from evaluation.models import Evaluation, TrainedModel

from ..models import REEL, Video, VideoState
from ..selectors import videos_to_purge
from .files import FOLDER, NO_FILE, delete_files, delete_files_on_commit, storage

NOTED_EVERY = timedelta(hours=1)  # watching is written down no more often
ORPHANED_AFTER = timedelta(days=1)  # longer than any attempt takes from storing a file to naming it


def note_watched(*, video: Video, now: datetime) -> None:
    """Write down that somebody watches: what is watched is kept."""
    Video.objects.filter(pk=video.pk, state=VideoState.READY, watched_at__lt=now - NOTED_EVERY).update(watched_at=now)


def forget_lost_file(*, video: Video, now: datetime) -> bool:
    """A ready video whose file is not in the storage any more failed after all, so that it can be asked for anew."""
    lost = Video.objects.filter(pk=video.pk, state=VideoState.READY, file=video.file.name).update(
        state=VideoState.FAILED, ended_at=now, progress=0, reason_code="video_file_lost", **NO_FILE
    )
    if lost:
        delete_files([video.poster.name])
    return bool(lost)


def remove_videos_of_model(*, model: TrainedModel) -> int:
    """Delete all videos in which a model drives, files included. How many."""
    mine = Q(evaluation__model=model) | Q(evaluation__rivals__model=model)
    runs = Evaluation.objects.filter(Q(model=model) | Q(rivals__model=model)).values_list("public_id", flat=True)
    reels = list(Video.objects.filter(part=REEL).only("pk", "segments")) if (in_runs := set(runs)) else []
    shown = [reel.pk for reel in reels if any(one["run"] in in_runs for one in reel.segments)]
    _, counts = Video.objects.filter(mine | Q(pk__in=shown)).delete()
    return counts.get("videos.Video", 0)


def purge_videos(*, now: datetime) -> int:
    """Delete videos that nobody has watched for ``VIDEO_DAYS``, and files that no video refers to. How many videos."""
    _, counts = videos_to_purge(now).delete()
    _delete_orphans(now - ORPHANED_AFTER)
    return counts.get("videos.Video", 0)


def take_files_along(sender: object, *, instance: Video, **kwargs: object) -> None:
    """A receiver of ``post_delete``: however a row goes, its files go with it."""
    delete_files_on_commit([instance.file.name, instance.poster.name])


def _delete_orphans(before: datetime) -> None:
    """Files of workers that were killed between storing and writing, after which the row was deleted, too."""
    with suppress(OSError):  # no folder yet
        for name in (f"{FOLDER}/{one}" for one in storage().listdir(FOLDER)[1]):
            with suppress(OSError):  # somebody else deleted it
                stored_at = storage().get_modified_time(name)
                if (stored_at if timezone.is_aware(stored_at) else timezone.make_aware(stored_at)) < before:
                    delete_files([name])
