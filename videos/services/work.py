"""One turn of a worker that draws videos: claim one, draw it under a heartbeat, write down how it ended."""

from __future__ import annotations

import logging
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import time

from django.conf import settings

from core.clock import database_now
from core.jobs.heartbeat import Heartbeat
from core.jobs.work import never, run_next
from evaluation.models import Evaluation
from paddock.errors import PlatformFault

from ..models import REEL, Video
from ..reel import Reel
from ..run import VideoRun
from .jobs import VIDEOS, DrawnVideo, finish_video

logger = logging.getLogger(__name__)
_PREFIX, _ABANDONED_AFTER_S = "video-", 86_400.0  # longer than any video takes to draw
ENCODER = "libx264"


def run_next_video(*, worker: str, interrupted: Callable[[], bool] = never) -> bool:
    """Draw the video that has waited longest, to its end. False: nothing waits, or this machine cannot encode any: then
    they wait for one that can.

    ``interrupted`` turns true when the worker is told to shut down: the video is then handed back.
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
    """Why this machine cannot encode videos; "" if it can. Loads PyAV."""
    try:
        import av

        av.codec.Codec(ENCODER, "w")
    except Exception as error:  # PyAV has errors of its own
        return f"{type(error).__name__}: {error}"
    return ""


def _remove_abandoned() -> None:
    """What killed workers had drawn on this machine."""
    for folder in Path(settings.FILE_UPLOAD_TEMP_DIR).glob(f"{_PREFIX}*"):
        with suppress(OSError):
            if folder.stat().st_mtime < time() - _ABANDONED_AFTER_S:
                shutil.rmtree(folder)


def _draw(video: Video, path: Path, tell: Callable[[int], None], should_stop: Callable[[], bool]) -> DrawnVideo:
    """Draw what the video shows now. Raises what :func:`videos.drawing.write_video` does, and PlatformFault
    ``storage_failed``."""
    from videos import drawing

    if video.part == REEL:
        reel = Reel.of(video)
        scenes, fingerprint = reel.scenes(), reel.fingerprint()
        facts = drawing.write_reel(
            scenes, path, on_progress=lambda share: tell(int(99 * share)), is_stopped=should_stop
        )
        return DrawnVideo(path, drawing.poster(scenes[-1]), facts, fingerprint)
    related = ("result", "track", "owner", "model", "submission__entry__race", "duel__race")
    run = VideoRun.of(Evaluation.objects.select_related(*related).get(pk=video.evaluation_id))
    what = (video.car, video.part, video.language)
    scene, fingerprint = run.scene(*what), run.fingerprint(*what)
    facts = drawing.write_video(scene, path, on_progress=lambda share: tell(int(99 * share)), is_stopped=should_stop)
    return DrawnVideo(path, drawing.poster(scene), facts, fingerprint)
