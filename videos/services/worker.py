"""One turn of a worker: claim a video, draw it under a heartbeat, record its end."""

import logging
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import time

from django.conf import settings

from core.database.clock import database_now
from core.jobs.heartbeat import Heartbeat
from core.jobs.work import never, run_next
from evaluation.models import Evaluation
from paddock.errors import PlatformFault

from ..models import REEL, Video, VideoFormat
from ..scenes import RELATED, ClipForm, Reel, VideoRun
from .queue import VIDEOS, DrawnVideo, finish_video

logger = logging.getLogger(__name__)
_PREFIX, _ABANDONED_AFTER_S = "video-", 86_400.0  # longer than any video takes to draw
ENCODER = "libx264"


def run_next_video(*, worker: str, interrupted: Callable[[], bool] = never) -> bool:
    """Draw the video that has waited longest. False: nothing waits, or this machine cannot encode videos.

    ``interrupted`` returns true when the worker shuts down; the video then goes back to the queue.
    """
    if problem := encoder_problem():
        logger.error("%s draws no videos: %s", worker, PlatformFault("video_encoder_missing", detail=problem))
        return False

    def draw(video: Video, heartbeat: Heartbeat) -> bool:
        _remove_abandoned()
        with tempfile.TemporaryDirectory(prefix=_PREFIX, dir=settings.FILE_UPLOAD_TEMP_DIR) as folder:
            stopped = lambda: heartbeat.lost or interrupted()  # noqa: E731
            drawn = _draw(video, Path(folder) / "video.mp4", heartbeat.tell, stopped)
            assert video.lease is not None, "it was claimed"
            return finish_video(pk=video.pk, lease=video.lease, drawn=drawn, now=database_now())

    return run_next(VIDEOS, draw, worker=worker, interrupted=interrupted)


def encoder_problem() -> str:
    """The reason why this machine cannot encode videos, or "". Loads PyAV."""
    try:
        import av

        av.codec.Codec(ENCODER, "w")
    except Exception as error:  # PyAV raises its own classes
        return f"{type(error).__name__}: {error}"
    return ""


def _remove_abandoned() -> None:
    for folder in Path(settings.FILE_UPLOAD_TEMP_DIR).glob(f"{_PREFIX}*"):
        with suppress(OSError):
            if folder.stat().st_mtime < time() - _ABANDONED_AFTER_S:
                shutil.rmtree(folder)


def _draw(video: Video, path: Path, tell: Callable[[int], None], should_stop: Callable[[], bool]) -> DrawnVideo:
    """Draw the present state of a video. Raises as :func:`videos.drawing.write_reel`, and PlatformFault
    ``storage_failed``."""
    from videos import drawing

    def on_progress(share: float) -> None:
        tell(int(99 * share))

    if video.part == REEL:
        reel = Reel.of(video)
        scenes, fingerprint = reel.scenes(), reel.fingerprint()
        facts = drawing.write_reel(scenes, path, on_progress=on_progress, is_stopped=should_stop)
        return DrawnVideo(path, drawing.poster(scenes[-1]), facts, fingerprint)
    run = VideoRun.of(Evaluation.objects.select_related(*RELATED).get(pk=video.evaluation_id))
    what = (video.car, video.part, video.language, ClipForm.of(video))
    scene, fingerprint = run.scene(*what), run.fingerprint(*what)
    write = drawing.write_animation if video.format == VideoFormat.WEBP else drawing.write_video
    facts = write(scene, path, on_progress=on_progress, is_stopped=should_stop)
    return DrawnVideo(path, drawing.poster(scene), facts, fingerprint)
