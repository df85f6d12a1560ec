"""The stored files of videos under unguessable names, how long they are kept, and their deletion."""

import logging
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from datetime import datetime, timedelta
from pathlib import Path

from django.core.files.base import ContentFile, File
from django.core.files.storage import Storage
from django.db.models import Q
from django.utils import timezone

from core.database.after_commit import after_commit
from core.files.storage_faults import storage_at_work
from evaluation.models import Evaluation, TrainedModel

from ..models import REEL, Video, VideoState
from ..selectors import videos_to_purge

logger = logging.getLogger(__name__)
FOLDER = "videos"
NOTED_EVERY = timedelta(hours=1)  # the shortest time between two updates of watched_at
ORPHANED_AFTER = timedelta(days=1)  # longer than an attempt takes from storing a file to naming it
# The fields of a row without a file.
NO_FILE = {
    **dict.fromkeys(("fingerprint", "file", "poster", "sha256"), ""),
    **dict.fromkeys(("size", "duration_ms", "width", "height"), 0),
    "watched_at": None,
}


def storage() -> Storage:
    return Video._meta.get_field("file").storage


def names_of(video: Video) -> tuple[str, str]:
    """The names of the video's file and its still, unique to the current lease."""
    stem = f"{FOLDER}/{video.public_id}-{video.attempt}-{video.lease}"
    return f"{stem}.{video.format}", f"{stem}.jpg"


def store(video: Video, drawn: Path, still: bytes) -> tuple[str, str]:
    """Store both files or none; their names. Raises PlatformFault("storage_failed")."""
    stored: list[str] = []
    with ExitStack() as undo:
        undo.callback(delete_files, stored)
        with storage_at_work(), drawn.open("rb") as file:
            for name, content in zip(names_of(video), (File(file), ContentFile(still)), strict=True):
                stored.append(storage().save(name, content))
        undo.pop_all()
    return stored[0], stored[1]


def delete_files(names: Iterable[str | None]) -> None:
    """Delete those files that no video refers to. A file that cannot be deleted is logged, and purged later."""
    for name in filter(None, names):
        try:
            # the commit of a lost connection may have succeeded
            if not Video.objects.filter(Q(file=name) | Q(poster=name)).exists():
                storage().delete(name)
        except Exception:  # each storage raises other classes
            logger.exception("The unused file %s could not be deleted.", name)


def delete_files_on_commit(names: Iterable[str | None]) -> None:
    """:func:`delete_files` once the current transaction is committed."""
    after_commit(delete_files, list(names))


def note_watched(*, video: Video, now: datetime) -> None:
    """Record that a racer watches the video, which keeps it."""
    before = now - NOTED_EVERY
    if video.watched_at is not None and video.watched_at < before:
        Video.objects.filter(pk=video.pk, state=VideoState.READY, watched_at__lt=before).update(watched_at=now)


def forget_lost_file(*, video: Video, now: datetime) -> bool:
    """Mark a ready video without its file as failed, so that it can be requested again."""
    lost = Video.objects.filter(pk=video.pk, state=VideoState.READY, file=video.file.name).update(
        state=VideoState.FAILED, ended_at=now, progress=0, reason_code="video_file_lost", **NO_FILE
    )
    if lost:
        delete_files([video.poster.name])
    return bool(lost)


def remove_videos_of_model(*, model: TrainedModel) -> int:
    """Delete all videos in which a model drives, with their files; their number."""
    mine = Q(evaluation__model=model) | Q(evaluation__rivals__model=model)
    runs = Evaluation.objects.filter(Q(model=model) | Q(rivals__model=model)).values_list("public_id", flat=True)
    reels = list(Video.objects.filter(part=REEL).only("pk", "segments")) if (in_runs := set(runs)) else []
    shown = [reel.pk for reel in reels if any(one["run"] in in_runs for one in reel.segments)]
    _, counts = Video.objects.filter(mine | Q(pk__in=shown)).delete()
    return counts.get("videos.Video", 0)


def take_deleted_model(sender: object, *, model: TrainedModel, **kwargs: object) -> None:
    """A receiver of ``model_deleted``."""
    remove_videos_of_model(model=model)


def purge_videos(*, now: datetime) -> int:
    """Delete videos unwatched for ``VIDEO_DAYS``, and files that no video refers to; the number of videos."""
    _, counts = videos_to_purge(now).delete()
    _delete_orphans(now - ORPHANED_AFTER)
    return counts.get("videos.Video", 0)


def take_files_along(sender: object, *, instance: Video, **kwargs: object) -> None:
    """A receiver of ``post_delete`` that deletes the files of the row."""
    delete_files_on_commit([instance.file.name, instance.poster.name])


def _delete_orphans(before: datetime) -> None:
    """Delete files of workers that were killed before they wrote the row."""
    with suppress(OSError):  # no folder yet
        for name in (f"{FOLDER}/{one}" for one in storage().listdir(FOLDER)[1]):
            with suppress(OSError):  # deleted meanwhile
                stored_at = storage().get_modified_time(name)
                if (stored_at if timezone.is_aware(stored_at) else timezone.make_aware(stored_at)) < before:
                    delete_files([name])
