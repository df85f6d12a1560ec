"""One turn of a worker that draws videos: claim one, draw it under a heartbeat, write down how it ended."""

from __future__ import annotations

import logging
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import time
from typing import Any

from django.conf import settings

from core.clock import database_now
from evaluation.models import Evaluation
from evaluation.services.heart import Heart
from evaluation.services.work import fault_of, see_what_is_out
from paddock.errors import PlatformFault

from ...filming import FilmedRun
from ...models import Video
from .leases import DrawnVideo, beat_video, claim_next_video, fail_video, finish_video, release_video

logger = logging.getLogger(__name__)
BEAT_S = 1.0
_PREFIX, _ABANDONED_AFTER_S = "film-", 86_400.0  # longer than any film takes to draw
ENCODER = "libx264"


def run_next_video(*, worker: str, interrupted: Callable[[], bool] = lambda: False) -> bool:
    """Draw the video that has waited longest, to its end. False: nothing waits, or this machine cannot encode any: then
    they wait for one that can.

    ``interrupted`` turns true when the worker is told to shut down: the video is then handed back.
    """
    if problem := encoder_problem():
        logger.error("%s draws no videos: %s", worker, PlatformFault("video_encoder_missing", detail=problem))
        return False
    video = claim_next_video(worker=worker, now=database_now())
    if video is None:
        return False
    ident: dict[str, Any] = {"video_id": video.pk, "lease": video.lease}

    def keep_beating(progress: int | None) -> bool:
        return beat_video(**ident, progress=progress, now=database_now())

    _remove_abandoned()
    with (
        Heart(f"video {video}", keep_beating, every_s=BEAT_S) as heart,
        tempfile.TemporaryDirectory(prefix=_PREFIX, dir=settings.FILE_UPLOAD_TEMP_DIR) as folder,
    ):
        try:
            drawn = _draw(video, Path(folder) / "film.mp4", heart.tell, lambda: heart.lost or interrupted())
            ended = finish_video(**ident, drawn=drawn, now=database_now())
            how = "is ready"
        except Exception as error:
            if not heart.lost and interrupted():
                ended, how = release_video(**ident, now=database_now()), "was handed back"
            else:
                fault, detail = fault_of(PlatformFault("lease_expired") if heart.lost else error)
                see_what_is_out(fault)
                ended = fail_video(**ident, fault=fault, now=database_now(), detail=detail)
                how = f"failed: {fault.code}"
    logger.info("Video %s %s.", video, how if ended else "was stopped or given to somebody else")
    return True


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
    """Draw what the video shows now. Raises what :func:`videos.film.film` does, and PlatformFault
    ``storage_failed``."""
    from videos import film

    related = ("result", "track", "owner", "model", "submission__entry__race", "duel__race")
    run = FilmedRun.of(Evaluation.objects.select_related(*related).get(pk=video.evaluation_id))
    what = (video.car, video.part, video.language)
    scene, fingerprint = run.scene(*what), run.fingerprint(*what)
    facts = film.film(scene, path, on_progress=lambda share: tell(int(99 * share)), is_stopped=should_stop)
    return DrawnVideo(path, film.poster(scene), facts, fingerprint)
