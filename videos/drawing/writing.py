"""The writer of video files: each frame is drawn and encoded in turn."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from .scene import ANIMATED, FULL, DrawingStopped, Form, VideoFacts, VideoScene

if TYPE_CHECKING:
    import numpy as np

    from .timeline import FrameTimeline

_REPORT_EVERY_S = 0.2
_DIM = 0.42  # of the last picture under the card
_CARD_IN_S = 0.3
_JPEG_QUALITY = 88
MOST_ANIMATED_BYTES = 6_000_000
_QUALITIES = (75, 45, 20, 5)


def write_video(
    scene: VideoScene,
    path: Path,
    *,
    on_progress: Callable[[float], None] = lambda share: None,
    is_stopped: Callable[[], bool] = lambda: False,
    form: Form = FULL,
) -> VideoFacts:
    """Draw one scene into a file, see :func:`write_reel`."""
    return write_reel([scene], path, on_progress=on_progress, is_stopped=is_stopped, form=form)


def write_animation(
    scene: VideoScene,
    path: Path,
    *,
    on_progress: Callable[[float], None] = lambda share: None,
    is_stopped: Callable[[], bool] = lambda: False,
    most_bytes: int = MOST_ANIMATED_BYTES,
) -> VideoFacts:
    """Draw one scene into a small animated WebP of at most ``most_bytes``, with less quality where it is needed."""
    for quality in _QUALITIES:
        tell, stop = on_progress, is_stopped
        facts = write_reel([scene], path, on_progress=tell, is_stopped=stop, form=ANIMATED, quality=quality)
        if facts.size <= most_bytes:
            break
    return facts


def write_reel(
    scenes: Sequence[VideoScene],
    path: Path,
    *,
    on_progress: Callable[[float], None] = lambda share: None,
    is_stopped: Callable[[], bool] = lambda: False,
    form: Form = FULL,
    quality: int | None = None,
) -> VideoFacts:
    """Draw scenes into one file, one after the other: MP4 with H.264 (yuv420p, no sound, the index first), a key frame
    each two seconds. With a ``quality`` (1 to 100) an animated WebP that repeats.

    The file is written beside ``path`` and then put in place whole. ``on_progress`` gets a share from 0 to 1 about five
    times a second; ``is_stopped`` is called before each frame. The same scenes make the same bytes on the same library
    versions. Starts no thread.

    Raises ``DrawingStopped``, OSError, and UserFault: ``video_no_steps`` for a trace of the followed car without two
    readable rows, ``video_too_long`` (``MAX_SECONDS``). After any of them ``path`` is as it was before.
    """
    from .timeline import prepare

    takes = [prepare(scene, form) for scene in scenes]
    unfinished = path.with_name(f".{secrets.token_hex(8)}{path.suffix}")
    try:
        unfinished.touch(exist_ok=False)
        facts = _write_frames(takes, unfinished, on_progress, is_stopped, quality)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
    return facts


def poster(scene: VideoScene, *, form: Form = FULL) -> bytes:
    """A JPEG of the frame that :func:`telling` chooses. Raises as :func:`write_video`."""
    import cv2

    from .timeline import prepare

    take = prepare(scene, form)
    with _one_thread():
        painter = Painter(take)
        picture = painter.frame(telling(take))
        written, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not written:
        raise RuntimeError("OpenCV wrote no JPEG")
    return data.tobytes()


def telling(take: FrameTimeline) -> int:
    """The frame nearest to the middle in which the followed car drives on the road, else in which it drives."""
    drive, track, middle = take.hero.way, take.scene.track, take.driven // 2
    driving = [k for k in range(take.driven) if not drive.standing[k] and not drive.gone[k]]
    driving.sort(key=lambda number: abs(number - middle))
    on_road = (k for k in driving if track.on_road(float(drive.x[k]), float(drive.y[k])))
    return next(on_road, driving[0] if driving else middle)


class Painter:
    def __init__(self, take: FrameTimeline) -> None:
        import numpy as np

        from .card import caption, result_card
        from .panel import Panel
        from .perspective import PerspectiveView
        from .view import View

        self._take = take
        self._picture = np.empty((take.form.height, take.form.width, 3), np.uint8)
        self._panel = Panel(take)
        view = View if take.lens is None else PerspectiveView
        self._view = view(take, take.form.width, take.form.height - self._panel.height)
        self._card = result_card(take, take.words)
        self._caption = caption(take) if take.scene.caption else None
        self._last: np.ndarray | None = None
        self._ended = -1  # the last frame of the end that the picture shows

    def frame(self, number: int) -> np.ndarray:
        """Frame ``number``, BGR (height, width, 3); overwritten by the next call."""
        driven = self._take.driven
        if number < driven:
            self._ended = -1
            self._paint(number)
        else:
            self._end(number - driven)
        return self._picture

    def _paint(self, number: int) -> None:
        self._view.paint(self._picture, number)
        self._panel.paint(self._picture, number)
        if self._caption is not None:
            height = self._caption.cover.shape[0]
            margin = round(24 * self._take.form.height / 720.0)
            self._caption.put(self._picture, margin, self._take.form.height - height - margin, 1.0)

    def _end(self, number: int) -> None:
        """Fade the card in over the last picture, which darkens."""
        import numpy as np

        if self._last is None:
            self._paint(self._take.driven)
            self._last = self._picture.copy()
        whole = max(1, round(_CARD_IN_S * self._take.form.fps))
        number = min(number, whole - 1)
        if number == self._ended:
            return
        self._ended = number
        share = (number + 1) / whole
        share = share * share * (3.0 - 2.0 * share)
        np.copyto(self._picture, (self._last * (1.0 - (1.0 - _DIM) * share)).astype(np.uint8))
        height, width = self._card.cover.shape
        top = (self._take.form.height - height) // 2
        self._card.put(self._picture, (self._take.form.width - width) // 2, top, share)


def _write_frames(
    takes: Sequence[FrameTimeline],
    path: Path,
    on_progress: Callable[[float], None],
    is_stopped: Callable[[], bool],
    quality: int | None,
) -> VideoFacts:
    from .encode import Encoder

    drawing = encoding = 0.0
    reported = time.monotonic()
    written, frames = 0, sum(take.frames for take in takes)
    with _one_thread(), Encoder(path, takes[0].form, quality) as encoder:
        for take in takes:
            painter = Painter(take)
            for number in range(take.frames):
                if is_stopped():
                    raise DrawingStopped
                began = time.process_time()
                picture = painter.frame(number)
                drawn = time.process_time()
                encoder.add(picture)
                written += 1
                drawing += drawn - began
                encoding += time.process_time() - drawn
                if time.monotonic() - reported >= _REPORT_EVERY_S:
                    on_progress(written / frames)
                    reported = time.monotonic()
    on_progress(1.0)
    width, height, fps = takes[0].form
    return VideoFacts(
        frames=frames,
        duration_ms=round(1000.0 * frames / fps),
        width=width,
        height=height,
        size=path.stat().st_size,
        drawing_s=round(drawing, 3),
        encoding_s=round(encoding, 3),
    )


@contextmanager
def _one_thread() -> Iterator[None]:
    """OpenCV uses one thread within the block: more cost more than they bring for a few polygons."""
    import cv2

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)
