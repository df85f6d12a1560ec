"""From a scene to a file: frame after frame is drawn and encoded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from .scene import FULL, FilmFacts, Form, Scene


def film(
    scene: Scene,
    out: BinaryIO | Path,
    *,
    on_progress: Callable[[float], None] = lambda share: None,
    is_stopped: Callable[[], bool] = lambda: False,
    form: Form = FULL,
) -> FilmFacts:
    """Draw and encode the scene: MP4 with H.264 (yuv420p, no sound, the index first), a key frame each two seconds.

    ``out``: a path, which is written beside itself and then put in place whole, or a binary file that can be written
    and sought. ``on_progress`` gets a share from 0 to 1 about five times a second of this process's time; before each
    frame ``is_stopped`` is asked. What either raises goes through. The same scene makes the same bytes on the same
    library versions.

    Takes about 1 s of one core for 6 s of the run and less than 400 MB; starts no thread. Raises
    :class:`~evaluation.film.Stopped`, and UserFault: ``video_no_steps`` for a trace of the followed car without two
    readable rows, ``video_too_long`` (``MAX_SECONDS``). OSError where ``out`` cannot be written. After any of them no
    file is left at the path.
    """
    raise NotImplementedError


def poster(scene: Scene, *, form: Form = FULL) -> bytes:
    """A JPEG of the picture in the middle of the video. Raises as :func:`film`."""
    raise NotImplementedError
